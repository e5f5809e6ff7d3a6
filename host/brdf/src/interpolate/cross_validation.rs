//! Cross-validation grouped by image: how well the bins of some frames predict those of the others.
//!
//! Leaving out single bins would show nothing, because a bin's neighbours come from the same frame; what
//! is missing between the measured directions is whole frames. Samples that come without the
//! number of a frame are grouped by clusters of directions instead.

use super::FillSettings;
use super::block::kernel::{AnyKernel, NewBlock};
use super::data::{Data, MANY_BINS};
use super::patches::{Patch, cover};
use super::refine::{Predicted, Refiner, part_of};
use crate::bins::{Bin, Bins};
use crate::direction::{Direction, Vec3};
use crate::elementary::Elementary;
use crate::grid::Grid;
use crate::sample::Sample;
use rayon::prelude::*;

/// Fewer tests than this are no evidence.
pub(super) const TESTS_MIN: usize = 100;
/// Clusters of samples without frames have about this size, degrees.
const CLUSTER_DEG: f64 = 15.0;

/// Bins of a frame in one block whose predictions are averaged, at most.
const MATES: usize = 64;
/// Folds where there are few bins: one would decide by chance, and several are cheap then.
const FOLDS: u32 = 4;
/// Changes the numbers of groups for another choice of them.
const HALVED: u32 = 0x5bd1_e995;
/// Errors of so many groups, at least, are to be seen where there are as many.
const GROUPS: usize = 64;

/// All bins, divided into those that predict and those that are predicted.
pub struct Fold<'a, const N: usize = 3> {
    bins: &'a Bins<N>,
    /// Of each bin, whether it takes part in the prediction.
    training: Vec<bool>,
    /// All that are left out.
    left_out: Vec<&'a Bin<N>>,
    /// Whether frames are the groups, not clusters.
    framed: bool,
    /// Bins that are to be predicted, each with the number of left-out bins it stands for.
    tests: Vec<(&'a Bin<N>, f32)>,
}

/// A bin that was left out, and what the others predict of it.
#[derive(Clone, Copy, Debug)]
pub struct Prediction<'a, const N: usize = 3> {
    /// The bin.
    pub bin: &'a Bin<N>,
    /// How many left-out bins it stands for.
    pub weight: f32,
    /// Natural logarithm of the value predicted, per channel.
    pub log: [f32; N],
    /// Logarithm of predicted over measured, of channels that can have one.
    pub residual: [Option<f32>; N],
    /// Variance of the prediction as the data around show it, per channel, not calibrated.
    pub variance: [f32; N],
}

/// What the others predict of the left-out bins of one frame (or cluster) in one block. Their mean shows
/// errors that noise hides in each of them.
#[derive(Clone, Debug)]
pub struct MeanPrediction<'a, const N: usize = 3> {
    /// One of them.
    pub first: Prediction<'a, N>,
    /// Number of their frame (or cluster).
    pub group: u32,
    /// All of them.
    pub bins: Vec<&'a Bin<N>>,
    /// Mean logarithm of predicted over measured, of channels that can have one.
    pub residual: [Option<f32>; N],
    /// Variance of the mean of the predictions, per channel, not calibrated.
    pub variance: [f32; N],
}

impl<'a, const N: usize> Fold<'a, N> {
    /// Leaves out one frame (or cluster) in `one_in`, those of fold `number`, and tests about `tests` of
    /// their bins: half of them among the brightest tenth, because an error that a few
    /// bright cells decide would else rest on a handful. `None` when there are too few to say anything.
    pub fn new(all: &'a Bins<N>, number: u32, one_in: u32, tests: usize) -> Option<Self> {
        let fold = Self::one_of_many(all, number, one_in, tests)?;
        (fold.tests.len() >= TESTS_MIN).then_some(fold)
    }

    /// The same however few its tests are: they count together with those of other folds.
    pub fn one_of_many(all: &'a Bins<N>, number: u32, one_in: u32, tests: usize) -> Option<Self> {
        let bins = all.bins();
        let framed = bins.iter().any(|b| b.frame != Sample::NO_FRAME);
        let is_left_out = |bin: &Bin<N>| {
            hash(group_of(bin, framed))
                .wrapping_add(number)
                .is_multiple_of(one_in)
        };
        // Bins of several frames may hold a part of a left-out frame, so none of them takes part.
        let takes_part = |bin: &Bin<N>| !framed || bin.frame != Sample::NO_FRAME;
        let training: Vec<bool> = bins
            .iter()
            .map(|bin| takes_part(bin) && !is_left_out(bin))
            .collect();
        let left_out: Vec<&Bin<N>> = bins
            .iter()
            .filter(|bin| takes_part(bin) && is_left_out(bin))
            .collect();
        let tests = pick(left_out.clone(), tests);
        let trained = training.iter().filter(|is_used| **is_used).count();
        (!tests.is_empty() && trained >= TESTS_MIN).then_some(Self {
            bins: all,
            training,
            left_out,
            framed,
            tests,
        })
    }

