//! A frame from the raw exposures of its bracket: read, checked, merged.

use gonia_formats::raw_frame::read_raw;
use gonia_formats::{CaptureFolder, FileError};
use gonia_imaging::hdr::{LINEARITY_LIMIT, Radiance, merge_bracket};
use gonia_rig::{FrameRow, RawFrame, Rig, Sensor};
use std::path::{Path, PathBuf};

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
