//! What `rig.toml` says of the sensor.

use serde::{Deserialize, Serialize};

/// A linear sensor, for frames whose rows in `frames.csv` have an exposure time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Counts without light.
    pub black_counts: f64,
    /// Counts at and above which the sensor is no longer linear.
    pub saturation_counts: f64,
    /// Electrons a count: what shot noise follows from.
    pub gain_e_per_count: f64,
    /// Standard deviation of the read noise, electrons.
    pub read_noise_e: f64,
    /// The colour filters; without them a grey frame is that of a mono sensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bayer: Option<Bayer>,
}

/// Colour filters of the top left 2 × 2 photosites, row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
#[allow(missing_docs)]
pub enum Bayer {
    Rggb,
    Bggr,
    Grbg,
    Gbrg,
}

impl Bayer {
    /// Channel (0 red, 1 green, 2 blue) by row and column.
    pub fn colors(self) -> [[usize; 2]; 2] {
        match self {
            Bayer::Rggb => [[0, 1], [1, 2]],
            Bayer::Bggr => [[2, 1], [1, 0]],
            Bayer::Grbg => [[1, 0], [2, 1]],
            Bayer::Gbrg => [[1, 2], [0, 1]],
        }
    }
}