    /// The same tests, predicted by about half of the frames (or clusters) that predict.
    pub fn halved(&self) -> Self {
        let bins = self.bins.bins().iter();
        // Another number than the one that folds are made of.
        let stays = |bin: &Bin<N>| hash(group_of(bin, self.framed) ^ HALVED) >> 7 & 1 == 0;
        let training = bins.zip(&self.training);
        Self {
            training: training.map(|(bin, used)| *used && stays(bin)).collect(),
            left_out: self.left_out.clone(),
            tests: self.tests.clone(),
            ..*self
        }
    }

    /// How many folds to take.
    pub fn usual_number(bins: &Bins<N>) -> u32 {
        if bins.bins().len() < MANY_BINS {
            FOLDS
        } else {
            1
        }
    }

    /// How many folds of one in `one_in` to take so that errors that groups have in common are seen of many: of few
    /// frames (or clusters) all are left out in turn.
    pub fn number_of_many_groups(bins: &Bins<N>, one_in: u32) -> u32 {
        let usual = Self::usual_number(bins);
        let bins = bins.bins();
        if bins.len() >= MANY_BINS {
            return usual;
        }
        let framed = bins.iter().any(|b| b.frame != Sample::NO_FRAME);
        let mut groups: Vec<u32> = bins.iter().map(|bin| group_of(bin, framed)).collect();
        groups.sort_unstable();
        groups.dedup();
        let needed = (GROUPS * one_in as usize).div_ceil(groups.len().max(1));
        (needed as u32).clamp(usual, one_in.max(usual))
    }

