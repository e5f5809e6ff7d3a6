//! Brackets of linear raw frames with known exposure times → radiance with a variance per pixel.
//!
//! Exposures are merged pixel by pixel, before demosaicing, so that each photosite is weighed by its
//! own noise; what is saturated in every exposure is marked, not guessed.

mod demosaic;
mod merge;
mod mosaic;
#[cfg(test)]
mod tests;

pub use merge::Linearity;
pub use mosaic::{Diagonal, MosaicDoubt, mosaic_doubt};

use gonia_rig::{Frame, RawFrame, Sensor};

/// Exposures that disagree by more than this share are not of a linear sensor, or not of what
/// `rig.toml` and `frames.csv` say of them.
pub const LINEARITY_LIMIT: f64 = 0.05;

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

/// Merges exposures (seconds, counts) of the same size and number of channels; there must be at least
/// one.
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
