//! Boxes of cells, and values between a few of them: quadratic in all four angles.

use crate::grid::Grid;
use pulp::{Arch, Simd, WithSimd};

/// Cells of a range of polar angles and of azimuths, of light and of view: rows and columns of light, then of view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    pub start: [usize; 4],
    pub end: [usize; 4],
    /// Whether light and view are of one patch, which has both orders of a pair.
    pub is_own: bool,
    /// Whether the values are those of the cells half a turn on, too.
    pub is_turned: bool,
}

impl Cells {
    pub fn length(&self, axis: usize) -> usize {
        self.end[axis] - self.start[axis]
    }

    pub fn count(&self) -> usize {
        (0..4).map(|axis| self.length(axis)).product()
    }

    pub fn middle(&self) -> [f64; 4] {
        [0, 1, 2, 3].map(|axis| self.at(axis, 0.5))
    }

    /// At a share of the way from the first to the last of an axis.
    pub fn at(&self, axis: usize, share: f64) -> f64 {
        self.start[axis] as f64 + share * (self.length(axis) - 1) as f64
    }

    /// The first or the last of an axis by each of four bits.
    pub fn corner(&self, bits: usize) -> [f64; 4] {
        [0, 1, 2, 3].map(|axis| self.at(axis, (bits >> axis & 1) as f64))
    }

    pub fn halves(&self, axis: usize) -> [Cells; 2] {
        let (mut first, mut second) = (*self, *self);
        let half = self.start[axis] + self.length(axis) / 2;
        first.end[axis] = half;
        second.start[axis] = half;
        [first, second]
    }

    /// Numbers of the directions of light (axis 0) or of view (2), `turn` columns on; of the pole that of azimuth 0.
    pub fn directions(&self, axis: usize, grid: Grid, turn: usize) -> Vec<usize> {
        let rows = self.start[axis]..self.end[axis];
        let columns = self.start[axis + 1]..self.end[axis + 1];
        rows.flat_map(|row| columns.clone().map(move |column| (row, column)))
            .map(|(row, column)| match row {
                0 => column,
                _ => row * grid.n_phi() + (column + turn) % grid.n_phi(),
            })
            .collect()
    }

    /// Places along an axis whose values determine the others: at most three.
    pub fn nodes(&self, axis: usize) -> Vec<f64> {
        match self.length(axis) {
            1 => vec![self.at(axis, 0.0)],
            2 => vec![self.at(axis, 0.0), self.at(axis, 1.0)],
            _ => [0.0, 0.5, 1.0].map(|share| self.at(axis, share)).to_vec(),
        }
    }

    /// What the nodes of an axis count at one of its cells.
    fn weights(&self, axis: usize, cell: usize, by: By) -> [f64; 3] {
        let along = (cell - self.start[axis]) as f64;
        match (self.length(axis), by) {
            (1, _) => [1.0, 0.0, 0.0],
            (2, _) => [1.0 - along, along, 0.0],
            (n, By::Nodes) => weights(along / (n - 1) as f64),
            (n, By::Powers) => {
                let t = 2.0 * along / (n - 1) as f64 - 1.0;
                [1.0, t, t * t]
            }
        }
    }
}

/// What determines the values of a box.
#[derive(Clone, Copy, Debug)]
pub(super) enum By {
    /// Those at its nodes.
    Nodes,
    /// On four axes with three nodes each, what the powers 0, 1 and 2 of the place along each of them count, −1 to 1 from
    /// the first to the last.
    Powers,
}

/// What values at 0, ½ and 1 count at `t`.
pub(super) fn weights(t: f64) -> [f64; 3] {
    [
        (2.0 * t - 1.0) * (t - 1.0),
        4.0 * t * (1.0 - t),
        t * (2.0 * t - 1.0),
    ]
}

/// Of four axes with three nodes each, values at the middle, at both ends of each axis through it, and at the corners by
/// their bits …
pub(super) struct Few {
    pub middle: f64,
    pub ends: [[f64; 2]; 4],
    pub corners: [f64; 16],
}

