//! What is said of a file of samples beside its rows: their scale, and where they came from.
//!
//! A `.csv` says it in comments above its header (`# scale = absolute`). A `.npy` has no place for it:
//! its note is a file beside it, `samples.npy.toml`, which holds the checksum of the samples and is
//! believed only of these.

use crate::format::{ChannelsRead, SampleNote};
use crate::{FileError, checksum, toml_text, write_whole_bytes};
use gonia_rig::{Remark, Scale};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// The note as a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct NoteFile {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale: Option<Scale>,
    /// CRC-32C of the samples' file.
    checksum: String,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    provenance: BTreeMap<String, String>,
}

/// The bytes of a text file in which its comments are looked for.
const HEAD: u64 = 1 << 16;
/// The name of the scale in a comment and in a note.
const SCALE: &str = "scale";

/// The place of the note beside a file of samples.
pub(super) fn path_beside(samples: &Path) -> PathBuf {
    let mut name = samples.as_os_str().to_owned();
    name.push(".toml");
    name.into()
}

/// Writes the note of a file that has just been written; without one, removes that of the file that
/// stood there before.
pub(super) fn write_beside(samples: &Path, note: Option<&SampleNote>) -> Result<(), FileError> {
    let path = path_beside(samples);
    let Some(note) = note else {
        return match std::fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(FileError::writing(&path, &error))
            }
            _ => Ok(()),
        };
    };
    let file = NoteFile {
        scale: note.scale,
        checksum: checksum::of_file(samples)?,
        provenance: note.provenance.clone(),
    };
    let text = toml::to_string(&file)
        .map_err(|error| FileError::new(&path, error, "check the samples' provenance"))?;
    write_whole_bytes(&path, text.as_bytes())
}

/// The note as comments of a text file.
pub(super) fn write_comments(out: &mut impl Write, note: &SampleNote) -> io::Result<()> {
    let scale = note
        .scale
        .map(|scale| (SCALE.to_owned(), scale.to_string()));
    let facts = note.provenance.iter().map(|(k, v)| (k.clone(), v.clone()));
    for (name, text) in scale.into_iter().chain(facts) {
        writeln!(out, "# {name} = {}", crate::one_line(&text))?;
    }
    Ok(())
}

/// Adds to samples what is said of them beside their rows.
///
/// # Errors
/// Comments, or comments and a note, that contradict each other; an unreadable file.
pub(super) fn add_to(read: &mut ChannelsRead, samples: &Path) -> Result<(), FileError> {
    let said = comments(samples)?;
    if let Some(scale) = scale_in_comments(samples, &said, &mut read.remarks)? {
        agree(&mut read.scale, scale, samples)?;
    }
    read.provenance.extend(facts_in(&said));
    let path = path_beside(samples);
    if !path.is_file() {
        return Ok(());
    }
    let remedy = "remove it, or make the samples again";
    let note: NoteFile = match toml_text::read(&path, remedy) {
        Ok(note) => note,
        Err(error) => {
            let what = format!("{error}; what it says of the samples is not used");
            read.remarks
                .push(Remark::new(samples.display(), what, remedy));
            return Ok(());
        }
    };
    let found = checksum::of_file(samples)?;
    if found != note.checksum {
        let says = note
            .scale
            .map_or(String::new(), |scale| format!(" ({scale})"));
        read.remarks.push(Remark::new(
            path.display(),
            format_args!(
                "was written of other samples (checksum {}, here {found}), and what it says{says} is not used",
                note.checksum
            ),
            "remove it, and say what these samples are",
        ));
        return Ok(());
    }
    read.provenance.extend(note.provenance);
    match note.scale {
        Some(scale) => agree(&mut read.scale, scale, samples),
        None => Ok(()),
    }
}

fn agree(known: &mut Option<Scale>, said: Scale, samples: &Path) -> Result<(), FileError> {
    match known.replace(said) {
        Some(before) if before != said => Err(FileError::new(
            samples,
            format_args!("is said to be {before}, and {said} too"),
            "keep the comment or the note that is right",
        )),
        _ => Ok(()),
    }
}

/// The facts in the comments above the header of a text file, as [`write_comments`] writes them.
fn facts_in(comments: &[String]) -> BTreeMap<String, String> {
    let is_name = |name: &str| {
        let is_plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b"_.".contains(&b);
        !name.is_empty() && name.bytes().all(is_plain) && name != SCALE
    };
    let parts = comments.iter().filter_map(|line| line.split_once(" = "));
    let named = parts.filter(|(name, _)| is_name(name));
    named
        .map(|(name, fact)| (name.to_owned(), fact.trim().to_owned()))
        .collect()
}

