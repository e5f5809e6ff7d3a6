//! Samples as a file: `.npy` (float32, N × 7, or N × 8 with the number of the frame last) or `.csv`
//! (a header with the same names).
//!
//! Columns: `theta_i, phi_i, theta_v, phi_v` in degrees, `r, g, b`, and optionally `frame`, −1
//! where it is unknown.

use crate::{FileError, samples_csv, samples_npy};
use gonia_brdf::{Sample, direction::wrap_deg};
use std::path::{Path, PathBuf};

/// The names of the columns; the last one is optional.
pub const COLUMNS: [&str; 8] = [
    "theta_i", "phi_i", "theta_v", "phi_v", "r", "g", "b", "frame",
];

/// The largest frame number that float32 holds exactly, with all numbers below it.
const LAST_FRAME: f32 = 16_777_216.0;

/// Reads samples by the extension of the file. Ten million from `.npy` take well below a second.
///
/// # Errors
/// One line naming the file and, where there is one, the row (counted from 0 in `.npy`) or line:
/// another extension, shape, type or order, a value that is not finite, an elevation outside
/// 0° ≤ θ ≤ 90°, or a frame number that is none.
pub fn read_samples(path: &Path) -> Result<Vec<Sample>, FileError> {
    match format_of(path)? {
        Format::Npy => samples_npy::read(path),
        Format::Csv => samples_csv::read(path),
    }
}

/// Reads the samples of several sessions of one material as one: frames are numbered on, so that no
/// two sessions share a number.
///
/// # Errors
/// As [`read_samples`], and more frames than a file can number.
pub fn read_samples_of_all(paths: &[PathBuf]) -> Result<Vec<Sample>, FileError> {
    let mut all: Vec<Sample> = Vec::new();
    let mut next = 0u32;
    for path in paths {
        let mut samples = read_samples(path)?;
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
        if all.is_empty() {
            all = samples;
        } else {
            all.append(&mut samples);
        }
    }
    Ok(all)
}

/// Writes samples whole, by the extension of the file; with frame numbers unless all are unknown.
///
/// # Errors
/// Another extension, or the file cannot be written.
pub fn write_samples(path: &Path, samples: &[Sample]) -> Result<(), FileError> {
    match format_of(path)? {
        Format::Npy => samples_npy::write(path, samples),
        Format::Csv => samples_csv::write(path, samples),
    }
}

/// Whether samples can be written under this name, before they are made.
///
/// # Errors
/// Another extension.
pub fn check_sample_name(path: &Path) -> Result<(), FileError> {
    format_of(path).map(|_| ())
}

enum Format {
    Npy,
    Csv,
}

fn format_of(path: &Path) -> Result<Format, FileError> {
    match path
        .extension()
        .and_then(|e| e.to_str())
        .map(str::to_ascii_lowercase)
        .as_deref()
    {
        Some("npy") => Ok(Format::Npy),
        Some("csv") => Ok(Format::Csv),
        _ => Err(FileError::new(
            path,
            "is no known kind of sample file",
            "name it .npy or .csv",
        )),
    }
}

/// Whether any sample says which frame it came from.
pub(super) fn have_frames(samples: &[Sample]) -> bool {
    samples
        .iter()
        .any(|sample| sample.frame != Sample::NO_FRAME)
}

/// A frame number as it stands in a file.
pub(super) fn frame_in_file(frame: u32) -> f32 {
    if frame == Sample::NO_FRAME {
        -1.0
    } else {
        frame as f32
    }
}

/// What is wrong with a row.
pub(super) struct BadRow {
    pub problem: String,
    pub remedy: &'static str,
}

/// Checks the numbers of a row and wraps its azimuths. `row` has 7 or 8 columns.
pub(super) fn sample_from_row(row: &[f32]) -> Result<Sample, BadRow> {
    // The sum of finite numbers is finite, save for ones far beyond every value of a BRDF.
    let sum: f32 = row.iter().take(7).sum();
    let elevations = 0.0..=90.0;
    let sound = sum.is_finite() && elevations.contains(&row[0]) && elevations.contains(&row[2]);
    if !sound {
        return Err(explain(row));
    }
    let frame = match row.get(7) {
        None => Sample::NO_FRAME,
        Some(&-1.0) => Sample::NO_FRAME,
        Some(&f) if f.fract() == 0.0 && (0.0..=LAST_FRAME).contains(&f) => f as u32,
        Some(&f) => {
            return Err(BadRow {
                problem: format!("frame {f} is no number of a frame"),
                remedy: "give whole numbers from 0 to 16777216, or -1 where it is unknown",
            });
        }
    };
    Ok(Sample {
        theta_i_deg: row[0],
        phi_i_deg: wrapped(row[1]),
        theta_v_deg: row[2],
        phi_v_deg: wrapped(row[3]),
        rgb: [row[4], row[5], row[6]],
        frame,
    })
}

