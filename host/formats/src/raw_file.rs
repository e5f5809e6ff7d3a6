//! What every kind of file of a raw frame has, and what is said of those that are not read.

use crate::FileError;
use gonia_rig::{Bayer, RawFrame, Sensor};
use std::path::Path;

/// A raw frame, and what its file says of the counts.
#[derive(Clone, Debug, PartialEq)]
pub struct RawFile {
    /// The counts.
    pub raw: RawFrame,
    /// Bits of a count in the file: 8 or 16.
    pub bits: u8,
    /// Why the counts are not proportional to light, where the file says so (in words): by the chunks
    /// sRGB, gAMA, iCCP or cICP of a PNG, or the colour profile of a TIFF.
    pub encoded: Option<String>,
    /// What the file says of the sensor: a DNG does.
    pub sensor: Option<FileSensor>,
}

/// What a file says of the sensor that its counts are from.
#[derive(Clone, Debug, PartialEq)]
pub struct FileSensor {
    /// Counts without light.
    pub black_counts: f64,
    /// Counts at and above which the sensor is no longer linear.
    pub saturation_counts: f64,
    /// The colour filters.
    pub bayer: Option<Bayer>,
    /// Variance of counts from black (0) to saturation (1): a share of the value, and a constant.
    pub noise: Option<[f64; 2]>,
    /// How long it was exposed, seconds.
    pub exposure_s: Option<f64>,
}

impl FileSensor {
    /// The sensor, where the file says its noise too.
    pub fn sensor(&self) -> Option<Sensor> {
        let [shot, read] = self.noise?;
        let range = self.saturation_counts - self.black_counts;
        let gain_e_per_count = 1.0 / (shot * range);
        Some(Sensor {
            black_counts: self.black_counts,
            saturation_counts: self.saturation_counts,
            gain_e_per_count,
            read_noise_e: gain_e_per_count * range * read.sqrt(),
            bayer: self.bayer,
        })
    }
}

/// A file as cameras write it, which is not read.
pub(super) fn camera_raw(path: &Path, kind: &str) -> FileError {
    FileError::new(
        path,
        format_args!("is a {kind}, which is not read"),
        "convert it to DNG (dnglab convert, or Adobe's DNG Converter), or make a TIFF of its counts, as the sensor gave them and not turned: dcraw -D -4 -t 0 -T",
    )
}

/// A frame of another camera.
pub(super) fn wrong_size(path: &Path, seen: [usize; 2], camera: [usize; 2]) -> FileError {
    FileError::new(
        path,
        format_args!(
            "is {} × {} pixels, but the rig's camera has {} × {}",
            seen[0], seen[1], camera[0], camera[1]
        ),
        "mend [camera] in rig.toml or use the frames of this rig",
    )
}