impl Few {
    /// … and of them the quadratic along each axis and all products of axes that these determine: what 81 products of
    /// powers count, those of the last axis next to each other.
    pub fn powers(&self) -> [f64; 81] {
        const STEPS: [usize; 4] = [27, 9, 3, 1];
        let mut powers = [0.0; 81];
        powers[0] = self.middle;
        let (mut slopes, mut bends) = ([0.0; 4], [0.0; 4]);
        for (axis, [first, last]) in self.ends.iter().enumerate() {
            slopes[axis] = 0.5 * (last - first);
            bends[axis] = 0.5 * (last + first) - self.middle;
            powers[STEPS[axis]] = slopes[axis];
            powers[2 * STEPS[axis]] = bends[axis];
        }
        let signs = |bits: usize| [0, 1, 2, 3].map(|axis| (bits >> axis & 1) as f64 * 2.0 - 1.0);
        // What is left at the corners, as sums and differences along each axis: the share of each product of axes.
        let mut products: [f64; 16] = std::array::from_fn(|bits| {
            let along = |axis: usize| slopes[axis] * signs(bits)[axis] + bends[axis];
            self.corners[bits] - self.middle - (0..4).map(along).sum::<f64>()
        });
        for axis in 0..4 {
            for bits in (0..16).filter(|bits| bits >> axis & 1 == 0) {
                let (low, high) = (products[bits], products[bits | 1 << axis]);
                products[bits] = 0.5 * (high + low);
                products[bits | 1 << axis] = 0.5 * (high - low);
            }
        }
        for bits in (0..16usize).filter(|bits| bits.count_ones() > 1) {
            let along = (0..4).filter(|axis| bits >> axis & 1 == 1);
            powers[along.map(|axis| STEPS[axis]).sum::<usize>()] = products[bits];
        }
        for axis in 0..4 {
            for other in (0..4).filter(|other| *other != axis) {
                // What goes with an axis at the corners and not on it goes with the squares of the others.
                powers[STEPS[axis] + 2 * STEPS[other]] = products[1 << axis] / 3.0;
                powers[2 * STEPS[axis] + 2 * STEPS[other]] = products[0] / 6.0;
            }
        }
        powers
    }

    /// The values at all nodes.
    pub fn all(&self, arch: Arch) -> Vec<f64> {
        let cells = Cells {
            start: [0; 4],
            end: [3; 4],
            is_own: false,
            is_turned: false,
        };
        let of = Determined {
            cells: &cells,
            by: By::Powers,
            values: &self.powers(),
        };
        let mut all = Vec::new();
        of.between(arch, &cells, &mut Stages::default(), &mut all);
        all
    }
}

/// Values of a box, and what determines them: numbers of its nodes, or of powers, those of the last axis next to each
/// other.
pub(super) struct Determined<'a> {
    pub cells: &'a Cells,
    pub by: By,
    pub values: &'a [f64],
}

/// Memory for values between nodes.
#[derive(Default)]
pub(super) struct Stages {
    weights: [Vec<[f64; 3]>; 4],
    of_columns: Vec<f64>,
    of_views: Vec<f64>,
    of_rows: Vec<f64>,
}

impl Determined<'_> {
    fn count(&self, axis: usize) -> usize {
        self.cells.length(axis).min(3)
    }

    /// The value at a cell.
    pub fn at(&self, cell: [usize; 4]) -> f64 {
        let counts = [0, 1, 2, 3].map(|axis| self.count(axis));
        let w = [0, 1, 2, 3].map(|axis| self.cells.weights(axis, cell[axis], self.by));
        let mut runs = self.values.chunks_exact(counts[3]);
        let mut total = 0.0;
        for w0 in &w[0][..counts[0]] {
            for w1 in &w[1][..counts[1]] {
                for w2 in &w[2][..counts[2]] {
                    let run = runs.next().unwrap_or_default().iter().zip(&w[3]);
                    total += w0 * w1 * w2 * run.map(|(value, w)| value * w).sum::<f64>();
                }
            }
        }
        total
    }

    /// The values at the cells of a part of the box, view by view and light by light.
    pub fn between(&self, arch: Arch, part: &Cells, stages: &mut Stages, out: &mut Vec<f64>) {
        for (axis, weights) in stages.weights.iter_mut().enumerate() {
            weights.clear();
            let cells = part.start[axis]..part.end[axis];
            weights.extend(cells.map(|cell| self.cells.weights(axis, cell, self.by)));
        }
        let counts = [0, 1, 2, 3].map(|axis| self.count(axis));
        arch.dispatch(Between {
            counts,
            values: self.values,
            stages,
            out,
        });
    }
}

struct Between<'a> {
    counts: [usize; 4],
    values: &'a [f64],
    stages: &'a mut Stages,
    out: &'a mut Vec<f64>,
}

impl WithSimd for Between<'_> {
    type Output = ();

    /// Axis by axis, the last one first: so the largest sums are of the longest runs.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { counts, values, .. } = self;
        let Stages {
            weights,
            of_columns,
            of_views,
            of_rows,
        } = self.stages;
        of_columns.clear();
        for run in values.chunks_exact(counts[3]) {
            let at = |k: usize| run[k.min(counts[3] - 1)];
            let run = [at(0), at(1), at(2)];
            for w in &weights[3] {
                of_columns.push(w[0] * run[0] + w[1] * run[1] + w[2] * run[2]);
            }
        }
        let length = weights[3].len();
        combine(simd, &weights[2], counts[2], length, of_columns, of_views);
        let length = length * weights[2].len();
        combine(simd, &weights[1], counts[1], length, of_views, of_rows);
        let length = length * weights[1].len();
        combine(simd, &weights[0], counts[0], length, of_rows, self.out);
    }
}

