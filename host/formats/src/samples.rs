//! Samples as a file: numpy's arrays (`.npy`, `.npz`) and tables of text (`.csv`, `.tsv`, `.txt`).
//!
//! Columns: `theta_i, phi_i, theta_v, phi_v` in degrees, `r, g, b`, and optionally `frame`, −1
//! where it is unknown. What is read is wider: other names, units, separators, types and orders.
//! Written are float32 `.npy` of N × 7 or N × 8, and `.csv` with these names in a header.

pub use crate::format::{ChannelsRead, SampleNote, SamplesRead};

use crate::format::{Content, ReadSamples, SampleFormat, SampleWriter};
use crate::sample_rows::LAST_FRAME;
use crate::{FileError, odd_samples, sample_note, samples_csv, table};
use gonia_brdf::Sample;
use gonia_rig::{ChannelSamples, SampleValues, Scale};
use std::path::{Path, PathBuf};

/// Endings besides `.csv` under which a table of text is read, with a header or without.
const TEXT_ENDINGS: [&str; 2] = ["txt", "tsv"];

/// Reads samples of colours; one value counts as a grey. The format is recognised by the first bytes, else by the
/// ending. Ten million from `.npy` of float32 take well below a second.
///
/// # Errors
/// As [`read_channels`], and samples of bands.
pub fn read_samples(path: &Path) -> Result<SamplesRead, FileError> {
    read_channels(path)?.into_rgb(path)
}

/// Reads samples of any channels: colours, one value, or bands.
///
/// # Errors
/// One line naming the file and, where there is one, the row (counted from 0 in arrays) or line: of no
/// known format, columns that are missing or that could be more than one thing, a frame number that is
/// none or that its type does not tell from the next one, or more than half of the samples below the
/// horizon or not finite. Fewer of these are left out, negative polar angles are turned, and the
/// remarks say how many.
pub fn read_channels(path: &Path) -> Result<ChannelsRead, FileError> {
    let mut read = (reader_of(path)?)(path)?;
    odd_samples::sort_out(path, &mut read)?;
    sample_note::add_to(&mut read, path)?;
    Ok(read)
}

/// The one scale of several files: what they say, or what `said` says of those that do not.
///
/// # Errors
/// A file that says otherwise than `said` or than another file, or says nothing where another does.
pub fn one_scale(
    scales: &[(&Path, Option<Scale>)],
    said: Option<Scale>,
) -> Result<Option<Scale>, FileError> {
    let known = scales
        .iter()
        .find_map(|(path, scale)| Some((path, (*scale)?)));
    for (path, scale) in scales {
        match (scale, said, known) {
            (Some(scale), Some(said), _) if *scale != said => {
                return Err(FileError::new(
                    path,
                    format_args!("says that its values are {scale}, and --scale says {said}"),
                    "leave --scale out, or mend what is said of the file",
                ));
            }
            (Some(scale), None, Some((other, first))) if *scale != first => {
                return Err(FileError::new(
                    path,
                    format_args!("is {scale}, but {} is {first}", other.display()),
                    "give files of one scale together",
                ));
            }
            (None, None, Some((other, first))) => {
                return Err(FileError::new(
                    path,
                    format_args!("does not say its scale, but {} is {first}", other.display()),
                    format_args!(
                        "say it with --scale, or in a comment of a .csv (# scale = {first})"
                    ),
                ));
            }
            _ => {}
        }
    }
    Ok(said.or(known.map(|(_, scale)| scale)))
}

/// Whether samples can be those behind a dense BRDF, by the scale of both.
///
/// # Errors
/// They say that they have another scale.
pub fn check_scale(path: &Path, scale: Option<Scale>, dense: Scale) -> Result<(), FileError> {
    match scale {
        Some(scale) if scale != dense => Err(FileError::new(
            path,
            format_args!("is {scale}, and the dense BRDF is {dense}"),
            "make that of these samples (gonia fill)",
        )),
        _ => Ok(()),
    }
}

/// As [`read_channels_of_all`], of colours.
///
/// # Errors
/// As [`read_channels_of_all`], and samples of bands.
pub fn read_samples_of_all(
    paths: &[PathBuf],
    said: Option<Scale>,
) -> Result<SamplesRead, FileError> {
    let first = paths.first().map(PathBuf::as_path);
    read_channels_of_all(paths, said)?.into_rgb(first.unwrap_or(Path::new("")))
}

