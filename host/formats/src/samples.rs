//! Samples as a file: numpy's arrays (`.npy`, `.npz`) and tables of text (`.csv`, `.tsv`, `.txt`).
//!
//! Columns: `theta_i, phi_i, theta_v, phi_v` in degrees, `r, g, b`, and optionally `frame`, −1
//! where it is unknown. What is read is wider: other names, units, separators, types and orders.
//! Written are float32 `.npy` of N × 7 or N × 8, and `.csv` with these names in a header.

pub use crate::format::SamplesRead;

use crate::format::{Content, ReadSamples, SampleFormat, WriteSamples};
use crate::sample_rows::LAST_FRAME;
use crate::{FileError, samples_csv, table};
use gonia_brdf::Sample;
use std::path::{Path, PathBuf};

/// Endings besides `.csv` under which a table of text is read, with a header or without.
const TEXT_ENDINGS: [&str; 2] = ["txt", "tsv"];

/// Reads samples; the format is recognised by the first bytes, else by the ending. Ten million from
/// `.npy` of float32 take well below a second.
///
/// # Errors
/// One line naming the file and, where there is one, the row (counted from 0 in arrays) or line: of no
/// known format, columns that are missing or that could be more than one thing, a value that is not
/// finite, a polar angle outside 0° ≤ θ ≤ 90°, or a frame number that is none or that its type does
/// not tell from the next one.
pub fn read_samples(path: &Path) -> Result<SamplesRead, FileError> {
    (reader_of(path)?)(path)
}

/// Reads the samples of several sessions of one material as one: frames are numbered on, so that no
/// two sessions share a number.
///
/// # Errors
/// As [`read_samples`], and more frames than a file can number.
pub fn read_samples_of_all(paths: &[PathBuf]) -> Result<SamplesRead, FileError> {
    let mut all = SamplesRead::default();
    let mut next = 0u32;
    for path in paths {
        let SamplesRead {
            mut samples,
            scale,
            mut remarks,
        } = read_samples(path)?;
        all.remarks.append(&mut remarks);
        all.scale = all.scale.or(scale);
        let mut last = None;
        for sample in &mut samples {
            if sample.frame != Sample::NO_FRAME {
                sample.frame = sample.frame.saturating_add(next);
                last = last.max(Some(sample.frame));
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
        if all.samples.is_empty() {
            all.samples = samples;
        } else {
            all.samples.append(&mut samples);
        }
    }
    Ok(all)
}

/// Writes samples whole, in the format of the name's ending; with frame numbers unless all are unknown.
///
/// # Errors
/// Another ending, or the file cannot be written.
pub fn write_samples(path: &Path, samples: &[Sample]) -> Result<(), FileError> {
    (writer_of(path)?)(path, samples)
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

fn writer_of(path: &Path) -> Result<WriteSamples, FileError> {
    match table::format_of_name(path).map(|format| &format.content) {
        Some(Content::Samples(SampleFormat {
            write: Some(write), ..
        })) => Ok(*write),
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
        let all = read_samples_of_all(&[a.clone(), b]).unwrap().samples;
        assert_eq!(all.len(), 3800);
        assert_eq!(
            (all[2499].frame, all[2500].frame, all[3799].frame),
            (2, 3, 4)
        );
        assert_eq!(all[..2500], read_samples(&a).unwrap().samples);
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
        let all = read_samples_of_all(&[a.clone(), b.clone()])
            .unwrap()
            .samples;
        assert_eq!(all[5].frame, LAST_FRAME);
        let error = read_samples_of_all(&[a, b.clone(), b])
            .unwrap_err()
            .to_string();
        assert!(error.contains("beyond number 4294967294"), "{error}");
    }
}
