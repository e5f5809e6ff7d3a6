//! How much refinement a fill can afford.
//!
//! A pair of patches has some sixteen pairs of parts. What a fine block gains in one of them is not known
//! beforehand; the best sign of it is by how much a fine block differs from the coarse one where the
//! values change most ([`Refiner::deviations`]). So the parts of the largest deviations get one, as many as
//! a budget allows: the *tolerance* above which they do is raised until the parts that exceed it, in a
//! sample of all pairs, are no more. On a dense plan few exceed it, and nothing is raised.

use super::FillSettings;
use super::block::kernel::{AnyKernel, NewBlock};
use super::hierarchy::Neighbours;
use super::patches::Cover;
use super::refine::Refiner;
use rayon::prelude::*;

/// Pairs of patches that are looked at: enough to know a share of a fifth to a twentieth of itself.
const SAMPLE: usize = 1500;
/// Tolerances are rounded up to a multiple of this, so that they are printed in full.
const ROUND: f32 = 0.01;

/// The smallest tolerance, from `settings.tolerance` on, with which refinement costs no more than
/// `settings.budget` fine blocks a pair of patches.
pub fn affordable_tolerance<const N: usize>(
    data: &(impl Neighbours<N> + Sync),
    cover: &Cover,
    settings: &FillSettings,
) -> f32
where
    dyn AnyKernel: NewBlock<N>,
{
    if !settings.refines() || settings.budget == f32::INFINITY {
        return settings.tolerance;
    }
    let n = cover.patches.len();
    // A stride without common factors with the number of pairs meets all kinds of them.
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|p| (p..n).map(move |q| (p, q))).collect();
    let stride = (pairs.len() as f64 / SAMPLE as f64).max(1.0);
    let sampled = ((pairs.len() as f64 / stride) as usize).min(pairs.len());
    let mut deviations: Vec<f32> = (0..sampled)
        .into_par_iter()
        .map_init(
            || Refiner::<N>::new(settings),
            |refiner, k| {
                let (p, q) = pairs[scattered(k, stride, pairs.len())];
                let pair = (&cover.patches[p], &cover.patches[q]);
                refiner.deviations(data, settings, pair).to_vec()
            },
        )
        .flatten_iter()
        .filter(|deviation| *deviation > settings.tolerance)
        .collect();
    let affordable = (settings.budget * sampled as f32) as usize;
    if deviations.len() <= affordable {
        return settings.tolerance;
    }
    let (_, deviation, _) = deviations.select_nth_unstable_by(affordable, |a, b| b.total_cmp(a));
    (*deviation / ROUND).ceil() * ROUND
}

/// The `k`th of a sample: one of each run of so many numbers, at a place within it that does not
/// repeat with the rows of patches.
fn scattered(k: usize, stride: f64, length: usize) -> usize {
    let within = (k as f64 * 0.618_033_988_749_895).fract();
    (((k as f64 + within) * stride) as usize).min(length - 1)
}
