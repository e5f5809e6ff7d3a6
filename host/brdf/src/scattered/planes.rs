//! Where the values of a grid go: pairs of patches are worked on one by one, and stored run by run.

use super::quadratic::Cells;
use crate::grid::Grid;
use std::sync::{Mutex, PoisonError};

/// Planes that many threads write to, each row (the views of one direction of light) by one at a time.
pub(super) struct Rows<'a> {
    /// The number of the first.
    first: usize,
    planes: Vec<Vec<Mutex<&'a mut [f32]>>>,
}

impl<'a> Rows<'a> {
    /// Those of planes that begin with the lights of a ring: no other row is stored.
    pub fn of(grid: Grid, ring: usize, planes: &'a mut [Vec<f32>]) -> Self {
        let rows = |plane: &'a mut Vec<f32>| {
            let rows = plane.chunks_mut(grid.n_directions());
            rows.map(Mutex::new).collect()
        };
        Self {
            first: ring * grid.n_phi(),
            planes: planes.iter_mut().map(rows).collect(),
        }
    }

    /// Stores a row of cells at runs of its columns.
    fn put(&self, channel: usize, row: usize, runs: &[Run], cells: &[f32]) {
        let rows = &self.planes[channel];
        let Some(row) = row.checked_sub(self.first).and_then(|row| rows.get(row)) else {
            return;
        };
        // A thread that panicked left whole numbers.
        let mut row = row.lock().unwrap_or_else(PoisonError::into_inner);
        for run in runs {
            row[run.first..][..run.length].copy_from_slice(&cells[run.from..][..run.length]);
        }
    }
}

/// Zeros for all cells of lights on some rings, a plane a channel.
pub(super) fn planes_of(grid: Grid, rings: usize, channels: usize) -> Vec<Vec<f32>> {
    let count = rings * grid.n_phi() * grid.n_directions();
    (0..channels).map(|_| vec![0.0; count]).collect()
}

/// The planes of all channels: of one that stands for all, that one in each.
pub(super) fn of_all<const N: usize>(mut planes: Vec<Vec<f32>>) -> [Vec<f32>; N] {
    planes.resize_with(planes.len().max(1), Vec::new);
    while planes.len() < N {
        planes.push(planes[0].clone());
    }
    let mut planes = planes.into_iter();
    std::array::from_fn(|_| planes.next().unwrap_or_default())
}

/// Directions that follow each other: from which number in the patch, the number of the first, and how many.
struct Run {
    from: usize,
    first: usize,
    length: usize,
}

/// The cells of a pair of patches, light by light, a plane a channel.
#[derive(Default)]
pub(super) struct Block {
    planes: Vec<Vec<f32>>,
    exchanged: Vec<f32>,
}

impl Block {
    /// For a pair of patches.
    pub fn clear(&mut self, pair: &Cells, channels: usize) {
        self.planes.resize(channels, Vec::new());
        for plane in &mut self.planes {
            plane.clear();
            plane.resize(pair.count(), 0.0);
        }
    }

    /// Takes the values of a part of the pair, light by light.
    pub fn put(&mut self, pair: &Cells, part: &Cells, channel: usize, values: &[f64]) {
        let plane = &mut self.planes[channel];
        let width = pair.length(2) * pair.length(3);
        let run = part.length(3);
        let mut rows = values.chunks_exact(run);
        for i in part.start[0]..part.end[0] {
            for phi_i in part.start[1]..part.end[1] {
                let light = (i - pair.start[0]) * pair.length(1) + phi_i - pair.start[1];
                for v in part.start[2]..part.end[2] {
                    let view = (v - pair.start[2]) * pair.length(3) + part.start[3] - pair.start[3];
                    let to = &mut plane[light * width + view..][..run];
                    let values = rows.next().unwrap_or_default();
                    for (to, value) in to.iter_mut().zip(values) {
                        *to = *value as f32;
                    }
                }
            }
        }
    }

