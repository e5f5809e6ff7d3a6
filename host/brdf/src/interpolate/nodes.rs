//! What is known, as nodes to interpolate between: log values at mean measured directions, each
//! with its reciprocal twin.

use super::coordinates::{Coordinates, Point};
use crate::bins::{Bin, median};

/// One known value.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Place.
    pub point: Point,
    /// Natural logarithm of the bin's median, per channel.
    pub log_value: [f32; 3],
    /// Number of samples behind it.
    pub count: f32,
}

/// A median at or below this share of the material's median brightness is raised to it: noise can
/// make dark values negative, and their logarithm must stay finite.
const FLOOR_SHARE: f32 = 1e-4;

/// Nodes of bins and of their mirror images (light and view exchanged).
pub fn nodes_of<'a>(
    bins: impl Iterator<Item = &'a Bin> + Clone,
    coordinates: Coordinates,
) -> Vec<Node> {
    let floor = floor_of(bins.clone());
    bins.flat_map(|bin| {
        let log_value = [0, 1, 2].map(|c| bin.median[c].max(floor[c]).ln());
        let (light, view) = (bin.light.map(f64::from), bin.view.map(f64::from));
        [(light, view), (view, light)].map(|(i, v)| Node {
            point: coordinates.point(i, v),
            log_value,
            count: bin.count as f32,
        })
    })
    .collect()
}

/// The smallest value per channel that takes part.
pub(crate) fn floor_of<'a>(bins: impl Iterator<Item = &'a Bin> + Clone) -> [f32; 3] {
    [0, 1, 2].map(|c| {
        // A few thousand bins tell the median brightness well enough for a floor.
        let total = bins.clone().count().max(1);
        let mut values: Vec<f32> = bins
            .clone()
            .step_by(total.div_ceil(20_000))
            .map(|b| b.median[c])
            .filter(|v| *v > 0.0)
            .collect();
        (FLOOR_SHARE * median(&mut values)).max(f32::MIN_POSITIVE)
    })
}

/// Variance of the logarithm of one sample, estimated from the spread inside bins of at least four
/// samples (median over bins and channels of the squared, normalised MAD); `None` when no bin has
/// that many.
pub fn log_noise_variance<'a>(bins: impl Iterator<Item = &'a Bin>) -> Option<f32> {
    /// Ratio of standard deviation to MAD for normal noise.
    const SIGMA_PER_MAD: f32 = 1.4826;
    let mut relative: Vec<f32> = bins
        .filter(|b| b.count >= 4)
        .flat_map(|b| [0, 1, 2].map(|c| b.mad[c] / b.median[c]))
        .filter(|r| r.is_finite() && *r > 0.0)
        .collect();
    if relative.is_empty() {
        return None;
    }
    let sigma = SIGMA_PER_MAD * median(&mut relative);
    Some(sigma * sigma)
}
