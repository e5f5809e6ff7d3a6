//! Brackets of linear raw frames with known exposure times → radiance with a variance per pixel.
//!
//! Exposures are merged pixel by pixel, before demosaicing, so that each photosite is weighed by its
//! own noise; what is saturated in every exposure is marked, not guessed.

mod demosaic;
mod merge;
#[cfg(test)]
mod tests;

pub use merge::Linearity;

use crate::dataset::raw_frame::{RawFrame, read_raw};
use crate::dataset::rig::Sensor;
use crate::dataset::{CaptureFolder, FileError, Frame, FrameRow, Rig};
use std::path::{Path, PathBuf};

/// Exposures that disagree by more than this share are not of a linear sensor, or not of what
/// `rig.toml` and `frames.csv` say of them.
const LINEARITY_LIMIT: f64 = 0.05;

/// A merged bracket.
#[derive(Clone, Debug)]
pub struct Radiance {
    /// Counts a second above black; +∞ where every exposure saturated.
    pub frame: Frame,
    /// Variance of each value, from shot, read and quantisation noise; (counts a second)².
    pub variance: Vec<[f32; 3]>,
    /// The worst disagreement of two consecutive exposures; `None` when no two could be compared.
    pub linearity: Option<Linearity>,
}

/// Loads the exposures of a frame and merges them.
///
/// # Errors
/// One line naming the file: an exposure that cannot be read or is not of the rig's camera, no
/// `[sensor]` in `rig.toml`, or exposures that disagree by more than 5 %.
pub fn load_bracket(folder: &CaptureFolder, row: &FrameRow) -> Result<Radiance, FileError> {
    let exposures = folder.exposures(row).iter();
    let files: Vec<(f64, PathBuf)> = exposures
        .map(|exposure| (exposure.exposure_s, folder.path_of_file(&exposure.file)))
        .collect();
    merge_files(folder.rig(), &files)
}

/// Reads raw exposures (seconds, file) of one frame of a rig and merges them; there must be at least
/// one.
///
/// # Errors
/// As [`load_bracket`].
pub fn merge_files(rig: &Rig, files: &[(f64, PathBuf)]) -> Result<Radiance, FileError> {
    let first = files.first().map_or(Path::new(""), |(_, path)| path);
    let Some(sensor) = &rig.sensor else {
        return Err(FileError::new(
            first,
            "is a raw exposure, but rig.toml has no [sensor]",
            "give black_counts, saturation_counts, gain_e_per_count and read_noise_e there",
        ));
    };
    let camera = &rig.camera;
    let mut exposures = Vec::new();
    for (exposure_s, path) in files {
        let raw = read_raw(path, camera.width_px, camera.height_px)?;
        if raw.channels == 3 && sensor.bayer.is_some() {
            return Err(FileError::new(
                path,
                "has three channels, but rig.toml gives the sensor a Bayer pattern",
                "save the frame as it came from the sensor, or remove sensor.bayer",
            ));
        }
        exposures.push((*exposure_s, raw));
    }
    merge_checked(&exposures, sensor, first)
}

/// Merges exposures (seconds, counts) of the same size, and checks that they agree; there must be at
/// least one. `from` is where they come from.
///
/// # Errors
/// They disagree by more than 5 %.
pub fn merge_checked(
    exposures: &[(f64, RawFrame)],
    sensor: &Sensor,
    from: &Path,
) -> Result<Radiance, FileError> {
    let radiance = merge_bracket(exposures, sensor);
    match radiance.linearity {
        Some(worst) if worst.deviation.abs() > LINEARITY_LIMIT => Err(FileError::new(
            from,
            format_args!(
                "the exposures of {} s and {} s disagree by {:+.1} %",
                worst.shorter_s,
                worst.longer_s,
                100.0 * worst.deviation
            ),
            "check exposure_s in frames.csv, black_counts and saturation_counts in rig.toml, and that the light is steady",
        )),
        _ => Ok(radiance),
    }
}

/// Merges exposures (seconds, counts) of the same size; there must be at least one.
pub fn merge_bracket(exposures: &[(f64, RawFrame)], sensor: &Sensor) -> Radiance {
    let mut sorted: Vec<&(f64, RawFrame)> = exposures.iter().collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (width, height, channels) = sorted
        .first()
        .map_or((0, 0, 1), |(_, raw)| (raw.width, raw.height, raw.channels));
    let planes: Vec<(f64, &[u16])> = sorted
        .iter()
        .map(|(time, raw)| (*time, raw.counts.as_slice()))
        .collect();
    let merged = merge::merge(&planes, sensor);
    let (rgb, variance) = match (channels, sensor.bayer) {
        (3, _) => (triples(&merged.value), triples(&merged.variance)),
        (_, Some(pattern)) => demosaic::bilinear(&merged.value, &merged.variance, width, pattern),
        (_, None) => (grey(&merged.value), grey(&merged.variance)),
    };
    Radiance {
        frame: Frame { width, height, rgb },
        variance,
        linearity: merged.linearity,
    }
}

fn triples(values: &[f32]) -> Vec<[f32; 3]> {
    values.as_chunks::<3>().0.to_vec()
}

fn grey(values: &[f32]) -> Vec<[f32; 3]> {
    values.iter().map(|v| [*v; 3]).collect()
}