/// The scale in the comments above the header of a text file; none of any other file.
fn scale_in_comments(
    path: &Path,
    comments: &[String],
    remarks: &mut Vec<Remark>,
) -> Result<Option<Scale>, FileError> {
    let mut scale = None;
    for (k, line) in comments.iter().enumerate() {
        let Some((name, said)) = line.split_once(['=', ':']) else {
            continue;
        };
        if !name.trim().eq_ignore_ascii_case(SCALE) {
            continue;
        }
        let place = format!("{}, comment {}", path.display(), k + 1);
        match scale_named(said) {
            Some(said) => agree(&mut scale, said, path)
                .map_err(|error| error.at(format_args!("comment {}", k + 1)))?,
            None => remarks.push(Remark::new(
                place,
                format_args!(
                    "\"{}\" is no scale that gonia knows, and is not used",
                    said.trim()
                ),
                "write # scale = absolute (values in 1/sr) or # scale = relative",
            )),
        }
    }
    Ok(scale)
}

fn scale_named(text: &str) -> Option<Scale> {
    let text = text.trim().trim_matches(['"', '\'']).to_ascii_lowercase();
    // Spreadsheets fill a comment's line up with separators.
    match text.trim_end_matches([',', ';', '\t', ' ']) {
        "absolute" | "1/sr" | "sr-1" | "sr^-1" => Some(Scale::Absolute),
        "relative" => Some(Scale::Relative),
        _ => None,
    }
}

/// The comments with which a text file begins, without their marks.
fn comments(path: &Path) -> Result<Vec<String>, FileError> {
    let reading = |error| FileError::reading(path, &error);
    // A pipe can be read only once.
    if !std::fs::metadata(path).map_err(reading)?.is_file() {
        return Ok(Vec::new());
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(reading)?;
    file.take(HEAD).read_to_end(&mut bytes).map_err(reading)?;
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes));
    let lines = text.lines().map(str::trim);
    Ok(lines
        .take_while(|line| line.is_empty() || line.trim_start_matches('"').starts_with('#'))
        .filter(|line| !line.is_empty())
        .map(|line| line.trim_matches(['"', '#', ' ']).to_owned())
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_rows::tests::some_samples;
    use crate::samples::{read_samples, write_noted_samples, write_samples};

    fn absolute() -> SampleNote {
        SampleNote {
            scale: Some(Scale::Absolute),
            provenance: [("rig".to_owned(), "paper".to_owned())].into(),
        }
    }

    #[test]
    fn the_scale_comes_back_from_either_kind_of_file_and_the_rows_stay_as_they_were() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["a.npy", "a.csv"] {
            let [plain, noted] = ["plain", "noted"].map(|k| dir.path().join(format!("{k}-{name}")));
            let samples = some_samples(20);
            write_samples(&plain, &samples).unwrap();
            write_noted_samples(&noted, &samples, &absolute()).unwrap();
            let read = read_samples(&noted).unwrap();
            assert_eq!(read.scale, Some(Scale::Absolute), "{name}");
            assert_eq!((read.samples, read.remarks), (samples.clone(), vec![]));
            assert_eq!(read.provenance, absolute().provenance, "{name}");
            assert_eq!(read_samples(&plain).unwrap().scale, None);
            if name.ends_with("npy") {
                assert_eq!(
                    std::fs::read(&plain).unwrap(),
                    std::fs::read(&noted).unwrap()
                );
            }
            // Without a note, none of the file before is left.
            write_samples(&noted, &samples).unwrap();
            assert_eq!(read_samples(&noted).unwrap().scale, None);
        }
    }

    #[test]
    fn a_note_of_other_samples_is_not_believed_and_said() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.npy");
        write_noted_samples(&path, &some_samples(20), &absolute()).unwrap();
        let note = std::fs::read(path_beside(&path)).unwrap();
        write_samples(&path, &some_samples(21)).unwrap();
        std::fs::write(path_beside(&path), note).unwrap();
        let read = read_samples(&path).unwrap();
        assert_eq!((read.scale, read.remarks.len()), (None, 1));
        let said = read.remarks[0].to_string();
        assert!(said.contains("was written of other samples"), "{said}");
        std::fs::write(path_beside(&path), "scale = 3").unwrap();
        let read = read_samples(&path).unwrap();
        assert_eq!((read.scale, read.remarks.len()), (None, 1));
    }

    #[test]
    fn a_comment_says_the_scale_and_two_that_differ_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        let read = |comments: &str| {
            let rows = "theta_i,phi_i,theta_v,phi_v,r,g,b\n10,0,20,0,1,1,1\n";
            std::fs::write(&path, format!("{comments}{rows}")).unwrap();
            read_samples(&path)
        };
        for (comments, scale) in [
            ("", None),
            ("# a fabric\n# scale = absolute\n", Some(Scale::Absolute)),
            ("#Scale: 1/sr\n", Some(Scale::Absolute)),
            ("#   scale=\"relative\"\n", Some(Scale::Relative)),
        ] {
            let read = read(comments).unwrap();
            assert_eq!((read.scale, read.remarks.len()), (scale, 0), "{comments}");
        }
        assert_eq!(read("# scale = 0.5\n").unwrap().remarks.len(), 1);
        let error = read("# scale = absolute\n# scale = relative\n").unwrap_err();
        assert!(error.to_string().contains("and relative too"), "{error}");
    }
}
