//! How much cutting a fill can afford.
//!
//! A pair of patches has some sixteen pairs of parts. What a fine block gains in one of them is not known
//! beforehand; the best sign of it is by how much a fine block differs from the coarse one where the
//! values change most ([`Refiner::doubts`]). So the parts doubted most get one, as many as a budget
//! allows: the *tolerance* above which they do is raised until the parts beyond it, in a sample of all
//! pairs, are no more. On a dense plan few are doubted, and nothing is raised.

use super::Settings;
use super::levels::Neighbours;
use super::patches::Cover;
use super::refine::Refiner;
use rayon::prelude::*;

/// Pairs of patches that are looked at: enough to know a share of a fifth to a twentieth of itself.
const SAMPLE: usize = 1500;
/// Tolerances are rounded up to a multiple of this, so that they are printed in full.
const ROUND: f32 = 0.01;

/// The smallest tolerance, from `settings.tolerance` on, with which cutting costs no more than
/// `settings.budget` fine blocks a pair of patches.
pub fn affordable_tolerance(
    nodes: &(impl Neighbours + Sync),
    cover: &Cover,
    settings: &Settings,
) -> f32 {
    if !settings.cuts() || settings.budget == f32::INFINITY {
        return settings.tolerance;
    }
    let n = cover.patches.len();
    // A stride without common factors with the number of pairs meets all kinds of them.
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|p| (p..n).map(move |q| (p, q))).collect();
    let stride = (pairs.len() as f64 / SAMPLE as f64).max(1.0);
    let sampled = ((pairs.len() as f64 / stride) as usize).min(pairs.len());
    let mut doubts: Vec<f32> = (0..sampled)
        .into_par_iter()
        .map_init(Refiner::default, |refiner, k| {
            let (p, q) = pairs[scattered(k, stride, pairs.len())];
            let (p, q) = (&cover.patches[p], &cover.patches[q]);
            refiner.doubts(nodes, settings, p, q).to_vec()
        })
        .flatten_iter()
        .filter(|doubt| *doubt > settings.tolerance)
        .collect();
    let affordable = (settings.budget * sampled as f32) as usize;
    if doubts.len() <= affordable {
        return settings.tolerance;
    }
    let (_, doubt, _) = doubts.select_nth_unstable_by(affordable, |a, b| b.total_cmp(a));
    (*doubt / ROUND).ceil() * ROUND
}

/// The `k`th of a sample: one of each stretch of so many numbers, at a place within it that does not
/// repeat with the rows of patches.
fn scattered(k: usize, stride: f64, length: usize) -> usize {
    let within = (k as f64 * 0.618_033_988_749_895).fract();
    (((k as f64 + within) * stride) as usize).min(length - 1)
}