/// Of every `count` runs of the values as many sums as there are weights.
#[inline(always)]
fn combine<S: Simd>(
    simd: S,
    weights: &[[f64; 3]],
    count: usize,
    length: usize,
    values: &[f64],
    out: &mut Vec<f64>,
) {
    out.resize(values.len() / count * weights.len(), 0.0);
    let mut sums = out.chunks_exact_mut(length);
    for runs in values.chunks_exact(count * length) {
        let run = |k: usize| &runs[k.min(count - 1) * length..][..length];
        let runs = [run(0), run(1), run(2)];
        for (w, sums) in weights.iter().zip(&mut sums) {
            weighted(simd, *w, runs, sums);
        }
    }
}

#[inline(always)]
fn weighted<S: Simd>(simd: S, w: [f64; 3], runs: [&[f64]; 3], sums: &mut [f64]) {
    let (a, rest_a) = S::as_simd_f64s(runs[0]);
    let (b, rest_b) = S::as_simd_f64s(runs[1]);
    let (c, rest_c) = S::as_simd_f64s(runs[2]);
    let (sums, rest) = S::as_mut_simd_f64s(sums);
    let wide = w.map(|w| simd.splat_f64s(w));
    for (((sum, a), b), c) in sums.iter_mut().zip(a).zip(b).zip(c) {
        let first = simd.add_f64s(simd.mul_f64s(wide[0], *a), simd.mul_f64s(wide[1], *b));
        *sum = simd.add_f64s(first, simd.mul_f64s(wide[2], *c));
    }
    for (((sum, a), b), c) in rest.iter_mut().zip(rest_a).zip(rest_b).zip(rest_c) {
        *sum = w[0] * a + w[1] * b + w[2] * c;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_nodes_determine_what_is_quadratic_and_all_products_of_axes() {
        let value = |t: [f64; 4]| {
            let squares = 0.3 * t[0] * t[0] - 0.2 * t[1] + 0.7 * t[3] * t[3];
            squares + 0.4 * t[0] * t[2] - 0.1 * t[1] * t[2] * t[3] + 0.6 * t[0] * t[1] * t[2] * t[3]
        };
        let end = |axis: usize, t: f64| {
            let mut place = [0.0; 4];
            place[axis] = t;
            value(place)
        };
        let few = Few {
            middle: value([0.0; 4]),
            ends: [0, 1, 2, 3].map(|axis| [end(axis, -1.0), end(axis, 1.0)]),
            corners: std::array::from_fn(|bits| {
                value([0, 1, 2, 3].map(|axis| (bits >> axis & 1) as f64 * 2.0 - 1.0))
            }),
        };
        for (node, found) in few.all(Arch::new()).into_iter().enumerate() {
            let t = [27, 9, 3, 1].map(|step| (node / step % 3) as f64 - 1.0);
            assert!((found - value(t)).abs() < 1e-12, "{t:?}: {found}");
        }
    }

    #[test]
    fn what_is_quadratic_is_met_at_every_cell_of_boxes_of_any_size() {
        for end in [[9, 7, 5, 6], [2, 5, 1, 4], [1, 3, 3, 2], [4, 1, 8, 1]] {
            let cells = Cells {
                start: [0; 4],
                end,
                is_own: false,
                is_turned: false,
            };
            let value = |x: [f64; 4]| {
                let squares = 0.3 * x[0] * x[0] - 0.2 * x[1] * x[2] * x[2] + 0.1 * x[3] * x[3];
                1.0 + squares + x[0] * x[1] * x[2] * x[3]
            };
            let mut values = Vec::new();
            let nodes = [0, 1, 2, 3].map(|axis| cells.nodes(axis));
            for a in &nodes[0] {
                for b in &nodes[1] {
                    for c in &nodes[2] {
                        values.extend(nodes[3].iter().map(|d| value([*a, *b, *c, *d])));
                    }
                }
            }
            let mut part = cells;
            part.start = end.map(|n| n / 3);
            let mut found = Vec::new();
            let of = Determined {
                cells: &cells,
                by: By::Nodes,
                values: &values,
            };
            of.between(Arch::new(), &part, &mut Stages::default(), &mut found);
            let mut found = found.into_iter();
            for a in part.start[0]..end[0] {
                for b in part.start[1]..end[1] {
                    for c in part.start[2]..end[2] {
                        for d in part.start[3]..end[3] {
                            let truth = value([a, b, c, d].map(|x| x as f64));
                            let off = found.next().map(|x| (x - truth).abs());
                            assert!(off < Some(1e-9), "{end:?}: {off:?}");
                            let off = (of.at([a, b, c, d]) - truth).abs();
                            assert!(off < 1e-9, "{end:?}: {off:?}");
                        }
                    }
                }
            }
            assert_eq!(found.next(), None);
        }
    }
}