fn wrapped(phi: f32) -> f32 {
    if (0.0..360.0).contains(&phi) {
        return phi;
    }
    let phi = wrap_deg(f64::from(phi)) as f32;
    // Just below 360 rounds to 360 in single precision.
    if phi >= 360.0 { 0.0 } else { phi }
}

#[cold]
fn explain(row: &[f32]) -> BadRow {
    let not_finite = row
        .iter()
        .zip(COLUMNS)
        .find(|(value, _)| !value.is_finite());
    if let Some((value, name)) = not_finite {
        return BadRow {
            problem: format!("{name} is {value}"),
            remedy: "remove the row or mend its value",
        };
    }
    let too_far = [0, 2]
        .into_iter()
        .find(|c| !(0.0..=90.0).contains(&row[*c]));
    match too_far {
        Some(c) => BadRow {
            problem: format!("{} {} is not an elevation", COLUMNS[c], row[c]),
            remedy: "give degrees from the normal, from 0 to 90",
        },
        None => BadRow {
            problem: "its values are beyond all measure".into(),
            remedy: "check the units: degrees, and BRDF values in 1/sr",
        },
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn some_samples(n: u32) -> Vec<Sample> {
        (0..n)
            .map(|k| Sample {
                theta_i_deg: (k % 90) as f32 + 0.125,
                phi_i_deg: (k % 360) as f32,
                theta_v_deg: (k % 75) as f32,
                phi_v_deg: (k % 359) as f32 + 0.5,
                rgb: [0.1 * k as f32, 1.0 / (1.0 + k as f32), -0.01],
                frame: k / 1225,
            })
            .collect()
    }

    #[test]
    fn samples_come_back_from_either_kind_of_file() {
        let dir = tempfile::tempdir().unwrap();
        let mut samples = some_samples(3000);
        samples[7].frame = Sample::NO_FRAME;
        for name in ["a.npy", "a.csv"] {
            let path = dir.path().join(name);
            write_samples(&path, &samples).unwrap();
            assert_eq!(read_samples(&path).unwrap(), samples, "{name}");
        }
        for sample in &mut samples {
            sample.frame = Sample::NO_FRAME;
        }
        for name in ["b.npy", "b.csv"] {
            let path = dir.path().join(name);
            write_samples(&path, &samples).unwrap();
            assert_eq!(read_samples(&path).unwrap(), samples, "{name}");
        }
        let error = read_samples(&dir.path().join("a.txt"))
            .unwrap_err()
            .to_string();
        assert!(error.ends_with("name it .npy or .csv"), "{error}");
    }

    #[test]
    fn frames_of_several_files_are_numbered_on() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = ["a.npy", "b.csv"].map(|name| dir.path().join(name));
        write_samples(&a, &some_samples(2500)).unwrap();
        write_samples(&b, &some_samples(1300)).unwrap();
        let all = read_samples_of_all(&[a.clone(), b]).unwrap();
        assert_eq!(all.len(), 3800);
        assert_eq!(
            (all[2499].frame, all[2500].frame, all[3799].frame),
            (2, 3, 4)
        );
        assert_eq!(all[..2500], read_samples(&a).unwrap());
    }

    #[test]
    fn azimuths_wrap_and_bad_rows_say_which_column() {
        let row = [10.0, -90.0, 20.0, 720.0, 1.0, 1.0, 1.0, 3.0];
        let sample = sample_from_row(&row).ok().unwrap();
        assert_eq!(
            (sample.phi_i_deg, sample.phi_v_deg, sample.frame),
            (270.0, 0.0, 3)
        );
        assert_eq!(wrapped(-1e-9), 0.0);
        for (column, value, said) in [
            (0, 90.5, "theta_i 90.5 is not an elevation"),
            (2, -0.5, "theta_v -0.5 is not an elevation"),
            (1, f32::INFINITY, "phi_i is inf"),
            (5, f32::NAN, "g is NaN"),
            (7, 1.5, "frame 1.5 is no number of a frame"),
            (7, f32::NAN, "frame NaN is no number of a frame"),
        ] {
            let mut bad = row;
            bad[column] = value;
            assert_eq!(sample_from_row(&bad).err().unwrap().problem, said);
        }
    }
}
