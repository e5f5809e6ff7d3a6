//! A frame from the raw exposures of its bracket: read, checked, merged.

use crate::bracket_sensor;
use gonia_formats::raw_frame::{RawFile, read_raw};
use gonia_formats::{CaptureFolder, FileError};
use gonia_imaging::hdr::{LINEARITY_LIMIT, Linearity, Radiance, merge_bracket, mosaic_doubt};
use gonia_rig::{FrameRow, RawFrame, Remark, Rig, Sensor};
use std::path::{Path, PathBuf};

/// Exposures that agree although one is so many times as long as the other are linear: counts encoded
/// for a screen would be a quarter off.
const TELLING_RATIO: f64 = 1.5;

/// A merged bracket, and what speaks against its files all the same.
#[derive(Clone, Debug)]
pub struct Bracket {
    /// The radiance.
    pub radiance: Radiance,
    /// What the files say of themselves that the exposures contradict.
    pub remarks: Vec<Remark>,
}

/// Loads the exposures of a frame and merges them.
///
/// # Errors
/// One line naming the file: an exposure that cannot be read or is not of the rig's camera, or says
/// itself that its counts are not linear while no other exposure shows that they are; exposures of
/// several kinds; no `[sensor]` in `rig.toml` where the file does not say it itself, or one that the counts contradict (a mosaic without its
/// pattern or with another, a saturation that they cannot reach); or exposures that disagree by more
/// than 5 %.
pub fn load_bracket(folder: &CaptureFolder, row: &FrameRow) -> Result<Bracket, FileError> {
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
pub fn merge_files(rig: &Rig, files: &[(f64, PathBuf)]) -> Result<Bracket, FileError> {
    let first = files.first().map_or(Path::new(""), |(_, path)| path);
    let camera = &rig.camera;
    let mut sensor = None;
    let mut remarks = Vec::new();
    let mut exposures: Vec<(f64, RawFrame)> = Vec::new();
    let mut encoded = None;
    for (exposure_s, path) in files {
        let file = read_raw(path, camera.width_px, camera.height_px)?;
        let of_file = bracket_sensor::of_file(path, rig.sensor.as_ref(), &file)?;
        remarks.extend(bracket_sensor::exposure_remark(path, *exposure_s, &file));
        check_sensor(path, &file, &of_file)?;
        sensor.get_or_insert(of_file);
        if let Some((_, other)) = exposures.first()
            && other.channels != file.raw.channels
        {
            return Err(FileError::new(
                path,
                format_args!(
                    "is {}, but {} of the same frame is {}",
                    kind(&file.raw),
                    first.file_name().unwrap_or_default().display(),
                    kind(other)
                ),
                "save the exposures of a frame as files of one kind",
            ));
        }
        encoded = encoded.or(file.encoded.map(|how| (path, how)));
        exposures.push((*exposure_s, file.raw));
    }
    let Some(sensor) = sensor else {
        let remedy = "give one at least";
        return Err(FileError::new(first, "a frame without exposures", remedy));
    };
    let radiance = merge_checked(&exposures, &sensor, first)?;
    if let Some((path, how)) = encoded {
        let proof = radiance.linearity.filter(tells);
        let Some(proof) = proof else {
            return Err(FileError::new(
                path,
                format_args!("{how}, and there is no other exposure that shows them to be linear"),
                "save the sensor's own counts; if these are, remove the chunk or profile",
            ));
        };
        remarks.push(Remark::new(
            path.display(),
            format_args!(
                "{how}, but the exposures of {} s and {} s agree within {:.1} %: taken as linear",
                proof.shorter_s,
                proof.longer_s,
                100.0 * proof.deviation.abs()
            ),
            "remove the chunk or profile from such files",
        ));
    }
    Ok(Bracket { radiance, remarks })
}

fn kind(raw: &RawFrame) -> &'static str {
    if raw.channels == 1 { "grey" } else { "RGB" }
}

/// Whether exposures that agree show that counts are linear.
fn tells(linearity: &Linearity) -> bool {
    linearity.longer_s >= TELLING_RATIO * linearity.shorter_s
}

/// Whether a file's counts can be those of the sensor.
fn check_sensor(path: &Path, file: &RawFile, sensor: &Sensor) -> Result<(), FileError> {
    if file.raw.channels == 3 && sensor.bayer.is_some() {
        return Err(FileError::new(
            path,
            "has three channels, but rig.toml gives the sensor a Bayer pattern",
            "save the frame as it came from the sensor, or remove sensor.bayer",
        ));
    }
    let most = f64::from(u16::MAX >> (16 - file.bits.min(16)));
    if sensor.saturation_counts > most {
        return Err(FileError::new(
            path,
            format_args!(
                "has {} bits, at most {most} counts, but rig.toml says that the sensor saturates at {}",
                file.bits, sensor.saturation_counts
            ),
            "save the sensor's own counts, in 16 bits, or give black_counts and saturation_counts of these",
        ));
    }
    Ok(())
}

/// Merges exposures (seconds, counts) of the same size and number of channels, and checks that they
/// agree with each other and with the sensor; there must be at least one. `from` is where they come
/// from.
///
/// # Errors
/// They disagree by more than 5 %, or are a mosaic of another pattern than the sensor's.
pub fn merge_checked(
    exposures: &[(f64, RawFrame)],
    sensor: &Sensor,
    from: &Path,
) -> Result<Radiance, FileError> {
    let mut doubts = exposures
        .iter()
        .filter_map(|(_, raw)| mosaic_doubt(raw, sensor));
    if let Some(doubt) = doubts.next() {
        let patterns = doubt.green().patterns();
        return Err(FileError::new(
            from,
            doubt,
            format_args!("give sensor.bayer in rig.toml, here {patterns}"),
        ));
    }
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
