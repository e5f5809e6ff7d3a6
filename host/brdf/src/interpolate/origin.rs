//! Where a cell's value comes from: measured, interpolated or extrapolated.

use crate::bins::Bins;
use crate::direction::{Vec3, dot};
use crate::elementary::Elementary;
use crate::grid::Grid;
use rayon::prelude::*;

/// Where a cell's value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Origin {
    /// Samples fell into the cell.
    Measured = 0,
    /// Samples fell into the cell with light and view exchanged.
    Reciprocal = 1,
    /// Between measured directions.
    Interpolated = 2,
    /// Beyond all measured pairs of polar angles, or in a gap of the directions: a guess, however small
    /// its error seems.
    Extrapolated = 3,
}

/// Which cells are beyond all that was measured: beyond the pairs of polar angles (for each of one
/// direction, the largest of the other), or in a gap of the directions.
struct Reach {
    n_phi: usize,
    /// By row of the grid: one more than the highest row measured with this row or a higher one.
    rows: Vec<usize>,
    /// By direction: whether one near it was measured as light, and as view.
    near: [Vec<bool>; 2],
}

/// A direction farther than this from all measured ones lies in a gap: the paper's plan has steps of
/// 15°, and each frame spans some degrees.
const GAP_DEG: f64 = 15.0;

impl Reach {
    fn new(bins: &Bins) -> Self {
        let grid = bins.grid();
        let n_phi = grid.n_phi();
        let mut rows = vec![0; grid.n_theta()];
        let mut measured = [(); 2].map(|()| vec![false; grid.n_directions()]);
        for bin in bins.bins() {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            let (i, v) = (light / n_phi, view / n_phi);
            rows[i] = rows[i].max(v + 1);
            rows[v] = rows[v].max(i + 1);
            measured[0][light] = true;
            measured[1][view] = true;
        }
        for row in (1..rows.len()).rev() {
            rows[row - 1] = rows[row - 1].max(rows[row]);
        }
        let near = measured.map(|measured| near(grid, &measured));
        Self { n_phi, rows, near }
    }

    fn origin(&self, light: usize, view: usize) -> Origin {
        let [lights, views] = &self.near;
        let no_gap = lights[light] && views[view] || lights[view] && views[light];
        if no_gap && view / self.n_phi < self.rows[light / self.n_phi] {
            Origin::Interpolated
        } else {
            Origin::Extrapolated
        }
    }
}

/// The directions within a gap's width of a measured one.
fn near(grid: Grid, measured: &[bool]) -> Vec<bool> {
    let vector = |d: usize| grid.direction(d).to_vec3();
    let measured_at: Vec<Vec3> = (0..measured.len())
        .filter(|d| measured[*d])
        .map(vector)
        .collect();
    let closest = GAP_DEG.to_radians().cosine();
    (0..measured.len())
        .into_par_iter()
        .map(|d| {
            let here = vector(d);
            measured[d] || measured_at.iter().any(|k| dot(*k, here) >= closest)
        })
        .collect()
}

/// Where each cell's value comes from, as an [`Origin`] a cell.
pub fn origins(bins: &Bins) -> Vec<u8> {
    let grid = bins.grid();
    let (reach, n) = (Reach::new(bins), grid.n_directions());
    let mut origins: Vec<u8> = (0..n)
        .into_par_iter()
        .flat_map_iter(|light| {
            let reach = &reach;
            (0..n).map(move |view| reach.origin(light, view) as u8)
        })
        .collect();
    for bin in bins.bins() {
        let (light, view) = grid.light_and_view(bin.cell as usize);
        origins[grid.cell(view, light)] = Origin::Reciprocal as u8;
    }
    for bin in bins.bins() {
        origins[bin.cell as usize] = Origin::Measured as u8;
    }
    origins
}
