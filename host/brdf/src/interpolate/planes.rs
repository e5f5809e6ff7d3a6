//! Planes of cells, a plane a channel, which many threads write to pair by pair of patches.

use super::patches::Patch;
use crate::grid::Grid;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Values of all cells, a plane a channel.
pub(super) type Planes<const N: usize> = [Vec<f32>; N];

/// Planes that many threads write to, each cell once. Relaxed atomic stores are plain stores, and
/// spare an argument about which thread owns which row.
pub(super) struct SharedPlanes<const N: usize>([Vec<AtomicU32>; N]);

impl<const N: usize> SharedPlanes<N> {
    pub(super) fn new(length: usize) -> Self {
        let plane = || (0..length).into_par_iter().map(|_| AtomicU32::new(0));
        Self(std::array::from_fn(|_| plane().collect()))
    }

    /// Stores the cells of a pair, light by light.
    pub(super) fn store(&self, grid: Grid, (p, q): (&Patch, &Patch), cells: &[[f32; N]]) {
        let width = q.directions.len();
        for (light, row) in p.directions.iter().zip(cells.chunks_exact(width)) {
            for (first, view, length) in runs(q) {
                let cells = &row[first..first + length];
                self.store_run(grid.cell(*light as usize, view), cells.iter());
            }
        }
    }

    /// What [`Self::store`] stored.
    pub(super) fn load(&self, grid: Grid, (p, q): (&Patch, &Patch), cells: &mut Vec<[f32; N]>) {
        cells.clear();
        for light in &p.directions {
            for (_, view, length) in runs(q) {
                let from = grid.cell(*light as usize, view);
                let planes: [&[AtomicU32]; N] =
                    std::array::from_fn(|c| &self.0[c][from..from + length]);
                cells.extend(
                    (0..length).map(|k| planes.map(|p| f32::from_bits(p[k].load(Relaxed)))),
                );
            }
        }
    }

    /// Stores the cells of a pair and their mirror images. Within one patch both orders of a pair are
    /// there; the first serves for both.
    pub(super) fn store_both(&self, grid: Grid, (p, q): (&Patch, &Patch), cells: &[[f32; N]]) {
        self.store(grid, (p, q), cells);
        let (same, width) = (std::ptr::eq(p, q), q.directions.len());
        for (b, view) in q.directions.iter().enumerate() {
            for (first, light, length) in runs(p) {
                let length = if same {
                    length.min((b + 1).saturating_sub(first))
                } else {
                    length
                };
                let column = cells.iter().skip(first * width + b).step_by(width);
                self.store_run(grid.cell(*view as usize, light), column.take(length));
            }
        }
    }

    /// Stores cells that follow each other.
    fn store_run<'a>(&self, from: usize, cells: impl ExactSizeIterator<Item = &'a [f32; N]>) {
        let planes: [&[AtomicU32]; N] =
            std::array::from_fn(|c| &self.0[c][from..from + cells.len()]);
        for (k, cell) in cells.enumerate() {
            for c in 0..N {
                planes[c][k].store(cell[c].to_bits(), Relaxed);
            }
        }
    }

    pub(super) fn into_planes(self, grid: Grid) -> Planes<N> {
        self.0.map(|plane| {
            // Same size and alignment: the vector is reused in place.
            let mut plane: Vec<f32> = plane
                .into_iter()
                .map(|bits| f32::from_bits(bits.into_inner()))
                .collect();
            spread_poles(grid, true, &mut plane);
            plane
        })
    }
}

/// Directions of a patch that follow each other: where the first stands in the patch, its number, and how
/// many they are.
fn runs(patch: &Patch) -> impl Iterator<Item = (usize, usize, usize)> {
    let mut first = 0;
    patch
        .directions
        .chunk_by(|a, b| a + 1 == *b)
        .map(move |run| {
            let place = first;
            first += run.len();
            (place, run[0] as usize, run.len())
        })
}

/// Copies the pole's value, computed at azimuth 0, to all azimuths, for view and, where the plane begins with it, for light.
pub(crate) fn spread_poles(grid: Grid, has_pole_of_light: bool, plane: &mut [f32]) {
    if plane.is_empty() {
        return;
    }
    let (n, n_phi) = (grid.n_directions(), grid.n_phi());
    for row in plane.chunks_exact_mut(n) {
        let pole = row[0];
        row[1..n_phi].fill(pole);
    }
    let rows = if has_pole_of_light { n_phi } else { 0 };
    for row in 1..rows {
        plane.copy_within(0..n, row * n);
    }
}
