//! What methods are tested with, and the figures they get.

use crate::accumulate::{Cell, Sums};
use crate::chart::frames::ChartError;
use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{Bins, Brdf, Direction, Grid};
use gonia_render as render;
use gonia_render::{Picture, color};
use gonia_rig::stratum::{HIGHLIGHT, StratumBits};
use gonia_rig::{DenseFile, Scale, Stratum, StratumFigures, stratum};
use std::collections::{HashMap, HashSet};
use std::sync::Mutex;

/// Side of the rendered sphere, pixels: every one of its 500 lit ones is a cell to interpolate.
const SPHERE_PX: usize = 32;
/// Cells that limits and levels are taken from.
const SCAN_CELLS: usize = 200_000;

/// How many tests of each kind there are to be.
#[derive(Clone, Copy, Debug)]
pub struct TestCounts {
    /// Tests spread over all that is not measured.
    pub spread: usize,
    /// More tests among the highlights, for their own stratum alone.
    pub highlights: usize,
}

/// A value that is known, and the cells that it is compared with.
struct Test {
    light: Vec3,
    view: Vec3,
    truth: [f32; 3],
    strata: StratumBits,
    /// Cells by their number in [`TestSet::cells`], with weights that sum to one.
    corners: Vec<(u32, f32)>,
}

/// Tests and a sphere.
pub struct TestSet {
    grid: Grid,
    tests: Vec<Test>,
    cells: Vec<(u32, u32)>,
    /// Cell by number, for the sphere.
    numbers: HashMap<(u32, u32), u32>,
    sphere: Option<Picture>,
    /// Values times this are the truth's.
    factor: f64,
    /// The truth times this is a reflectance that a colour can be made of.
    level: f32,
    floor: f32,
    basis: String,
}

impl TestSet {
    /// Tests against a dense BRDF, at cells that have neither a bin nor a mirror with one. Samples have
    /// no scale: they get the factor that brings the bins to the truth (median, interior).
    ///
    /// # Errors
    /// A truth of another grid, or without a positive value.
    pub fn of_truth(
        truth: &DenseFile,
        bins: &Bins,
        counts: TestCounts,
    ) -> Result<Self, ChartError> {
        let grid = bins.grid();
        if truth.brdf.grid() != grid {
            let step = truth.brdf.grid().step_deg();
            return Err(ChartError::OtherGrid(step.to_string()));
        }
        let measured: HashSet<usize> = bins
            .bins()
            .iter()
            .flat_map(|bin| {
                let (light, view) = grid.light_and_view(bin.cell as usize);
                [grid.cell(light, view), grid.cell(view, light)]
            })
            .collect();
        let is_missing = |cell: &usize| {
            let (light, view) = grid.light_and_view(*cell);
            let is_once = once(grid, light) == light && once(grid, view) == view;
            is_once && !measured.contains(cell)
        };
        let value = |cell: usize| {
            let (light, view) = grid.light_and_view(cell);
            truth.brdf.at(light, view)
        };
        let weighted = |cell: usize| {
            let (light, view) = grid.light_and_view(cell);
            let z = |d| grid.direction(d).to_vec3()[2] as f32;
            color::luminance(value(cell)) * z(light) * z(view)
        };
        let mut scan: Vec<f32> = spread(grid.n_cells(), SCAN_CELLS).map(weighted).collect();
        let highlight = upper_percentile(&mut scan);

        let n = grid.n_cells();
        // Missing cells are a share of all; ask for as many more.
        let share = (n - measured.len()).max(1) as f64 / n as f64;
        let asked = (counts.spread as f64 / share) as usize;
        let spread_cells: Vec<usize> = spread(n, asked).filter(is_missing).collect();
        let bright: Vec<usize> = spread(n, SCAN_CELLS.max(200 * counts.highlights))
            .filter(|cell| weighted(*cell) >= highlight)
            .filter(is_missing)
            .take(counts.highlights)
            .collect();
        let mut set = Self::empty(grid);
        for (cells, is_extra) in [(&spread_cells, false), (&bright, true)] {
            for cell in cells {
                let (light, view) = grid.light_and_view(*cell);
                let bits = if weighted(*cell) >= highlight {
                    HIGHLIGHT
                } else {
                    0
                };
                let only = if is_extra {
                    HIGHLIGHT
                } else {
                    StratumBits::MAX
                };
                let (l, v) = (grid.direction(light), grid.direction(view));
                set.add(l, v, value(*cell), bits, only, &[(light, view, 1.0)]);
            }
        }
        set.factor = factor_to(truth, bins);
        set.draw_truth(truth);
        set.finish(truth.scale)?;
        set.basis = format!(
            "{} cells without a bin (and {} highlights), of {n}, against the truth; values times {:.4}",
            spread_cells.len(),
            bright.len(),
            set.factor
        );
        Ok(set)
    }

