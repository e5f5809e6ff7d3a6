//! What is known, as nodes to interpolate between: log values at mean measured directions, each
//! with its reciprocal twin.

use super::coordinates::{Coordinates, Point};
use crate::bins::{Bin, Bins, median};
use rayon::prelude::*;

/// One known value.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Place.
    pub point: Point,
    /// Natural logarithm of the bin's value, per channel: see [`Bins::log_value`].
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

    /// The same with light and view exchanged: [`Coordinates`] only flip the sign of the second half.
    pub fn mirrored(&self) -> Self {
        let [a, b, c, d, e, f] = self.point;
        Self {
            point: [a, b, c, -d, -e, -f],
            source: self.source ^ 1,
            ..*self
        }
    }
}

/// A median at or below this share of the material's median brightness is raised to it: noise can
/// make dark values negative, and their logarithm must stay finite.
const FLOOR_SHARE: f32 = 1e-4;

/// A node of one bin in so many, numbered as all bins come: the bin's own or its mirror image (light and view exchanged),
/// whichever's difference of light and view points to positive x. The others are the mirror images of these.
pub fn half_of_nodes(bins: &Bins, one_in: usize, coordinates: Coordinates) -> Vec<Node> {
    let floor = floor_of(bins.bins().iter());
    (0..bins.bins().len())
        .into_par_iter()
        .step_by(one_in.max(1))
        .map(|number| {
            let bin = &bins.bins()[number];
            let node = Node {
                point: coordinates.point(bin.light.map(f64::from), bin.view.map(f64::from)),
                log_value: [0, 1, 2].map(|c| bins.log_value(bin, c, floor[c])),
                count: bin.count as f32,
                source: 2 * number as u32,
            };
            if node.point[3] < 0.0 {
                node.mirrored()
            } else {
                node
            }
        })
        .collect()
}

/// The mean of nodes at given places, weighted by count; `None` of none.
pub(super) fn merge<'a>(nodes: impl Iterator<Item = (Point, &'a Node)>) -> Option<Node> {
    let mut point = [0.0; 6];
    let mut log_value = [0.0; 3];
    let mut count = 0.0;
    for (place, node) in nodes {
        for k in 0..6 {
            point[k] += node.count * place[k];
        }
        for c in 0..3 {
            log_value[c] += node.count * node.log_value[c];
        }
        count += node.count;
    }
    (count > 0.0).then(|| Node {
        point: point.map(|p| p / count),
        log_value: log_value.map(|v| v / count),
        count,
        source: u32::MAX,
    })
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
