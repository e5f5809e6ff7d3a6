//! Blocks without seams.
//!
//! Two blocks on either side of a border have different data, and differ there by a little. At every
//! pair of corners of patches all blocks that meet there are averaged; the cells of each block are
//! then shifted by what it differs from these means, linearly in all four angles between corners.
//! That makes the blocks agree at the corners, and leaves between them only what of their difference
//! is not linear along a border.

use super::from_corners::{FromCorners, weights_of};
use super::patches::{Cover, Patch};
use crate::quantile::median;
use rayon::prelude::*;

/// What the pairs of one patch with itself and all later ones give at their corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AtCorners<const N: usize = 3> {
    /// Logarithms, pair by pair: corner by corner of the first patch, corner by corner of the second.
    pub values: Vec<[f32; N]>,
    /// Of each pair, whether its cells follow from its corners.
    pub smooth: Vec<bool>,
}

/// Logarithms at the corners of all pairs of patches, and their means over the pairs that meet.
pub struct Corners<const N: usize = 3> {
    /// Places of the patches' corners: where those of each patch begin, and the end of the last.
    starts: Vec<usize>,
    /// By patch.
    of_patches: Vec<AtCorners<N>>,
    /// Means by pair of corners (v, w), v ≤ w: row v begins at `v n − v (v + 1) / 2`.
    means: Vec<[f32; N]>,
    /// Number of corners.
    n: usize,
    /// By how much a corner may shift a pair.
    limit: f32,
}

impl<const N: usize> Corners<N> {
    /// Averages what all patches of a cover give, in their order.
    pub fn new(cover: &Cover, of_patches: Vec<AtCorners<N>>, least_limit: f32) -> Self {
        let mut starts = vec![0];
        for (k, patch) in cover.patches.iter().enumerate() {
            starts.push(starts[k] + patch.corners.len());
        }
        let n = cover.corners.len();
        let mut corners = Self {
            starts,
            of_patches,
            means: Vec::new(),
            n,
            limit: 0.0,
        };
        let mut patches_at = vec![Vec::new(); n];
        for (number, patch) in cover.patches.iter().enumerate() {
            for (place, corner) in patch.corners.iter().enumerate() {
                patches_at[*corner as usize].push((number, place));
            }
        }
        let at = &patches_at;
        corners.means = (0..n)
            .into_par_iter()
            .flat_map_iter(|v| {
                let corners = &corners;
                (v..n).map(move |w| corners.mean_over(&at[v], &at[w]))
            })
            .collect();
        let mut differences = corners.some_differences(cover);
        corners.limit = limit_of(&mut differences, least_limit);
        corners
    }

    /// What some thousand pairs of patches differ from the means by.
    fn some_differences(&self, cover: &Cover) -> Vec<f32> {
        let mut differences = Vec::new();
        let patches = &cover.patches;
        let step = (patches.len() * patches.len() / 8000).max(1);
        for number in (0..patches.len() * patches.len()).step_by(step) {
            let (p, q) = (number / patches.len(), number % patches.len());
            if p > q {
                continue;
            }
            let mut own = self.of_pair(p, q).iter();
            for v in &patches[p].corners {
                for (w, own) in patches[q].corners.iter().zip(&mut own) {
                    differences.push(difference(*own, self.mean(*v, *w)));
                }
            }
        }
        differences
    }

    /// Mean over all pairs of patches; both orders of light and view count.
    fn mean_over(&self, first: &[(usize, usize)], second: &[(usize, usize)]) -> [f32; N] {
        let mut sum = [0.0f32; N];
        let mut add = |p: usize, i: usize, q: usize, j: usize| {
            let width = self.starts[q + 1] - self.starts[q];
            let value = self.of_pair(p, q)[i * width + j];
            for c in 0..N {
                sum[c] += value[c];
            }
        };
        let mut count = 0;
        for &(p, i) in first {
            for &(q, j) in second {
                count += 1;
                if p <= q {
                    add(p, i, q, j);
                } else {
                    add(q, j, p, i);
                }
            }
        }
        sum.map(|s| s / count.max(1) as f32)
    }

    /// What patches `p` ≤ `q` gave at their corners.
    fn of_pair(&self, p: usize, q: usize) -> &[[f32; N]] {
        let height = self.starts[p + 1] - self.starts[p];
        let from = height * (self.starts[q] - self.starts[p]);
        &self.of_patches[p].values[from..from + height * (self.starts[q + 1] - self.starts[q])]
    }

    fn mean(&self, v: u32, w: u32) -> [f32; N] {
        let (v, w) = (v.min(w) as usize, v.max(w) as usize);
        self.means[v * self.n - v * (v + 1) / 2 + w]
    }

    /// Whether the cells of patches number `p` ≤ `q` follow from their corners.
    pub fn is_smooth(&self, p: usize, q: usize) -> bool {
        self.of_patches[p].smooth[q - p]
    }

