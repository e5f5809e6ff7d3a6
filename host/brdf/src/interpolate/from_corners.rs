//! The cells of a pair of patches from what its block gives at the pair's corners.
//!
//! A coarse block that need not be refined is smooth, and cells lie close, near the pole above all: from
//! the values at some two hundred pairs of corners, which blending needs in any case, follow those of some
//! six hundred cells (and of hundreds of thousands around the pole), for a small part of what it costs
//! to evaluate the block itself. [`FromCorners::largest_difference`] says whether that is enough.

use super::corner_weights::{PAD, Weights};
use super::patches::Patch;
use pulp::{Arch, Simd, WithSimd};

/// The weights of both patches, where it is cheaper to go by corners than to evaluate a block at
/// each cell.
pub fn weights_of<'a>(p: &'a Patch, q: &'a Patch) -> Option<(&'a Weights, &'a Weights)> {
    let corners = p.corners.len() * q.corners.len();
    let cells = p.directions.len() * q.directions.len();
    match (&p.weights, &q.weights) {
        (Some(a), Some(b)) if 3 * corners <= 2 * cells => Some((a, b)),
        _ => None,
    }
}

/// Working memory of one thread.
#[derive(Default)]
pub struct FromCorners<const N: usize = 3> {
    /// Logarithms at the corners: of one corner of the first patch those of the second and of all
    /// channels, padded.
    values: Vec<f32>,
    /// The same in one direction of the first patch.
    row: Vec<f32>,
    /// Of that direction the logarithms of all views, channel by channel, padded.
    cells: Vec<f32>,
    arch: Arch,
}

impl<const N: usize> FromCorners<N> {
    /// Takes the logarithms at all pairs of corners, corner by corner of the first patch.
    pub fn load(&mut self, corners: &[[f32; N]], width: usize) {
        let padded = (N * width).next_multiple_of(PAD);
        self.values.clear();
        for row in corners.chunks_exact(width) {
            let end = self.values.len() + padded;
            self.values.extend(row.iter().flatten());
            self.values.resize(end, 0.0);
        }
    }

    /// Of what was loaded, the logarithms of all cells, light by light; `views` of them a light.
    pub fn write(
        &mut self,
        (p, q): (&Weights, &Weights),
        (lights, views): (usize, usize),
        logs: &mut Vec<[f32; N]>,
    ) {
        logs.clear();
        logs.reserve(lights * views);
        self.cells.resize(N * q.width, 0.0);
        let arch = self.arch;
        arch.dispatch(Write {
            from: self,
            p,
            q,
            lights,
            views,
            logs,
        });
    }

    /// The largest difference of some directly computed cells from what the corners give: of lights and
    /// views every so many, light by light.
    pub fn largest_difference(
        &mut self,
        (p, q): (&Weights, &Weights),
        lights: impl Iterator<Item = usize>,
        views: impl Iterator<Item = usize> + Clone,
        cells: &[[f32; N]],
    ) -> f32 {
        let padded = self.values.len() / p.corners();
        let mut cells = cells.iter();
        let mut largest = 0.0f32;
        for light in lights {
            self.row.clear();
            self.row.resize(padded, 0.0);
            for (corner, values) in self.values.chunks_exact(padded).enumerate() {
                let weight = p.at(corner, light);
                for (sum, value) in self.row.iter_mut().zip(values) {
                    *sum += weight * value;
                }
            }
            for (view, cell) in views.clone().zip(&mut cells) {
                let mut sums = [0.0f32; N];
                for (corner, values) in self.row.chunks_exact(N).take(q.corners()).enumerate() {
                    let weight = q.at(corner, view);
                    for c in 0..N {
                        sums[c] += weight * values[c];
                    }
                }
                for c in 0..N {
                    largest = largest.max((sums[c] - cell[c]).abs());
                }
            }
        }
        largest
    }
}

struct Write<'a, const N: usize> {
    from: &'a mut FromCorners<N>,
    p: &'a Weights,
    q: &'a Weights,
    lights: usize,
    views: usize,
    logs: &'a mut Vec<[f32; N]>,
}

impl<const N: usize> WithSimd for Write<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let FromCorners {
            values, row, cells, ..
        } = self.from;
        let (p, q) = (self.p, self.q);
        let padded = values.len() / p.corners();
        row.resize(padded, 0.0);
        for light in 0..self.lights {
            let (target, _) = S::as_mut_simd_f32s(row);
            for (k, target) in target.iter_mut().enumerate() {
                let mut sum = simd.splat_f32s(0.0);
                for corner in 0..p.corners() {
                    let from = corner * padded + k * S::F32_LANES;
                    let (value, _) = S::as_simd_f32s(&values[from..from + S::F32_LANES]);
                    let weight = simd.splat_f32s(p.at(corner, light));
                    sum = simd.mul_add_e_f32s(weight, value[0], sum);
                }
                *target = sum;
            }
            if N <= FEW {
                rows_of_cells::<S, N>(simd, q, row, 0, N, cells);
            } else {
                let mut first = 0;
                while first < N {
                    rows_of_cells::<S, FEW>(simd, q, row, first.min(N - FEW), N, cells);
                    first += FEW;
                }
            }
            let mut channels = [&cells[..0]; N];
            for (channel, cells) in channels.iter_mut().zip(cells.chunks_exact(q.width)) {
                *channel = &cells[..self.views];
            }
            for view in 0..self.views {
                let mut log = [0.0; N];
                for c in 0..N {
                    log[c] = channels[c][view];
                }
                self.logs.push(log);
            }
        }
    }
}

/// So many channels' sums stay in registers.
const FEW: usize = 4;