    /// Tests against bins of frames that the methods do not have. They lie between the nodes, so a
    /// method's value is what its table gives there: linear between the nodes, for all alike.
    ///
    /// # Errors
    /// No bin with a positive value.
    pub fn of_validation(bins: &Bins, counts: TestCounts) -> Result<Self, ChartError> {
        let grid = bins.grid();
        let weighted = |bin: &gonia_brdf::Bin| {
            color::luminance(bin.median) * bin.light[2].max(0.0) * bin.view[2].max(0.0)
        };
        let mut all: Vec<f32> = bins.bins().iter().map(weighted).collect();
        let highlight = upper_percentile(&mut all);
        let last_deg = (grid.n_theta() - 1) as f64 * grid.step_deg();
        let mut set = Self::empty(grid);
        let mut highlights_left = counts.highlights;
        let n = bins.bins().len();
        let chosen: HashSet<usize> = spread(n, counts.spread).collect();
        for (k, bin) in bins.bins().iter().enumerate() {
            let is_bright = weighted(bin) >= highlight;
            let is_spread = chosen.contains(&k);
            let (light, view) = (
                Direction::from_vec3(bin.light.map(f64::from)),
                Direction::from_vec3(bin.view.map(f64::from)),
            );
            let is_inside = light.theta_deg().max(view.theta_deg()) <= last_deg;
            if !is_inside || !(is_spread || is_bright && highlights_left > 0) {
                continue;
            }
            let mut corners = Vec::with_capacity(16);
            for (i, wi) in grid.corners(light) {
                for (v, wv) in grid.corners(view) {
                    if wi * wv > 0.0 {
                        corners.push((i, v, (wi * wv) as f32));
                    }
                }
            }
            let bits = if is_bright { HIGHLIGHT } else { 0 };
            let only = if is_spread {
                StratumBits::MAX
            } else {
                HIGHLIGHT
            };
            highlights_left -= usize::from(!is_spread);
            set.add(light, view, bin.median, bits, only, &corners);
        }
        set.finish(Scale::Relative)?;
        set.basis = format!(
            "{} bins of frames left out (cross-validation), at the directions measured, noise included",
            set.tests.len()
        );
        Ok(set)
    }

    fn empty(grid: Grid) -> Self {
        Self {
            grid,
            tests: Vec::new(),
            cells: Vec::new(),
            numbers: HashMap::new(),
            sphere: None,
            factor: 1.0,
            level: std::f32::consts::PI,
            floor: f32::MIN_POSITIVE,
            basis: String::new(),
        }
    }

    /// The grid of the cells.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// What is compared with what, in a line.
    pub fn basis(&self) -> &str {
        &self.basis
    }

    /// The cells whose values are needed, as pairs of direction indices, poles at azimuth 0.
    pub fn cells(&self) -> &[(u32, u32)] {
        &self.cells
    }

    fn number(&mut self, light: usize, view: usize) -> u32 {
        let key = (once(self.grid, light) as u32, once(self.grid, view) as u32);
        *self.numbers.entry(key).or_insert_with(|| {
            self.cells.push(key);
            self.cells.len() as u32 - 1
        })
    }

    fn add(
        &mut self,
        light: Direction,
        view: Direction,
        truth: [f32; 3],
        bits: StratumBits,
        only: StratumBits,
        corners: &[(usize, usize, f32)],
    ) {
        let corners = corners
            .iter()
            .map(|(i, v, w)| (self.number(*i, *v), *w))
            .collect();
        let (l, v) = (light.to_vec3(), view.to_vec3());
        let geometry = stratum::of_geometry(light.theta_deg(), view.theta_deg(), dot(l, v));
        self.tests.push(Test {
            light: l,
            view: v,
            truth,
            strata: (geometry | bits) & only,
            corners,
        });
    }

    /// Draws the true sphere, and asks for its cells.
    fn draw_truth(&mut self, truth: &DenseFile) {
        let seen = Mutex::new(Vec::new());
        let grid = self.grid;
        let picture = draw(&AtNodes {
            grid,
            value: &|light, view| {
                if let Ok(mut seen) = seen.lock() {
                    seen.push((light, view));
                }
                truth.brdf.at(light, view)
            },
        });
        let mut seen = seen.into_inner().unwrap_or_default();
        seen.sort_unstable();
        for (light, view) in seen {
            self.number(light, view);
        }
        self.sphere = Some(picture);
    }

    /// Floor and level, once all tests are there.
    fn finish(&mut self, scale: Scale) -> Result<(), ChartError> {
        let positive = self.tests.iter().flat_map(|t| t.truth).filter(|v| *v > 0.0);
        let (sum, count) = positive.fold((0.0, 0usize), |(sum, count), v| {
            (sum + f64::from(v), count + 1)
        });
        if count == 0 {
            return Err(ChartError::NothingToJudge);
        }
        self.floor = (1e-6 * sum / count as f64) as f32;
        if scale == Scale::Relative {
            let interior: Vec<f32> = self
                .tests
                .iter()
                .filter(|t| t.strata >> (Stratum::Interior as u8) & 1 == 1)
                .map(|t| color::luminance(t.truth))
                .collect();
            let mean = interior.iter().sum::<f32>() / interior.len().max(1) as f32;
            // As `compare` does.
            if mean > 0.0 {
                self.level = 0.2 / mean;
            }
        }
        Ok(())
    }

