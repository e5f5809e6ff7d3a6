//! An isotropic fit on every cell of a grid: a table of three angles, which cells of all azimuths share.

use super::ScatteredFit;
use super::local::{Local, Predicted};
use super::places::{distance2, radius_of};
use super::planes::{of_all, planes_of};
use crate::dense::DenseBrdf;
use crate::direction::Direction;
use crate::grid::Grid;
use crate::interpolate::coordinates::Pair;
use crate::symmetry::Symmetry;
use rayon::prelude::*;
use std::ops::Range;

/// Cells whose middle is within this share of the radius of a neighbourhood of each other share the system.
const SHARED: f64 = 0.5;
/// Quarters of the neighbours of one place that a system of many has.
const NEIGHBOURS: usize = 6;
/// Side of the blocks that the table begins with, cells.
const BLOCK: usize = 16;

/// A part of the table: rows of light and of view, and differences of azimuth.
#[derive(Clone, Copy)]
struct Part {
    start: [usize; 3],
    end: [usize; 3],
}

/// Values of an isotropic BRDF by polar angles and the difference of azimuths.
pub(super) struct Table<const N: usize> {
    grid: Grid,
    cells: Vec<Predicted<N>>,
}

impl<const N: usize> ScatteredFit<N> {
    /// [`Self::dense`] of a fit with the symmetry [`Turns`](crate::Symmetry::Turns) or
    /// [`Isotropic`](crate::Symmetry::Isotropic).
    pub(super) fn dense_by_table(
        &self,
        grid: Grid,
        with_errors: bool,
    ) -> (DenseBrdf<N>, Option<[Vec<f32>; N]>) {
        let table = Table::new(self, grid, with_errors);
        let factor = self.choice.error_factor;
        let (all, channels) = (0..grid.n_theta(), self.channels());
        let values = table.spread(all.clone(), channels, |p, c| p.value[c]);
        let error = |p: &Predicted<N>, c: usize| factor * p.relative[c] * p.value[c];
        let errors = with_errors.then(|| of_all(table.spread(all, channels, error)));
        (DenseBrdf::from_planes(grid, of_all(values)), errors)
    }
}

impl<const N: usize> Table<N> {
    pub fn new(fit: &ScatteredFit<N>, grid: Grid, with_errors: bool) -> Self {
        let size = [grid.n_theta(), grid.n_theta(), grid.n_phi()];
        // Where both sides of the plane of incidence are alike, one is fitted.
        let is_mirrored = fit.choice.settings.symmetry == Symmetry::Isotropic;
        let fitted = match is_mirrored {
            true => [size[0], size[1], size[2] / 2 + 1],
            false => size,
        };
        let mut parts = Vec::new();
        for i in (0..fitted[0]).step_by(BLOCK) {
            for v in (0..fitted[1]).step_by(BLOCK) {
                for d in (0..fitted[2]).step_by(BLOCK) {
                    let start = [i, v, d];
                    let end = [0, 1, 2].map(|k| (start[k] + BLOCK).min(fitted[k]));
                    parts.push(Part { start, end });
                }
            }
        }
        let filler = Filler {
            fit,
            grid,
            // What contradicts reciprocity is averaged by its errors.
            with_errors: with_errors || !fit.choice.settings.reciprocal_data,
        };
        let found: Vec<Vec<(usize, Predicted<N>)>> = parts
            .into_par_iter()
            .with_max_len(1)
            .map(|part| {
                let mut out = Vec::new();
                filler.fill(part, &mut out);
                out
            })
            .collect();
        let nothing = Predicted {
            value: [0.0; N],
            relative: [0.0; N],
            noise: [0.0; N],
        };
        let mut cells = vec![nothing; size.iter().product()];
        for (cell, predicted) in found.into_iter().flatten() {
            cells[cell] = predicted;
        }
        if is_mirrored {
            for row in cells.chunks_exact_mut(size[2]) {
                for d in fitted[2]..size[2] {
                    row[d] = row[size[2] - d];
                }
            }
        }
        Self { grid, cells }.reciprocal()
    }

    fn cell(grid: Grid, [i, v, d]: [usize; 3]) -> usize {
        // At a pole azimuths do not differ.
        let d = if i == 0 || v == 0 { 0 } else { d };
        (i * grid.n_theta() + v) * grid.n_phi() + d
    }

