//! How much cutting a fill can afford.
//!
//! Cutting a pair of patches costs some sixteen fine blocks. What it gains is not known beforehand; the
//! best sign of it is by how much a fine block differs from the coarse one where the values change
//! most ([`Refiner::doubt`]). So the pairs doubted most are cut, as many as a budget allows: the
//! *tolerance* above which a pair is cut is raised until the share of pairs beyond it, in a sample
//! of all, costs no more. On a dense plan few pairs are doubted, and nothing is raised.

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
    let mut doubts: Vec<(f32, f32)> = (0..sampled)
        .into_par_iter()
        .map_init(Refiner::default, |refiner, k| {
            let (p, q) = pairs[scattered(k, stride, pairs.len())];
            let (p, q) = (&cover.patches[p], &cover.patches[q]);
            let blocks = p.children.len() * q.children.len();
            (refiner.doubt(nodes, settings, p, q), blocks as f32)
        })
        .collect();
    doubts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left = settings.budget * sampled as f32;
    for (doubt, blocks) in doubts {
        left -= blocks;
        if doubt <= settings.tolerance {
            break;
        }
        if left < 0.0 {
            return (doubt / ROUND).ceil() * ROUND;
        }
    }
    settings.tolerance
}

/// The `k`th of a sample: one of each stretch of so many numbers, at a place within it that does not
/// repeat with the rows of patches.
fn scattered(k: usize, stride: f64, length: usize) -> usize {
    let within = (k as f64 * 0.618_033_988_749_895).fract();
    (((k as f64 + within) * stride) as usize).min(length - 1)
}
