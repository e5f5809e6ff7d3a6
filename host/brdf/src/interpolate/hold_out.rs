//! Bins held out, and how well the others predict them.
//!
//! Holding out single bins tells nothing, because a bin's neighbours come from the same frame; what
//! is missing between the measured directions is whole frames. Samples that come without the
//! number of a frame are held out by clusters of directions instead.

use super::Settings;
use super::known::{Known, MANY_BINS};
use super::patches::{Patch, cover};
use super::refine::Refiner;
use crate::bins::{Bin, Bins};
use crate::direction::Direction;
use crate::grid::Grid;
use crate::sample::Sample;
use rayon::prelude::*;

/// Fewer tests than this say nothing.
const TESTS_MIN: usize = 100;
/// Clusters of samples without frames have about this size, degrees.
const CLUSTER_DEG: f64 = 15.0;

/// Sets of frames to hold out in turn, where there are few bins: one would decide by chance, and several
/// are cheap then.
const SETS: u32 = 4;

/// Some bins held out of all.
pub struct HoldOut<'a> {
    known: &'a Known<'a>,
    /// Of each bin, whether it is known.
    training: Vec<bool>,
    /// Bins that are to be predicted, each with the number of held-out bins it stands for.
    tests: Vec<(&'a Bin, f32)>,
}

/// A held-out bin and what the others make of it.
#[derive(Clone, Copy, Debug)]
pub struct Prediction<'a> {
    /// The bin.
    pub bin: &'a Bin,
    /// How many held-out bins it stands for.
    pub weight: f32,
    /// Natural logarithm of the value predicted, per channel.
    pub log: [f32; 3],
    /// Variance of this as the nodes around show it, per channel, not calibrated.
    pub variance: [f32; 3],
}

impl Prediction<'_> {
    /// Logarithm of predicted over measured, of channels that can have one.
    pub fn residual(&self, channel: usize) -> Option<f32> {
        let median = self.bin.median[channel];
        (median > 0.0).then(|| self.log[channel] - median.ln())
    }
}

impl<'a> HoldOut<'a> {
    /// Holds out one group of frames (or clusters) in `one_in`, the `set`th choice of several, and of
    /// their bins about `tests`: half of them among the brightest tenth, because an error that a few
    /// bright cells decide would else rest on a handful. `None` when there are too few to say anything.
    pub fn new(known: &'a Known<'a>, set: u32, one_in: u32, tests: usize) -> Option<Self> {
        let bins = known.bins().bins();
        let framed = bins.iter().any(|b| b.frame != Sample::NO_FRAME);
        let held_out = |bin: &Bin| {
            let group = if framed { bin.frame } else { cluster(bin) };
            hash(group).wrapping_add(set).is_multiple_of(one_in)
        };
        // Bins of several frames may hold a part of a held-out frame, so none of them takes part.
        let takes_part = |bin: &Bin| !framed || bin.frame != Sample::NO_FRAME;
        let training: Vec<bool> = bins
            .iter()
            .map(|bin| takes_part(bin) && !held_out(bin))
            .collect();
        let candidates = bins
            .iter()
            .filter(|bin| takes_part(bin) && held_out(bin))
            .collect();
        let tests = pick(candidates, tests);
        let trained = training.iter().filter(|known| **known).count();
        (tests.len() >= TESTS_MIN && trained >= TESTS_MIN).then_some(Self {
            known,
            training,
            tests,
        })
    }

    /// How many sets to hold out in turn.
    pub fn sets(bins: &Bins) -> u32 {
        if bins.bins().len() < MANY_BINS {
            SETS
        } else {
            1
        }
    }

    /// Predicts the tests, by the very blocks that a fill with these settings would use.
    pub fn predict(&self, settings: &Settings) -> Vec<Prediction<'a>> {
        let grid = self.known.bins().grid();
        let sorted = self.known.sorted_for(settings.coordinates);
        let nodes = sorted
            .as_ref()
            .unwrap_or(self.known)
            .part(settings.coordinates, |bin| self.training[bin]);
        let patches = cover(grid, &settings.patch_sizes_deg()).patches;
        let patch_of = patch_of_direction(grid, &patches);
        self.tests
            .par_iter()
            .map_init(Refiner::default, |refiner, (bin, weight)| {
                let (light, view) = grid.light_and_view(bin.cell as usize);
                let (p, q) = (&patches[patch_of[light]], &patches[patch_of[view]]);
                let place = (bin.light.map(f64::from), bin.view.map(f64::from));
                let (log, variance) = refiner.predict(&nodes, settings, (p, q), place);
                Prediction {
                    bin,
                    weight: *weight,
                    log,
                    variance,
                }
            })
            .collect()
    }
}

/// Picks about `n` bins, half of them among the brightest tenth.
fn pick(mut bins: Vec<&Bin>, n: usize) -> Vec<(&Bin, f32)> {
    let brightness = |bin: &Bin| bin.median.iter().sum::<f32>();
    let bright = bins.len() / 10;
    if bright > 0 {
        bins.select_nth_unstable_by(bright, |a, b| {
            let order = brightness(b).total_cmp(&brightness(a));
            order.then(a.cell.cmp(&b.cell))
        });
    }
    let (bright, others) = bins.split_at_mut(bright);
    let mut picked = Vec::with_capacity(n + 2);
    for part in [bright, others] {
        part.sort_unstable_by_key(|bin| bin.cell);
        let step = part.len().div_ceil((n / 2).max(1)).max(1);
        picked.extend(part.iter().step_by(step).map(|bin| (*bin, step as f32)));
    }
    picked
}

/// The patch that each direction is in.
fn patch_of_direction(grid: Grid, patches: &[Patch]) -> Vec<usize> {
    let mut patch_of = vec![0; grid.n_directions()];
    for (number, patch) in patches.iter().enumerate() {
        for direction in &patch.directions {
            patch_of[*direction as usize] = number;
        }
    }
    patch_of
}

/// The cluster of directions that a bin belongs to.
fn cluster(bin: &Bin) -> u32 {
    let part = |v: [f32; 3]| {
        let d = Direction::from_vec3(v.map(f64::from));
        let ring = (d.theta_deg() / CLUSTER_DEG).round();
        let around = (360.0 * (ring * CLUSTER_DEG).to_radians().sin() / CLUSTER_DEG).max(1.0);
        let column = (d.phi_deg() / 360.0 * around).floor();
        (64.0 * ring + column) as u32
    };
    (part(bin.light) << 16) ^ part(bin.view)
}

/// Spreads frame numbers, so that held-out frames are no regular pattern of the plan.
fn hash(group: u32) -> u32 {
    let mut x = u64::from(group).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x ^= x >> 29;
    (x.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 32) as u32
}