/// Reads the samples of several sessions of one material as one: frames are numbered on, so that no
/// two sessions share a number. `said` is their scale where the files do not say it.
///
/// # Errors
/// As [`read_channels`] and [`one_scale`], files of different channels, and more frames than a file can number.
pub fn read_channels_of_all(
    paths: &[PathBuf],
    said: Option<Scale>,
) -> Result<ChannelsRead, FileError> {
    let mut all = ChannelsRead::from(SampleValues::Rgb(Vec::new()));
    let mut scales = Vec::with_capacity(paths.len());
    let mut next = 0u32;
    for (number, path) in (1..).zip(paths) {
        let ChannelsRead {
            mut values,
            scale,
            provenance,
            mut remarks,
        } = read_channels(path)?;
        let of = if paths.len() == 1 {
            String::from("samples")
        } else {
            format!("samples.{number}")
        };
        let named = provenance.into_iter();
        all.provenance
            .extend(named.map(|(name, fact)| (format!("{of}.{name}"), fact)));
        all.remarks.append(&mut remarks);
        scales.push((path.as_path(), scale));
        let mut last = None;
        for frame in values.frames_mut() {
            if *frame != Sample::NO_FRAME {
                *frame = frame.saturating_add(next);
                last = last.max(Some(*frame));
            }
        }
        if let Some(last) = last {
            if last > LAST_FRAME {
                return Err(FileError::new(
                    path,
                    format_args!("brings the frames beyond number {LAST_FRAME}"),
                    "number the frames of each file from 0",
                ));
            }
            next = last + 1;
        }
        if number == 1 {
            all.values = values;
        } else if !all.values.append(&mut values) {
            return Err(FileError::new(
                path,
                format_args!(
                    "has the channels {}, but {} has {}",
                    values.channels(),
                    paths[0].display(),
                    all.values.channels()
                ),
                "give files of the same channels together",
            ));
        }
    }
    all.scale = one_scale(&scales, said)?;
    Ok(all)
}

/// Writes samples whole, in the format of the name's ending; with frame numbers unless all are unknown.
/// Nothing is said of them: who reads them does not know their scale.
///
/// # Errors
/// Another ending, or the file cannot be written.
pub fn write_samples(path: &Path, samples: &[Sample]) -> Result<(), FileError> {
    (writer_of(path)?.0.rgb)(path, samples, None)?;
    sample_note::write_beside(path, None)
}

/// As [`write_samples`], with what is known of them: in comments of a `.csv`, in `NAME.npy.toml` beside a
/// `.npy`, which stays as it is without.
///
/// # Errors
/// As [`write_samples`].
pub fn write_noted_samples(
    path: &Path,
    samples: &[Sample],
    note: &SampleNote,
) -> Result<(), FileError> {
    let (write, holds_notes) = writer_of(path)?;
    (write.rgb)(path, samples, Some(note))?;
    sample_note::write_beside(path, (!holds_notes).then_some(note))
}

/// As [`write_noted_samples`]; a table of text has columns `u_scale_r` … beside the values: the standard uncertainty
/// (k = 1, in their unit) that the rig gives them. Other formats have no names for columns, and are as without.
///
/// # Errors
/// As [`write_samples`].
pub fn write_noted_samples_with_u(
    path: &Path,
    samples: &[Sample],
    u: &[[f32; 3]],
    note: &SampleNote,
) -> Result<(), FileError> {
    if !is_text(path) {
        return write_noted_samples(path, samples, note);
    }
    samples_csv::write_with_u(path, samples, u, Some(note))?;
    sample_note::write_beside(path, None)
}

/// As [`write_noted_samples`], of other channels than colours.
///
/// # Errors
/// As [`write_samples`].
pub fn write_noted_channels(
    path: &Path,
    samples: &ChannelSamples,
    note: &SampleNote,
) -> Result<(), FileError> {
    let (write, holds_notes) = writer_of(path)?;
    (write.channels)(path, samples, Some(note))?;
    sample_note::write_beside(path, (!holds_notes).then_some(note))
}

/// Whether samples can be written under this name, before they are made.
///
/// # Errors
/// Another ending.
pub fn check_sample_name(path: &Path) -> Result<(), FileError> {
    writer_of(path).map(|_| ())
}

fn is_written(content: &Content) -> bool {
    matches!(content, Content::Samples(samples) if samples.write.is_some())
}

fn is_samples(content: &Content) -> bool {
    matches!(content, Content::Samples(_))
}

fn reader_of(path: &Path) -> Result<ReadSamples, FileError> {
    match table::format_of_file(path)?.map(|format| &format.content) {
        Some(Content::Samples(samples)) => Ok(samples.read),
        // A table of text whose header names the columns is one under any name.
        _ if is_text(path) || samples_csv::names_samples(path) => Ok(samples_csv::read),
        Some(Content::Foreign(foreign)) => Err(FileError::new(
            path,
            format_args!("is a {}", foreign.name),
            "import it first (gonia import)",
        )),
        _ => Err(unknown(path, is_samples)),
    }
}