    /// Shifts the cells of patches number `p` ≤ `q`, light by light, towards the means; those of a smooth
    /// pair are written.
    pub fn blend(
        &self,
        cover: &Cover,
        (p, q): (usize, usize),
        logs: &mut Vec<[f32; N]>,
        shifts: &mut Shifts<N>,
    ) {
        self.find_shifts(cover, (p, q), shifts);
        let own = self.of_pair(p, q);
        let smooth = self.is_smooth(p, q);
        let (p, q) = (&cover.patches[p], &cover.patches[q]);
        match weights_of(p, q) {
            Some(weights) if smooth => {
                for (shift, own) in shifts.at_corners.iter_mut().zip(own) {
                    *shift = std::array::from_fn(|c| own[c] + shift[c]);
                }
                let cells = (p.directions.len(), q.directions.len());
                shifts
                    .from_corners
                    .load(&shifts.at_corners, q.corners.len());
                shifts.from_corners.write(weights, cells, logs);
            }
            _ => shifts.apply(p, q, logs),
        }
    }

    /// The mean square, over the cells of patches number `p` ≤ `q`, of what [`Self::blend`] shifts their logarithms by.
    ///
    /// Blocks that are averaged have a mean whose squared error is the mean of theirs less their mean squared difference
    /// from it, exactly: by so much are blended values better than a block's.
    pub fn mean_square_shift(
        &self,
        cover: &Cover,
        (p, q): (usize, usize),
        shifts: &mut Shifts<N>,
    ) -> [f32; N] {
        self.find_shifts(cover, (p, q), shifts);
        let (p, q) = (&cover.patches[p], &cover.patches[q]);
        let cells = p.directions.len() * q.directions.len();
        let mut logs = std::mem::take(&mut shifts.cells);
        logs.clear();
        logs.resize(cells, [0.0; N]);
        shifts.apply(p, q, &mut logs);
        let mut sum = [0.0f32; N];
        for shift in &logs {
            for c in 0..N {
                sum[c] += shift[c] * shift[c];
            }
        }
        shifts.cells = logs;
        sum.map(|s| s / cells.max(1) as f32)
    }

    /// What the pair differs from the means at its corners by.
    fn find_shifts(&self, cover: &Cover, (p, q): (usize, usize), shifts: &mut Shifts<N>) {
        let own = self.of_pair(p, q);
        let (p, q) = (&cover.patches[p], &cover.patches[q]);
        shifts.clear();
        for (i, v) in p.corners.iter().enumerate() {
            for (j, w) in q.corners.iter().enumerate() {
                let own = own[i * q.corners.len() + j];
                shifts.push(own, self.mean(*v, *w), self.limit);
            }
        }
    }
}

/// How much a corner may shift a block, in medians of the differences around.
const MEDIANS: f32 = 3.0;

/// By how much a corner may shift a block: a few times what blocks usually differ by, and `least` in any
/// case. Where neighbours differ by more, the corner lies beyond what one of them knows (a narrow lobe
/// passes), and the values bend more inside of blocks than they jump between them.
pub fn limit_of(differences: &mut [f32], least: f32) -> f32 {
    (MEDIANS * median(differences)).max(least)
}

/// The largest difference in a channel.
pub fn difference<const N: usize>(own: [f32; N], mean: [f32; N]) -> f32 {
    (0..N).fold(0.0f32, |m, c| m.max((mean[c] - own[c]).abs()))
}

/// What a thread adds to cells, and room to work in.
#[derive(Default)]
pub struct Shifts<const N: usize = 3> {
    /// At pairs of corners, corner by corner of the first patch.
    at_corners: Vec<[f32; N]>,
    row: Vec<[f32; N]>,
    cells: Vec<[f32; N]>,
    from_corners: FromCorners<N>,
}

impl<const N: usize> Shifts<N> {
    /// Forgets all corners.
    pub fn clear(&mut self) {
        self.at_corners.clear();
    }

    /// The next pair of corners: shifts `own` to `mean`, but by no more than `limit` in any channel.
    pub fn push(&mut self, own: [f32; N], mean: [f32; N], limit: f32) {
        let shift: [f32; N] = std::array::from_fn(|c| mean[c] - own[c]);
        let largest = difference(own, mean);
        let share = if largest > limit {
            limit / largest
        } else {
            1.0
        };
        self.at_corners.push(shift.map(|s| share * s));
    }

    /// Adds what is linear between the corners of a pair to its cells, light by light.
    pub fn apply(&mut self, p: &Patch, q: &Patch, logs: &mut [[f32; N]]) {
        let width = q.corners.len();
        for (between, logs) in p
            .between
            .iter()
            .zip(logs.chunks_exact_mut(q.directions.len()))
        {
            // At this light, for each corner of the views.
            self.row.clear();
            self.row.resize(width, [0.0; N]);
            for (corner, weight) in between {
                let from = *corner as usize * width;
                let at_corners = &self.at_corners[from..from + width];
                for (sum, shift) in self.row.iter_mut().zip(at_corners) {
                    for c in 0..N {
                        sum[c] += weight * shift[c];
                    }
                }
            }
            for (between, log) in q.between.iter().zip(logs) {
                for (corner, weight) in between {
                    let shift = self.row[*corner as usize];
                    for c in 0..N {
                        log[c] += weight * shift[c];
                    }
                }
            }
        }
    }
}
