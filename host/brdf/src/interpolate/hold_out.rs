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
use crate::direction::{Direction, Vec3};
use crate::grid::Grid;
use crate::sample::Sample;
use rayon::prelude::*;

/// Fewer tests than this say nothing.
const TESTS_MIN: usize = 100;
/// Clusters of samples without frames have about this size, degrees.
const CLUSTER_DEG: f64 = 15.0;

/// Held-out bins of a frame in one block that are averaged, at most.
const MATES: usize = 64;
/// Sets of frames to hold out in turn, where there are few bins: one would decide by chance, and several
/// are cheap then.
const SETS: u32 = 4;

/// Some bins held out of all.
pub struct HoldOut<'a> {
    bins: &'a Bins,
    /// Of each bin, whether it is known.
    training: Vec<bool>,
    /// All that are held out.
    left_out: Vec<&'a Bin>,
    /// Whether frames are held out, not clusters.
    framed: bool,
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
    /// Logarithm of predicted over measured, of channels that can have one.
    pub residual: [Option<f32>; 3],
    /// Variance of the prediction as the nodes around show it, per channel, not calibrated.
    pub variance: [f32; 3],
}

/// What the others make of the held-out bins of one frame (or cluster) in one block. Their mean tells of
/// errors that noise hides from each of them.
#[derive(Clone, Debug)]
pub struct Mean<'a> {
    /// One of them.
    pub first: Prediction<'a>,
    /// All of them.
    pub bins: Vec<&'a Bin>,
    /// Mean logarithm of predicted over measured, of channels that can have one.
    pub residual: [Option<f32>; 3],
    /// Variance of the mean of the predictions, per channel, not calibrated.
    pub variance: [f32; 3],
}

impl<'a> HoldOut<'a> {
    /// Holds out one group of frames (or clusters) in `one_in`, the `set`th choice of several, and of
    /// their bins about `tests`: half of them among the brightest tenth, because an error that a few
    /// bright cells decide would else rest on a handful. `None` when there are too few to say anything.
    pub fn new(all: &'a Bins, set: u32, one_in: u32, tests: usize) -> Option<Self> {
        let bins = all.bins();
        let framed = bins.iter().any(|b| b.frame != Sample::NO_FRAME);
        let held_out = |bin: &Bin| {
            hash(group_of(bin, framed))
                .wrapping_add(set)
                .is_multiple_of(one_in)
        };
        // Bins of several frames may hold a part of a held-out frame, so none of them takes part.
        let takes_part = |bin: &Bin| !framed || bin.frame != Sample::NO_FRAME;
        let training: Vec<bool> = bins
            .iter()
            .map(|bin| takes_part(bin) && !held_out(bin))
            .collect();
        let left_out: Vec<&Bin> = bins
            .iter()
            .filter(|bin| takes_part(bin) && held_out(bin))
            .collect();
        let tests = pick(left_out.clone(), tests);
        let trained = training.iter().filter(|known| **known).count();
        (tests.len() >= TESTS_MIN && trained >= TESTS_MIN).then_some(Self {
            bins: all,
            training,
            left_out,
            framed,
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

    /// Predicts the tests, by the very blocks that a fill of these known bins (the same that some were held
    /// out of) with these settings would use.
    pub fn predict(&self, known: &Known, settings: &Settings) -> Vec<Prediction<'a>> {
        let means = self.predict_among(known, settings, |_| &[]);
        means.into_iter().map(|mean| mean.first).collect()
    }

    /// Predicts the tests together with the other held-out bins of their frames (or clusters) in the same block.
    pub fn predict_means(&self, known: &Known, settings: &Settings) -> Vec<Mean<'a>> {
        let grid = self.bins.grid();
        let patches = cover(grid, &settings.patch_sizes_deg()).patches;
        let patch_of = patch_of_direction(grid, &patches);
        let key = |bin: &Bin| {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            (group_of(bin, self.framed), patch_of[light], patch_of[view])
        };
        let mut sorted: Vec<_> = self.left_out.iter().map(|bin| (key(bin), *bin)).collect();
        sorted.sort_by_key(|(key, bin)| (*key, bin.cell));
        let (keys, bins): (Vec<_>, Vec<&Bin>) = sorted.into_iter().unzip();
        self.predict_among(known, settings, |bin| {
            let key = key(bin);
            let from = keys.partition_point(|k| *k < key);
            let to = keys.partition_point(|k| *k <= key);
            &bins[from..to]
        })
    }

    fn predict_among<'b>(
        &self,
        known: &Known,
        settings: &Settings,
        mates: impl Fn(&Bin) -> &'b [&'a Bin] + Sync,
    ) -> Vec<Mean<'a>>
    where
        'a: 'b,
    {
        let bins = self.bins;
        let grid = bins.grid();
        let residual = |bin: &Bin, log: [f32; 3]| {
            [0, 1, 2].map(|c| {
                let measured = bins.log_value(bin, c, f32::MIN_POSITIVE);
                (bin.median[c] > 0.0).then(|| log[c] - measured)
            })
        };
        let sorted = known.sorted_for(settings.coordinates);
        let nodes = sorted
            .as_ref()
            .unwrap_or(known)
            .part(settings.coordinates, |bin| self.training[bin]);
        let patches = cover(grid, &settings.patch_sizes_deg()).patches;
        let patch_of = patch_of_direction(grid, &patches);
        let work = || (Refiner::default(), Vec::new());
        self.tests
            .par_iter()
            .map_init(work, |(refiner, members), (bin, weight)| {
                let (light, view) = grid.light_and_view(bin.cell as usize);
                let (p, q) = (&patches[patch_of[light]], &patches[patch_of[view]]);
                let mates = mates(bin);
                let step = mates.len().div_ceil(MATES).max(1);
                let others = mates.iter().step_by(step);
                let others = others.filter(|mate| mate.cell != bin.cell).copied();
                members.clear();
                members.extend(std::iter::once(*bin).chain(others).map(Member::of));
                let predicted = refiner.predict(&nodes, settings, (p, q), members);
                let mut mean = Mean {
                    first: Prediction {
                        bin,
                        weight: *weight,
                        log: predicted.logs[0],
                        residual: residual(bin, predicted.logs[0]),
                        variance: predicted.variance,
                    },
                    bins: members.iter().map(|m| m.bin).collect(),
                    residual: [Some(0.0); 3],
                    variance: predicted.variance_of_mean,
                };
                let share = 1.0 / members.len() as f32;
                for (member, log) in members.iter().zip(predicted.logs) {
                    let own = residual(member.bin, *log);
                    for c in 0..3 {
                        mean.residual[c] = mean.residual[c].zip(own[c]).map(|(m, r)| m + share * r);
                    }
                }
                mean
            })
            .collect()
    }
}

/// A bin and its place.
struct Member<'a> {
    bin: &'a Bin,
    place: (Vec3, Vec3),
}

impl<'a> Member<'a> {
    fn of(bin: &'a Bin) -> Self {
        let place = (bin.light.map(f64::from), bin.view.map(f64::from));
        Self { bin, place }
    }
}

impl AsRef<(Vec3, Vec3)> for Member<'_> {
    fn as_ref(&self) -> &(Vec3, Vec3) {
        &self.place
    }
}

/// Number of the frame or the cluster that a bin is held out with.
fn group_of(bin: &Bin, framed: bool) -> u32 {
    if framed { bin.frame } else { cluster(bin) }
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
