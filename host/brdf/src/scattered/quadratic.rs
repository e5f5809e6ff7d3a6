//! Boxes of cells, and values between a few of them: quadratic in all four angles.

use crate::grid::Grid;

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

    /// What the nodes of an axis count at each of the cells of a part of it.
    pub fn weights(&self, axis: usize, part: &Cells) -> Vec<[f64; 3]> {
        let cells = part.start[axis]..part.end[axis];
        cells
            .map(|cell| match self.length(axis) {
                1 => [1.0, 0.0, 0.0],
                2 => {
                    let t = (cell - self.start[axis]) as f64;
                    [1.0 - t, t, 0.0]
                }
                n => weights((cell - self.start[axis]) as f64 / (n - 1) as f64),
            })
            .collect()
    }
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
    /// … and at all 81 nodes by the quadratic along each axis and all products of axes that these determine.
    pub fn all(&self) -> Vec<f64> {
        let mut slopes = [0.0; 4];
        let mut bends = [0.0; 4];
        for (axis, [first, last]) in self.ends.iter().enumerate() {
            slopes[axis] = 0.5 * (last - first);
            bends[axis] = 0.5 * (last + first) - self.middle;
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
        let mut all = Vec::with_capacity(81);
        for node in 0..81usize {
            let t = [27, 9, 3, 1].map(|step| (node / step % 3) as f64 - 1.0);
            let squares = t.map(|t| t * t);
            let planar = squares.iter().sum::<f64>();
            let mut value = self.middle;
            for axis in 0..4 {
                value += slopes[axis] * t[axis] + bends[axis] * squares[axis];
                // What goes with an axis at the corners and not on it goes with the squares of the others.
                value += products[1 << axis] * t[axis] * (planar - squares[axis]) / 3.0;
            }
            let pairs = 0.5 * (planar * planar - planar);
            value += products[0] * pairs / 6.0;
            for bits in (0..16usize).filter(|bits| bits.count_ones() > 1) {
                let along = |axis: usize| if bits >> axis & 1 == 1 { t[axis] } else { 1.0 };
                value += products[bits] * along(0) * along(1) * along(2) * along(3);
            }
            all.push(value);
        }
        all
    }
}

/// Values at the nodes of a box, those of the last axis next to each other.
pub(super) struct Nodes<'a> {
    pub cells: &'a Cells,
    pub values: &'a [f64],
}

impl Nodes<'_> {
    /// Appends the values at the cells of a part of the box, view by view and light by light.
    pub fn between(&self, part: &Cells, out: &mut Vec<f64>) {
        let counts = [0, 1, 2, 3].map(|axis| self.cells.nodes(axis).len());
        let weights = [0, 1, 2, 3].map(|axis| self.cells.weights(axis, part));
        let views = counts[2] * counts[3];
        let mut of_row = vec![0.0; counts[1] * views];
        let mut of_light = vec![0.0; views];
        for row in &weights[0] {
            combine(row, counts[0], self.values, &mut of_row);
            for column in &weights[1] {
                combine(column, counts[1], &of_row, &mut of_light);
                for row in &weights[2] {
                    let mut ends = [0.0; 3];
                    combine(row, counts[2], &of_light, &mut ends[..counts[3]]);
                    let columns = weights[3].iter();
                    out.extend(columns.map(|w| w[0] * ends[0] + w[1] * ends[1] + w[2] * ends[2]));
                }
            }
        }
    }
}

/// The weighted sum of `count` parts of the values.
fn combine(weights: &[f64; 3], count: usize, values: &[f64], out: &mut [f64]) {
    let n = out.len();
    for (k, x) in out.iter_mut().enumerate() {
        *x = weights[0] * values[k];
        for part in 1..count {
            *x += weights[part] * values[part * n + k];
        }
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
        for (node, found) in few.all().into_iter().enumerate() {
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
            let nodes = Nodes {
                cells: &cells,
                values: &values,
            };
            nodes.between(&part, &mut found);
            let mut found = found.into_iter();
            for a in part.start[0]..end[0] {
                for b in part.start[1]..end[1] {
                    for c in part.start[2]..end[2] {
                        for d in part.start[3]..end[3] {
                            let truth = value([a, b, c, d].map(|x| x as f64));
                            let off = found.next().map(|x| (x - truth).abs());
                            assert!(off < Some(1e-9), "{end:?}: {off:?}");
                        }
                    }
                }
            }
            assert_eq!(found.next(), None);
        }
    }
}