    /// Figures of the values of [`TestSet::cells`], and the sphere's ΔE00.
    pub(super) fn figures(&self, values: &[[f32; 3]]) -> (Vec<StratumFigures>, Option<f64>) {
        let factor = self.factor as f32;
        let mut sums = Sums::default();
        for test in &self.tests {
            let mut got = [0.0f32; 3];
            for (number, weight) in &test.corners {
                for c in 0..3 {
                    got[c] += factor * weight * values[*number as usize][c];
                }
            }
            let cosines = (test.light[2] * test.view[2]).max(0.0) as f32;
            let seen = |rgb: [f32; 3]| rgb.map(|v| v * self.level);
            let truth = test.truth;
            sums.add(
                test.strata,
                &Cell {
                    log: [0, 1, 2]
                        .map(|c| (got[c].max(self.floor) / truth[c].max(self.floor)).natural_log()),
                    cos_error: [0, 1, 2].map(|c| (got[c] - truth[c]).abs() * cosines),
                    cos_value: (truth[0] + truth[1] + truth[2]) * cosines,
                    reciprocity_a: 0.0,
                    reciprocity_b: 0.0,
                    delta_e: Some(color::delta_e(seen(got), seen(truth))),
                },
            );
        }
        let strata = Stratum::ALL
            .into_iter()
            .filter_map(|stratum| sums.figures(stratum, false))
            .collect();
        let sphere = self.sphere.as_ref().map(|truth| {
            let picture = draw(&AtNodes {
                grid: self.grid,
                value: &|light, view| {
                    let key = (light as u32, view as u32);
                    let number = self.numbers.get(&key).copied().unwrap_or_default();
                    values[number as usize].map(|v| v * factor)
                },
            });
            super::super::compare::picture_delta_e(&picture, truth)
        });
        (strata, sphere)
    }
}

/// The factor that brings bins to the truth: exp of the median of ln(truth/bin) in the interior.
fn factor_to(truth: &DenseFile, bins: &Bins) -> f64 {
    let mut ratios: Vec<f32> = bins
        .bins()
        .iter()
        .step_by(bins.bins().len().div_ceil(SCAN_CELLS).max(1))
        .filter(|bin| bin.light[2].min(bin.view[2]) > 0.26)
        .flat_map(|bin| {
            let at = |d: [f32; 3]| Direction::from_vec3(d.map(f64::from));
            let truth = truth.brdf.lookup(at(bin.light), at(bin.view));
            [0, 1, 2].map(|c| (truth[c] / bin.median[c]).natural_log())
        })
        .filter(|ratio| ratio.is_finite())
        .collect();
    f64::from(gonia_brdf::quantile::median(&mut ratios)).exponential()
}

fn draw(brdf: &dyn Brdf) -> Picture {
    render::sphere(brdf, &render::single(), SPHERE_PX, 1)
}

/// Values of nodes, as a BRDF that is constant around each.
struct AtNodes<'a> {
    grid: Grid,
    value: &'a (dyn Fn(usize, usize) -> [f32; 3] + Sync),
}

impl Brdf for AtNodes<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let last_deg = (self.grid.n_theta() - 1) as f64 * self.grid.step_deg();
        let node = |d: Vec3| {
            let d = Direction::from_vec3(d);
            let nearest = self.grid.nearest(d.theta_deg().min(last_deg), d.phi_deg());
            nearest.unwrap_or_default()
        };
        (self.value)(node(light), node(view)).map(f64::from)
    }
}

/// The direction index that a pole's values are kept at.
fn once(grid: Grid, direction: usize) -> usize {
    if direction < grid.n_phi() {
        0
    } else {
        direction
    }
}

/// About `count` of the numbers below `n`, spread evenly and without a pattern, each once.
fn spread(n: usize, count: usize) -> impl Iterator<Item = usize> {
    // Multiples of the golden section of n, modulo n, are as even as can be; a stride that has no
    // factor in common with n meets no number twice.
    let mut stride = (n as f64 * 0.618_033_988_749_895) as usize;
    while gcd(stride.max(1), n) != 1 {
        stride += 1;
    }
    (0..count.min(n)).map(move |k| (k as u128 * stride as u128 % n as u128) as usize)
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The value that one in a hundred reaches.
fn upper_percentile(values: &mut [f32]) -> f32 {
    if values.is_empty() {
        return f32::INFINITY;
    }
    let rank = values.len() * 99 / 100;
    *values.select_nth_unstable_by(rank, f32::total_cmp).1
}
