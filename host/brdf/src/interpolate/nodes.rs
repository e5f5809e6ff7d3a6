//! What is known, as nodes to interpolate between: log values at mean measured directions, each
//! with its reciprocal twin.

use super::coordinates::{Coordinates, Point};
use crate::bins::{Bin, median};
use rayon::prelude::*;

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
pub fn half_of_nodes(bins: &[Bin], one_in: usize, coordinates: Coordinates) -> Vec<Node> {
    let floor = floor_of(bins.iter());
    (0..bins.len())
        .into_par_iter()
        .step_by(one_in.max(1))
        .map(|number| {
            let bin = &bins[number];
            let node = Node {
                point: coordinates.point(bin.light.map(f64::from), bin.view.map(f64::from)),
                log_value: [0, 1, 2].map(|c| bin.median[c].max(floor[c]).ln()),
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

/// Standard deviation of normal noise over the first quartile of the MADs of sets of so many numbers,
/// from 4 on (300,000 simulated sets each); of more, `1.4826 (1 + 5.8 / count)` less a little.
const SIGMA_PER_LOW_MAD: [f32; 17] = [
    3.549, 3.247, 2.720, 2.619, 2.394, 2.342, 2.220, 2.192, 2.113, 2.089, 2.031, 2.018, 1.976,
    1.964, 1.932, 1.926, 1.898,
];

fn sigma_per_low_mad(count: u32) -> f32 {
    let place = count.saturating_sub(4) as usize;
    let many = SIGMA_PER_MAD * (1.0 + 5.8 / count.max(1) as f32);
    SIGMA_PER_LOW_MAD.get(place).copied().unwrap_or(many)
}

/// Variance of the logarithm of one sample, estimated from the spread inside bins of at least four
/// samples; `None` when no bin has that many. The quarter of the bins with the least spread decides:
/// where the material changes within a bin, the spread is not all noise.
pub fn log_noise_variance<'a>(bins: impl Iterator<Item = &'a Bin>) -> Option<f32> {
    let mut sigmas: Vec<f32> = bins
        .filter(|b| b.count >= 4)
        .flat_map(|b| [0, 1, 2].map(|c| sigma_per_low_mad(b.count) * b.mad[c] / b.median[c]))
        .filter(|r| r.is_finite() && *r > 0.0)
        .collect();
    if sigmas.is_empty() {
        return None;
    }
    let quarter = sigmas.len() / 4;
    let (_, sigma, _) = sigmas.select_nth_unstable_by(quarter, f32::total_cmp);
    Some(*sigma * *sigma)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_found_from_small_bins_also_where_some_hold_a_slope() {
        let mut state = 1u64;
        let mut normal = || {
            let mut uniform = || {
                state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
                (state >> 33) as f32 / (1u64 << 31) as f32
            };
            (0..12).map(|_| uniform()).sum::<f32>() - 6.0
        };
        for (count, slope) in [(4, 0.0), (5, 0.0), (9, 0.0), (30, 0.0), (6, 0.05)] {
            let bins: Vec<Bin> = (0..20_000)
                .map(|k| {
                    // Half of the bins of a sloped material are flat.
                    let slope = if k % 2 == 0 { slope } else { 0.0 };
                    let mut median_of = || {
                        let mut values: Vec<f32> = (0..count)
                            .map(|i| 1.0 + 0.02 * normal() + slope * i as f32 / count as f32)
                            .collect();
                        let middle = median(&mut values);
                        values.iter_mut().for_each(|v| *v = (*v - middle).abs());
                        (middle, median(&mut values))
                    };
                    let channels = [(); 3].map(|()| median_of());
                    Bin {
                        cell: k,
                        count,
                        frame: 0,
                        median: channels.map(|c| c.0),
                        mad: channels.map(|c| c.1),
                        light: [0.0, 0.0, 1.0],
                        view: [0.0, 0.0, 1.0],
                    }
                })
                .collect();
            let sigma = log_noise_variance(bins.iter()).unwrap().sqrt();
            let tolerance = if slope > 0.0 { 0.004 } else { 0.0006 };
            assert!((sigma - 0.02).abs() < tolerance, "{count} {slope}: {sigma}");
        }
    }
}