    /// Predicts the tests, by the very blocks that a fill of these data (of the same bins) with these
    /// settings would use.
    pub fn predict(&self, data: &Data<N>, settings: &FillSettings) -> Vec<Prediction<'a, N>>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let means = self.predict_among(data, settings, |_| &[]);
        means.into_iter().map(|mean| mean.first).collect()
    }

    /// Predicts the tests together with the other left-out bins of their frames (or clusters) in the same block.
    pub fn predict_means(
        &self,
        data: &Data<N>,
        settings: &FillSettings,
    ) -> Vec<MeanPrediction<'a, N>>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let grid = self.bins.grid();
        let patches = cover(grid, &settings.patch_sizes_deg()).patches;
        let patch_of = patch_of_direction(grid, &patches);
        let key = |bin: &Bin<N>| {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            (group_of(bin, self.framed), patch_of[light], patch_of[view])
        };
        let mut sorted: Vec<_> = self.left_out.iter().map(|bin| (key(bin), *bin)).collect();
        sorted.sort_by_key(|(key, bin)| (*key, bin.cell));
        let (keys, bins): (Vec<_>, Vec<&Bin<N>>) = sorted.into_iter().unzip();
        self.predict_among(data, settings, |bin| {
            let key = key(bin);
            let from = keys.partition_point(|k| *k < key);
            let to = keys.partition_point(|k| *k <= key);
            &bins[from..to]
        })
    }

    fn predict_among<'b>(
        &self,
        data: &Data<N>,
        settings: &FillSettings,
        mates: impl Fn(&Bin<N>) -> &'b [&'a Bin<N>] + Sync,
    ) -> Vec<MeanPrediction<'a, N>>
    where
        'a: 'b,
        dyn AnyKernel: NewBlock<N>,
    {
        let sorted = data.sorted_for(settings.coordinates);
        let training = sorted
            .as_ref()
            .unwrap_or(data)
            .subset(settings.coordinates, |bin| self.training[bin]);
        let patches = cover(self.bins.grid(), &settings.patch_sizes_deg()).patches;
        let pair = |(p, q): (usize, usize)| (&patches[p], &patches[q]);
        let work = || (Refiner::new(settings), Vec::new());
        let mut means: Vec<(usize, MeanPrediction<'a, N>)> = self
            .tests_by_block(&patches)
            .par_chunk_by(|a, b| a.0 == b.0)
            .map_init(work, |(refiner, members), tests| {
                let pair = pair(tests[0].0);
                refiner.prepare(&training, settings, pair);
                let of_test = |test: usize| {
                    let (bin, weight) = self.tests[test];
                    let mates = mates(bin);
                    let step = mates.len().div_ceil(MATES).max(1);
                    let others = mates.iter().step_by(step);
                    let others = others.filter(|mate| mate.cell != bin.cell).copied();
                    members.clear();
                    members.extend(std::iter::once(bin).chain(others).map(Member::of));
                    let predicted = refiner.predict(&training, settings, pair, members);
                    (test, self.mean_of(weight, members, &predicted))
                };
                tests.iter().map(|of| of.2).map(of_test).collect::<Vec<_>>()
            })
            .flatten_iter()
            .collect();
        means.sort_unstable_by_key(|(test, _)| *test);
        means.into_iter().map(|(_, mean)| mean).collect()
    }

    /// The numbers of the tests, each with the pair of patches that it is in and the part of this pair: in this order,
    /// tests of one pair share its coarse block, and those of one part a fine one.
    fn tests_by_block(&self, patches: &[Patch]) -> Vec<((usize, usize), Option<usize>, usize)> {
        let grid = self.bins.grid();
        let patch_of = patch_of_direction(grid, patches);
        let of_test = |(test, (bin, _)): (usize, &(&Bin<N>, f32))| {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            let (p, q) = (patch_of[light], patch_of[view]);
            let place = Member::of(*bin).place;
            ((p, q), part_of((&patches[p], &patches[q]), place), test)
        };
        let mut tests: Vec<_> = self.tests.iter().enumerate().map(of_test).collect();
        tests.sort_unstable();
        tests
    }

    /// What was predicted of some bins, of which the first is the test.
    fn mean_of(
        &self,
        weight: f32,
        members: &[Member<'a, N>],
        predicted: &Predicted<'_, N>,
    ) -> MeanPrediction<'a, N> {
        let residual = |bin: &Bin<N>, log: [f32; N]| {
            std::array::from_fn(|c| {
                let measured = self.bins.log_value(bin, c, f32::MIN_POSITIVE);
                (bin.median[c] > 0.0).then(|| log[c] - measured)
            })
        };
        let (bin, log) = (members[0].bin, predicted.logs[0]);
        let mut mean = MeanPrediction {
            first: Prediction {
                bin,
                weight,
                log,
                residual: residual(bin, log),
                variance: predicted.variance,
            },
            group: group_of(bin, self.framed),
            bins: members.iter().map(|m| m.bin).collect(),
            residual: [Some(0.0); N],
            variance: predicted.variance_of_mean,
        };
        let share = 1.0 / members.len() as f32;
        for (member, log) in members.iter().zip(predicted.logs) {
            let own = residual(member.bin, *log);
            for c in 0..N {
                mean.residual[c] = mean.residual[c].zip(own[c]).map(|(m, r)| m + share * r);
            }
        }
        mean
    }
}

/// A bin and its place.
struct Member<'a, const N: usize> {
    bin: &'a Bin<N>,
    place: (Vec3, Vec3),
}

impl<'a, const N: usize> Member<'a, N> {
    fn of(bin: &'a Bin<N>) -> Self {
        let place = (bin.light.map(f64::from), bin.view.map(f64::from));
        Self { bin, place }
    }
}

impl<const N: usize> AsRef<(Vec3, Vec3)> for Member<'_, N> {
    fn as_ref(&self) -> &(Vec3, Vec3) {
        &self.place
    }
}

/// Number of the frame or the cluster that a bin belongs to.
fn group_of<const N: usize>(bin: &Bin<N>, framed: bool) -> u32 {
    if framed { bin.frame } else { cluster(bin) }
}

/// Picks about `n` bins, half of them among the brightest tenth.
fn pick<const N: usize>(mut bins: Vec<&Bin<N>>, n: usize) -> Vec<(&Bin<N>, f32)> {
    let brightness = |bin: &Bin<N>| bin.median.iter().sum::<f32>();
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
fn cluster<const N: usize>(bin: &Bin<N>) -> u32 {
    let part = |v: [f32; 3]| {
        let d = Direction::from_vec3(v.map(f64::from));
        let ring = (d.theta_deg() / CLUSTER_DEG).round();
        let around = (360.0 * (ring * CLUSTER_DEG).to_radians().sine() / CLUSTER_DEG).max(1.0);
        let column = (d.phi_deg() / 360.0 * around).floor();
        (64.0 * ring + column) as u32
    };
    (part(bin.light) << 16) ^ part(bin.view)
}

/// Spreads frame numbers, so that the frames of a fold are no regular pattern of the plan.
fn hash(group: u32) -> u32 {
    let mut x = u64::from(group).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x ^= x >> 29;
    (x.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 32) as u32
}