    /// Each cell and its reciprocal one as their mean, weighted by certainty.
    fn reciprocal(mut self) -> Self {
        let (n_theta, n_phi) = (self.grid.n_theta(), self.grid.n_phi());
        for i in 0..n_theta {
            for v in 0..n_theta {
                for d in 0..n_phi {
                    let here = Self::cell(self.grid, [i, v, d]);
                    let there = Self::cell(self.grid, [v, i, (n_phi - d) % n_phi]);
                    if !self.cells[there].is_known() {
                        self.cells[there] = self.cells[here];
                    } else if here < there && self.cells[here].is_known() {
                        let mean = super::averaged(&self.cells[here], &self.cells[there]);
                        self.cells[here] = mean;
                        self.cells[there] = mean;
                    }
                }
            }
        }
        self
    }

    /// What is `of` the cells of so many channels, of lights on some rings, a plane a channel.
    pub fn spread(
        &self,
        rings: Range<usize>,
        channels: usize,
        of: impl Fn(&Predicted<N>, usize) -> f64 + Sync,
    ) -> Vec<Vec<f32>> {
        let (grid, n_phi) = (self.grid, self.grid.n_phi());
        let n = grid.n_directions();
        let mut planes = planes_of(grid, rings.len(), channels);
        for (c, plane) in planes.iter_mut().enumerate() {
            let narrow: Vec<f32> = self.cells.iter().map(|p| of(p, c) as f32).collect();
            plane
                .par_chunks_mut(n)
                .enumerate()
                .for_each(|(light, row)| {
                    let (i, phi_i) = (rings.start + light / n_phi, light % n_phi);
                    for (v, ring) in row.chunks_mut(n_phi).enumerate() {
                        let start = Self::cell(grid, [i, v, 0]);
                        let cells = &narrow[start..start + n_phi];
                        if i == 0 || v == 0 {
                            ring.fill(cells[0]);
                        } else {
                            ring[phi_i..].copy_from_slice(&cells[..n_phi - phi_i]);
                            ring[..phi_i].copy_from_slice(&cells[n_phi - phi_i..]);
                        }
                    }
                });
        }
        planes
    }
}

struct Filler<'a, const N: usize> {
    fit: &'a ScatteredFit<N>,
    grid: Grid,
    with_errors: bool,
}

impl<const N: usize> Filler<'_, N> {
    fn place(&self, [i, v, d]: [f64; 3]) -> Pair {
        let step = self.grid.step_deg();
        let light = Direction::from_deg(i * step, 0.0).to_vec3();
        let view = Direction::from_deg(v * step, d * step).to_vec3();
        self.fit.choice.settings.coordinates.pair(light, view)
    }

    /// Appends the cells of a part, each by its number: with one system where the part is small against
    /// the neighbourhood, else half by half.
    fn fill(&self, part: Part, out: &mut Vec<(usize, Predicted<N>)>) {
        let fit = self.fit;
        let settings = &fit.choice.settings;
        if settings.reciprocal_data && part.start[0] >= part.end[1] {
            // These are the same as their reciprocal ones.
            return;
        }
        let longest = (0..3)
            .max_by_key(|k| part.end[*k] - part.start[*k])
            .unwrap_or(0);
        let length = part.end[longest] - part.start[longest];
        let middle = self.place([0, 1, 2].map(|k| 0.5 * (part.start[k] + part.end[k] - 1) as f64));
        let near = fit.places.around(
            middle,
            NEIGHBOURS * settings.neighbours / 4,
            settings,
            |_| true,
        );
        let limit = SHARED * radius_of(&near);
        let corners = (0..8).map(|bits| {
            self.place([0, 1, 2].map(|k| match bits >> k & 1 {
                0 => part.start[k] as f64,
                _ => (part.end[k] - 1) as f64,
            }))
        });
        let reach = corners
            .map(|corner| distance2(&settings.symmetry.aligned(corner, middle), &middle))
            .fold(0.0, f64::max);
        if length > 1 && reach > limit * limit {
            let half = part.start[longest] + length / 2;
            let (mut first, mut second) = (part, part);
            first.end[longest] = half;
            second.start[longest] = half;
            self.fill(first, out);
            self.fill(second, out);
            return;
        }
        let Some(local) = Local::fit(&fit.data, &near, settings) else {
            return;
        };
        let mut work = Vec::new();
        for i in part.start[0]..part.end[0] {
            for v in part.start[1]..part.end[1] {
                for d in part.start[2]..part.end[2] {
                    if d > 0 && (i == 0 || v == 0) {
                        continue;
                    }
                    let place = self.place([i as f64, v as f64, d as f64]);
                    let place = settings.symmetry.aligned(place, middle);
                    out.push((
                        Table::<N>::cell(self.grid, [i, v, d]),
                        local.at_with(&place, self.with_errors, &mut work),
                    ));
                }
            }
        }
    }
}