    /// Stores the cells, with light and view exchanged the reciprocal ones, and where the symmetry has it, those half a
    /// turn on. Of two that are each other's, the one whose light has the lower number serves for both.
    pub fn store(&mut self, pair: &Cells, grid: Grid, rows: &Rows<'_>) {
        let views = pair.length(2) * pair.length(3);
        let lights = pair.length(0) * pair.length(1);
        let turns: &[usize] = match pair.is_turned {
            true => &[0, grid.n_phi() / 2],
            false => &[0],
        };
        for (c, plane) in self.planes.iter_mut().enumerate() {
            if pair.is_own {
                for light in 0..lights {
                    for view in 0..light {
                        plane[light * views + view] = plane[view * views + light];
                    }
                }
            } else {
                transpose(plane, lights, views, &mut self.exchanged);
            }
            for turn in turns {
                let numbers = [0, 2].map(|axis| pair.directions(axis, grid, *turn));
                let runs = [0, 2].map(|axis| runs(pair, axis, grid, *turn));
                for (light, cells) in numbers[0].iter().zip(plane.chunks_exact(views)) {
                    rows.put(c, *light, &runs[1], cells);
                }
                if !pair.is_own {
                    let columns = self.exchanged.chunks_exact(lights);
                    for (view, cells) in numbers[1].iter().zip(columns) {
                        rows.put(c, *view, &runs[0], cells);
                    }
                }
            }
        }
    }
}

/// Directions of light (axis 0) or of view (2) row by row, `turn` columns on: no run goes beyond the end of a row.
fn runs(pair: &Cells, axis: usize, grid: Grid, turn: usize) -> Vec<Run> {
    let width = pair.length(axis + 1);
    let numbers = pair.directions(axis, grid, turn);
    let mut runs = Vec::with_capacity(pair.length(axis));
    for (row, numbers) in numbers.chunks_exact(width).enumerate() {
        let mut from = row * width;
        for run in numbers.chunk_by(|a, b| a + 1 == *b) {
            let (first, length) = (run[0], run.len());
            runs.push(Run {
                from,
                first,
                length,
            });
            from += length;
        }
    }
    runs
}

/// Side of the squares that are turned over at a time.
const SQUARE: usize = 16;

/// Columns become rows.
fn transpose(from: &[f32], rows: usize, columns: usize, to: &mut Vec<f32>) {
    to.clear();
    to.resize(rows * columns, 0.0);
    for row in (0..rows).step_by(SQUARE) {
        for column in (0..columns).step_by(SQUARE) {
            for r in row..(row + SQUARE).min(rows) {
                for c in column..(column + SQUARE).min(columns) {
                    to[c * rows + r] = from[r * columns + c];
                }
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_goes_to_its_cells_their_reciprocal_ones_and_those_half_a_turn_on() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let pair = |end: [usize; 4], is_own| Cells {
            start: [1, 0, 1, 0],
            end,
            is_own,
            is_turned: true,
        };
        for pair in [pair([3, 3, 2, 6], false), pair([3, 3, 3, 3], true)] {
            let mut planes = planes_of(grid, grid.n_theta(), 1);
            let mut block = Block::default();
            block.clear(&pair, 1);
            let [lights, views] = [0, 2].map(|axis| pair.directions(axis, grid, 0));
            let value = |l: usize, v: usize| (100 * l.min(v) + l.max(v)) as f64;
            for half in pair.halves(0) {
                let lights = half.directions(0, grid, 0);
                let values = lights
                    .iter()
                    .flat_map(|l| views.iter().map(|v| value(*l, *v)));
                block.put(&pair, &half, 0, &values.collect::<Vec<f64>>());
            }
            block.store(&pair, grid, &Rows::of(grid, 0, &mut planes));
            let turned = |d: &usize| d / 12 * 12 + (d + 6) % 12;
            for l in &lights {
                for v in &views {
                    let expected = value(*l, *v) as f32;
                    for (l, v) in [(*l, *v), (turned(l), turned(v))] {
                        assert_eq!(planes[0][grid.cell(l, v)], expected);
                        assert_eq!(planes[0][grid.cell(v, l)], expected);
                    }
                }
            }
        }
    }
}
