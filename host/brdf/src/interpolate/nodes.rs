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
    /// Number of samples behind it; less where the value is doubted.
    pub count: f32,
    /// Twice the number of the bin it came from, and one more where light and view are exchanged;
    /// of no meaning for a merged node.
    pub source: u32,
}

impl Node {
    /// Number of the bin that the node came from.
    pub fn bin(&self) -> usize {
        (self.source / 2) as usize
    }

    /// Where a bin of this node lies in other coordinates.
    pub fn point_of(&self, bin: &Bin, coordinates: Coordinates) -> Point {
        let (light, view) = (bin.light.map(f64::from), bin.view.map(f64::from));
        match self.source % 2 {
            0 => coordinates.point(light, view),
            _ => coordinates.point(view, light),
        }
    }
}

/// A median at or below this share of the material's median brightness is raised to it: noise can
/// make dark values negative, and their logarithm must stay finite.
const FLOOR_SHARE: f32 = 1e-4;

/// Nodes of bins, numbered as they come, and of their mirror images (light and view exchanged).
pub fn nodes_of<'a>(
    bins: impl Iterator<Item = &'a Bin> + Clone,
    coordinates: Coordinates,
) -> Vec<Node> {
    let floor = floor_of(bins.clone());
    let mut nodes = Vec::with_capacity(2 * bins.size_hint().0);
    for (number, bin) in bins.enumerate() {
        for mirrored in 0..2 {
            let mut node = Node {
                point: [0.0; 6],
                log_value: [0, 1, 2].map(|c| bin.median[c].max(floor[c]).ln()),
                count: bin.count as f32,
                source: 2 * number as u32 + mirrored,
            };
            node.point = node.point_of(bin, coordinates);
            nodes.push(node);
        }
    }
    nodes
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

/// Ratio of standard deviation to MAD for normal noise.
pub const SIGMA_PER_MAD: f32 = 1.4826;

/// Variance of the logarithm of one sample, estimated from the spread inside bins of at least four
/// samples (median over bins and channels of the squared, normalised MAD); `None` when no bin has
/// that many.
pub fn log_noise_variance<'a>(bins: impl Iterator<Item = &'a Bin>) -> Option<f32> {
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