/// Of all views the channels `first..first + G` of `n`, from the values at the corners of the views.
#[inline(always)]
fn rows_of_cells<S: Simd, const G: usize>(
    simd: S,
    q: &Weights,
    row: &[f32],
    first: usize,
    n: usize,
    cells: &mut [f32],
) {
    let mut view = 0;
    while view + 2 * S::F32_LANES <= q.width {
        row_of_cells::<S, 2, G>(simd, q, row, view, (first, n), cells);
        view += 2 * S::F32_LANES;
    }
    while view < q.width {
        row_of_cells::<S, 1, G>(simd, q, row, view, (first, n), cells);
        view += S::F32_LANES;
    }
}

/// The same of `R` vectors of views.
#[inline(always)]
fn row_of_cells<S: Simd, const R: usize, const G: usize>(
    simd: S,
    q: &Weights,
    row: &[f32],
    view: usize,
    (first, n): (usize, usize),
    cells: &mut [f32],
) {
    let mut sums = [[simd.splat_f32s(0.0); R]; G];
    for corner in 0..q.corners() {
        let from = corner * q.width + view;
        let (weights, _) = S::as_simd_f32s(&q.by_corner[from..from + R * S::F32_LANES]);
        for c in 0..G {
            let value = simd.splat_f32s(row[n * corner + first + c]);
            for r in 0..R {
                sums[c][r] = simd.mul_add_e_f32s(weights[r], value, sums[c][r]);
            }
        }
    }
    for c in 0..G {
        let from = (first + c) * q.width + view;
        let (target, _) = S::as_mut_simd_f32s(&mut cells[from..from + R * S::F32_LANES]);
        target.copy_from_slice(&sums[c]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::{Vec3, dot};
    use crate::elementary::Elementary;
    use crate::grid::Grid;
    use crate::interpolate::patches::cover;

    /// A function of two directions that is not a polynomial of them.
    fn smooth(light: Vec3, view: Vec3) -> [f32; 3] {
        let x = dot(light, view) + 0.3 * light[0] - 0.2 * view[1] * view[2];
        [x.sine(), (1.5 * x).exponential(), x * x].map(|v| v as f32)
    }

    fn kinked(light: Vec3, view: Vec3) -> [f32; 3] {
        [((light[0] - 0.3).abs() + view[1]) as f32; 3]
    }

    fn table(f: fn(Vec3, Vec3) -> [f32; 3], lights: &[Vec3], views: &[Vec3]) -> Vec<[f32; 3]> {
        let pairs = lights
            .iter()
            .flat_map(|i| views.iter().map(move |v| (*i, *v)));
        pairs.map(|(i, v)| f(i, v)).collect()
    }

    /// The largest error of what the corners give as a share of the function's range there, as found cell by
    /// cell, and as [`FromCorners::largest_difference`] finds it.
    fn errors(f: fn(Vec3, Vec3) -> [f32; 3], p: &Patch, q: &Patch) -> (f32, f32) {
        let weights = weights_of(p, q).unwrap();
        let mut from = FromCorners::default();
        let corners = table(f, &p.corner_vectors, &q.corner_vectors);
        from.load(&corners, q.corners.len());
        let truth = table(f, &p.vectors, &q.vectors);
        let mut cells = Vec::new();
        from.write(weights, (p.vectors.len(), q.vectors.len()), &mut cells);
        let pairs = cells.iter().flatten().zip(truth.iter().flatten());
        let largest = pairs.fold(0.0, |m: f32, (a, b)| m.max((a - b).abs()));
        let (lights, views) = (0..p.vectors.len(), 0..q.vectors.len());
        let found = from.largest_difference(weights, lights, views, &truth);
        let ends = |m: (f32, f32), v: &f32| (m.0.min(*v), m.1.max(*v));
        let (low, high) = truth
            .iter()
            .flatten()
            .fold((f32::INFINITY, f32::NEG_INFINITY), ends);
        (largest / (high - low), found / (high - low))
    }

    #[test]
    fn smooth_functions_follow_from_corners_and_others_are_told() {
        let patches = cover(Grid::PAPER, &[8.0, 4.0]).patches;
        // The cap around the pole, one beside it, and one in the middle.
        for (p, q) in [(0, 3), (3, 100), (100, 100), (100, 250)] {
            let (p, q) = (&patches[p], &patches[q]);
            let (written, found) = errors(smooth, p, q);
            assert!(written < 0.001, "{written}");
            assert!((written - found).abs() < 1e-5, "{written} {found}");
        }
        let crossed = patches.iter().find(|p| {
            let x = |d: &Vec3| d[0] - 0.3;
            p.vectors.iter().any(|d| x(d) > 0.02) && p.vectors.iter().any(|d| x(d) < -0.02)
        });
        let (written, found) = errors(kinked, crossed.unwrap(), &patches[100]);
        assert!(
            written > 0.01 && (written - found).abs() < 1e-5,
            "{written} {found}"
        );
    }

    #[test]
    fn weights_add_up_to_one_and_are_not_made_where_nothing_is_gained() {
        for patch in cover(Grid::PAPER, &[8.0, 4.0]).patches {
            let Some(weights) = patch.weights else {
                continue;
            };
            for place in 0..patch.directions.len() {
                let sum: f32 = (0..weights.corners()).map(|c| weights.at(c, place)).sum();
                assert!((sum - 1.0).abs() < 1e-4, "{sum}");
                let size: f32 = (0..weights.corners())
                    .map(|c| weights.at(c, place).abs())
                    .sum();
                assert!(size < 4.0, "{size}");
            }
        }
        let coarse = cover(Grid::with_step_deg(6.0).unwrap(), &[6.0, 3.0]).patches;
        assert!(coarse[10].weights.is_none());
    }
}
