//! Samples as a file: `.npy` (float32, N × 7, or N × 8 with the number of the frame last) or `.csv`
//! (a header with the same names).
//!
//! Columns: `theta_i, phi_i, theta_v, phi_v` in degrees, `r, g, b`, and optionally `frame`, −1
//! where it is unknown.

pub use crate::format::SamplesRead;

use crate::format::{Content, SampleFormat};
use crate::sample_rows::LAST_FRAME;
use crate::{FileError, odd_samples, table};
use gonia_brdf::Sample;
use std::path::{Path, PathBuf};

/// Reads samples; the format is recognised by the first bytes, else by the ending. Ten million from `.npy` take well below a second.
///
/// # Errors
/// One line naming the file and, where there is one, the row (counted from 0 in `.npy`) or line:
/// of no known format, another shape, type or order, a frame number that is none, or more than half of the
/// samples below the horizon or not finite. Fewer of these are left out, negative polar angles are
/// turned, and the remarks say how many.
pub fn read_samples(path: &Path) -> Result<SamplesRead, FileError> {
    let mut read = (format_of_file(path)?.read)(path)?;
    odd_samples::sort_out(path, &mut read)?;
    Ok(read)
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
            if last as f32 > LAST_FRAME {
                return Err(FileError::new(
                    path,
                    format_args!("brings the frames to number {last}"),
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
    (format_of_name(path)?.write)(path, samples)
}

/// Whether samples can be written under this name, before they are made.
///
/// # Errors
/// Another ending.
pub fn check_sample_name(path: &Path) -> Result<(), FileError> {
    format_of_name(path).map(|_| ())
}

/// The endings of the formats that are read and written, for messages: `.npy or .csv`.
pub fn sample_formats() -> String {
    table::endings(is_samples)
}

fn is_samples(content: &Content) -> bool {
    matches!(content, Content::Samples(_))
}

fn format_of_file(path: &Path) -> Result<&'static SampleFormat, FileError> {
    match table::format_of_file(path)?.map(|format| &format.content) {
        Some(Content::Samples(samples)) => Ok(samples),
        Some(Content::Foreign(foreign)) => Err(FileError::new(
            path,
            format_args!("is a {}", foreign.name),
            "import it first (gonia import)",
        )),
        _ => Err(unknown(path)),
    }
}

fn format_of_name(path: &Path) -> Result<&'static SampleFormat, FileError> {
    match table::format_of_name(path).map(|format| &format.content) {
        Some(Content::Samples(samples)) => Ok(samples),
        _ => Err(unknown(path)),
    }
}

fn unknown(path: &Path) -> FileError {
    FileError::new(
        path,
        "is no known kind of sample file",
        format_args!("name it {}", sample_formats()),
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
        let error = read_samples(&other).unwrap_err().to_string();
        assert!(error.ends_with("name it .npy or .csv"), "{error}");
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
}