/// Whether the ending promises a table of text.
fn is_text(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| {
        TEXT_ENDINGS
            .iter()
            .any(|text| ending.eq_ignore_ascii_case(text))
    })
}

/// The writer by the name's ending, and whether its files hold notes.
fn writer_of(path: &Path) -> Result<(&'static SampleWriter, bool), FileError> {
    match table::format_of_name(path).map(|format| &format.content) {
        Some(Content::Samples(SampleFormat {
            write: Some(write),
            holds_notes,
            ..
        })) => Ok((write, *holds_notes)),
        _ => Err(unknown(path, is_written)),
    }
}

fn unknown(path: &Path, endings: fn(&Content) -> bool) -> FileError {
    FileError::new(
        path,
        "is no known kind of sample file",
        format_args!("name it {}", table::endings(endings)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_rows::tests::some_samples;
    use gonia_rig::Channels;

    fn bands_of(text: &str) -> Result<ChannelsRead, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        std::fs::write(&path, text).unwrap();
        read_channels(&path).map_err(|error| {
            assert_eq!(error.to_string().lines().count(), 1);
            error.to_string()
        })
    }

    fn some_bands() -> ChannelSamples {
        let read = bands_of(
            "1000nm,theta_i,phi_i,theta_v,phi_v,380nm,frame,note\n0.3,10,20,30,40,0.1,7,a\n0.4,11,21,31,41,0.2,,b\n",
        );
        match read.unwrap().values {
            SampleValues::Channels(samples) => samples,
            SampleValues::Rgb(_) => panic!("no colours"),
        }
    }

    #[test]
    fn bands_come_by_wavelength_and_go_to_files_and_back_with_their_names() {
        let samples = some_bands();
        assert_eq!(samples.channels.names(), ["380nm", "1000nm"]);
        assert_eq!(samples.values, [0.1, 0.3, 0.2, 0.4]);
        let places = samples.places.iter().map(|s| (s.phi_v_deg, s.frame));
        let places: Vec<_> = places.collect();
        assert_eq!(places, [(40.0, 7), (41.0, Sample::NO_FRAME)]);
        let dir = tempfile::tempdir().unwrap();
        let note = SampleNote {
            scale: Some(Scale::Absolute),
            ..SampleNote::default()
        };
        for name in ["s.csv", "s.npy"] {
            let path = dir.path().join(name);
            write_noted_channels(&path, &samples, &note).unwrap();
            let read = read_channels(&path).unwrap();
            let same = SampleValues::Channels(samples.clone());
            assert_eq!((read.values, read.scale), (same, Some(Scale::Absolute)));
            let error = read_samples(&path).unwrap_err().to_string();
            assert!(
                error.contains("has no r, g, b but 380nm, 1000nm"),
                "{error}"
            );
        }
    }

    #[test]
    fn one_value_stays_one_channel_and_is_a_grey_only_where_colours_are_wanted() {
        for name in ["brdf", "Y", "value"] {
            let text = format!("theta_i,phi_i,theta_v,phi_v,{name}\n10,20,30,40,0.5\n");
            let read = bands_of(&text).unwrap();
            assert_eq!(read.values.channels(), &Channels::Single);
            let grey = read.into_rgb(Path::new("s.csv")).unwrap();
            assert_eq!(grey.samples[0].rgb, [0.5; 3]);
        }
    }

    #[test]
    fn columns_of_two_kinds_and_files_of_different_channels_are_refused_in_a_line() {
        let table = |values: &str| {
            let row = vec!["1"; 4 + values.split(',').count()].join(",");
            format!("theta_i,phi_i,theta_v,phi_v,{values}\n{row}\n")
        };
        for (values, said) in [
            (
                "r,g,b,450nm",
                "r and 450nm are columns of values of two kinds",
            ),
            (
                "450nm,brdf",
                "brdf and 450nm are columns of values of two kinds",
            ),
            ("450nm,brdf_450nm", "450 nm is there twice"),
            ("X,Y,Z", "Y stands beside X"),
            ("r,g", "there is no column for b"),
        ] {
            let error = bands_of(&table(values)).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str, values: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, table(values)).unwrap();
            path
        };
        let bands = file("a.csv", "450nm,550nm");
        let others = file("b.csv", "450nm,560nm");
        let colours = file("c.csv", "r,g,b");
        for (first, second, said) in [
            (&bands, &others, "has the channels 450nm, 560nm, but"),
            (&bands, &colours, "has the channels R, G, B, but"),
            (
                &colours,
                &bands,
                "a.csv: has the channels 450nm, 550nm, but",
            ),
        ] {
            let both = [first.clone(), second.clone()];
            let error = read_channels_of_all(&both, None).unwrap_err().to_string();
            assert!(
                error.contains(said) && error.lines().count() == 1,
                "{error}"
            );
        }
        let twice = read_channels_of_all(&[bands.clone(), bands], None).unwrap();
        assert_eq!(twice.values.len(), 2);
    }

    #[test]
    fn samples_come_back_from_either_kind_of_file() {
        let dir = tempfile::tempdir().unwrap();
        let mut samples = some_samples(3000);
        samples[7].frame = Sample::NO_FRAME;
        for name in ["a.npy", "a.csv"] {
            let path = dir.path().join(name);
            write_samples(&path, &samples).unwrap();
            assert_eq!(read_samples(&path).unwrap().samples, samples, "{name}");
        }
        for sample in &mut samples {
            sample.frame = Sample::NO_FRAME;
        }
        for name in ["b.npy", "b.csv"] {
            let path = dir.path().join(name);
            write_samples(&path, &samples).unwrap();
            assert_eq!(read_samples(&path).unwrap().samples, samples, "{name}");
        }
        let other = dir.path().join("a.txt");
        let error = write_samples(&other, &samples).unwrap_err().to_string();
        assert!(error.ends_with("name it .npy or .csv"), "{error}");
        std::fs::copy(dir.path().join("b.csv"), &other).unwrap();
        assert_eq!(read_samples(&other).unwrap().samples, samples);
        let unknown = dir.path().join("a.log");
        std::fs::write(&unknown, "x").unwrap();
        let error = read_samples(&unknown).unwrap_err().to_string();
        assert!(error.ends_with("name it .npy, .csv or .npz"), "{error}");
        // The first bytes of a .npy say what it is.
        std::fs::copy(dir.path().join("b.npy"), &other).unwrap();
        assert_eq!(read_samples(&other).unwrap().samples, samples);
        let foreign = dir.path().join("a.dat");
        std::fs::write(&foreign, "x").unwrap();
        let error = read_samples(&foreign).unwrap_err().to_string();
        assert!(error.ends_with("import it first (gonia import)"), "{error}");
    }

    #[test]
    fn frames_of_several_files_are_numbered_on() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = ["a.npy", "b.csv"].map(|name| dir.path().join(name));
        write_samples(&a, &some_samples(2500)).unwrap();
        write_samples(&b, &some_samples(1300)).unwrap();
        let all = read_samples_of_all(&[a.clone(), b], None).unwrap().samples;
        assert_eq!(all.len(), 3800);
        assert_eq!(
            (all[2499].frame, all[2500].frame, all[3799].frame),
            (2, 3, 4)
        );
        assert_eq!(all[..2500], read_samples(&a).unwrap().samples);
    }

    #[test]
    fn files_of_different_scales_are_not_one_set() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, scale| {
            let path = dir.path().join(name);
            let note = SampleNote {
                scale,
                ..SampleNote::default()
            };
            write_noted_samples(&path, &some_samples(5), &note).unwrap();
            path
        };
        let (absolute, relative) = (Some(Scale::Absolute), Some(Scale::Relative));
        let [a, r] = [write("a.npy", absolute), write("r.csv", relative)];
        let unknown = write("u.npy", None);
        let one = |paths: &[&PathBuf], said| {
            let paths: Vec<PathBuf> = paths.iter().map(|p| (*p).clone()).collect();
            read_samples_of_all(&paths, said).map(|read| read.scale)
        };
        assert_eq!(one(&[&a, &a], None), Ok(absolute));
        assert_eq!(one(&[&a, &unknown], absolute), Ok(absolute));
        assert_eq!(one(&[&unknown], None), Ok(None));
        for (paths, said, word) in [
            (vec![&a, &r], None, "give files of one scale"),
            (vec![&a, &unknown], None, "does not say its scale"),
            (vec![&r], absolute, "--scale says absolute"),
            (vec![&unknown, &a], relative, "--scale says relative"),
        ] {
            let error = one(&paths, said).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn frames_of_several_files_that_no_number_is_left_for_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = ["a.npy", "b.npy"].map(|name| dir.path().join(name));
        let mut samples = some_samples(3);
        samples[2].frame = LAST_FRAME - 1;
        write_samples(&a, &samples).unwrap();
        samples[2].frame = 0;
        write_samples(&b, &samples).unwrap();
        let all = read_samples_of_all(&[a.clone(), b.clone()], None)
            .unwrap()
            .samples;
        assert_eq!(all[5].frame, LAST_FRAME);
        let error = read_samples_of_all(&[a, b.clone(), b], None)
            .unwrap_err()
            .to_string();
        assert!(error.contains("beyond number 4294967294"), "{error}");
    }
}
