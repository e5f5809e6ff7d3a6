//! Standard errors: of measured cells from the spread inside bins, of all others from the variance
//! of the blocks, calibrated on bins held out.
//!
//! A block's own variance is a guess: it rests on one kernel and on few nodes. How far off it is,
//! is measured on held-out bins, class by class (elevation, brightness, and size of the guess): each class gets
//! the factor with which 95 % of its bins lie within 1.96 standard errors.

use super::Settings;
use super::hold_out::{HoldOut, Prediction};
use super::known::Known;
use super::nodes::SIGMA_PER_MAD;
use crate::bins::{Bin, Bins};
use crate::dense::DenseBrdf;
use crate::direction::{Vec3, dot};
use crate::grid::Grid;
use rayon::prelude::*;

/// Half the width of a 95 % interval, in standard errors of a normal distribution.
pub const Z95: f32 = 1.96;
/// Held-out bins that are predicted, at most.
const TESTS: usize = 12_000;
/// One frame in so many is held out.
const ONE_IN: u32 = 24;
/// Classes by size of the guess, at most, for each part of the domain …
const SIZES: usize = 8;
/// … and bins in one, at least: fewer cannot tell a 95th percentile.
const CLASS_MIN: usize = 100;
/// Elevations above this are a class of their own: views end there, degrees.
const GRAZING_DEG: f64 = 75.0;
/// Standard error of a median of normal values over that of their mean.
const MEDIAN_OVER_MEAN: f32 = 1.2533;
/// So many samples tell their own spread; fewer take the material's.
const COUNT_MIN: u32 = 6;

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
    /// Beyond all measured pairs of elevations, or in a gap of the directions: a guess, however small
    /// its error seems.
    Extrapolated = 3,
}

/// Standard errors of a dense BRDF.
#[derive(Clone, Debug)]
pub struct ErrorBars {
    /// Standard error per channel, in the unit of the values, cell by cell.
    pub standard_error: [Vec<f32>; 3],
    /// An [`Origin`] a cell.
    pub origin: Vec<u8>,
}

impl ErrorBars {
    /// Standard errors as shares of the values they belong to, mean over the channels, cell by cell.
    pub fn relative(&self, values: &DenseBrdf) -> Vec<f32> {
        let planes = values.planes();
        (0..self.origin.len())
            .map(|cell| {
                let of_channel = |c: usize| self.standard_error[c][cell] / planes[c][cell];
                (0..3).map(of_channel).sum::<f32>() / 3.0
            })
            .collect()
    }
}

/// What turns a block's variance into a standard error.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// By [`Calibration::part`]: interior and grazing, each of usual brightness and bright.
    parts: [Classes; 4],
    /// Mean logarithm over the channels above which a value is bright.
    bright: f32,
    noise_variance: f32,
}

#[derive(Clone, Debug, PartialEq)]
struct Classes {
    /// Upper limits of the guessed standard deviation, ascending, of all classes but the last.
    limits: Vec<f32>,
    /// By what the guess is multiplied.
    factors: Vec<f32>,
}

impl Calibration {
    /// Calibrates on bins held out. `None` when too few frames (or clusters of directions) are there
    /// to hold any out.
    pub fn new(known: &Known, settings: &Settings) -> Option<Self> {
        let sets = HoldOut::sets(known.bins());
        let mut predictions = Vec::new();
        for set in 0..sets {
            let set = ONE_IN - 1 - set;
            if let Some(held_out) = HoldOut::new(known, set, ONE_IN, TESTS / sets as usize) {
                predictions.extend(held_out.predict(settings));
            }
        }
        let noise_variance = settings.noise_variance;
        (!predictions.is_empty()).then(|| Self::from_predictions(&predictions, noise_variance))
    }

    /// Calibrates on predictions of bins that took no part in the fit.
    pub fn from_predictions(predictions: &[Prediction], noise_variance: f32) -> Self {
        let mut logs: Vec<f32> = predictions.iter().map(|p| mean(p.log)).collect();
        logs.sort_by(f32::total_cmp);
        // The brightest tenth of all is about half of the bins that a hold-out picks.
        let bright = logs.get(logs.len() / 2).copied().unwrap_or(0.0);
        let mut calibration = Self {
            parts: [(); 4].map(|()| Classes::new(&[], noise_variance)),
            bright,
            noise_variance,
        };
        let all: Vec<&Prediction> = predictions.iter().collect();
        for part in 0..4 {
            let of_part = |p: &&Prediction| {
                let (light, view) = (p.bin.light.map(f64::from), p.bin.view.map(f64::from));
                calibration.part(light, view, p.log) == part
            };
            let own: Vec<&Prediction> = all.iter().copied().filter(of_part).collect();
            let enough = own.len() >= CLASS_MIN;
            calibration.parts[part] =
                Classes::new(if enough { &own } else { &all }, noise_variance);
        }
        calibration
    }

    fn part(&self, light: Vec3, view: Vec3, log: [f32; 3]) -> usize {
        let grazing = light[2].min(view[2]) < GRAZING_DEG.to_radians().cos();
        2 * usize::from(grazing) + usize::from(mean(log) > self.bright)
    }

    /// Standard error of the logarithm, per channel, from a block's logarithm and its variance.
    pub fn standard_error(
        &self,
        light: Vec3,
        view: Vec3,
        log: [f32; 3],
        variance: [f32; 3],
    ) -> [f32; 3] {
        let factor = self.parts[self.part(light, view, log)].factor(size(variance));
        variance.map(|v| factor * v.max(0.0).sqrt())
    }

    /// Standard error of the logarithm of a measured cell: of the median of its samples.
    pub fn of_measured(&self, bin: &Bin) -> [f32; 3] {
        [0, 1, 2].map(|c| {
            let own = SIGMA_PER_MAD * bin.mad[c] / bin.median[c].abs();
            let usual = self.noise_variance.sqrt();
            let sigma = if bin.count >= COUNT_MIN && own.is_finite() {
                own.max(0.3 * usual)
            } else {
                usual
            };
            let of_median = if bin.count > 2 { MEDIAN_OVER_MEAN } else { 1.0 };
            of_median * sigma / (bin.count.max(1) as f32).sqrt()
        })
    }

    /// Whether a held-out bin lies within the 95 % interval of its prediction, the noise of its own
    /// samples included; of the channels that can be told.
    pub fn covers<'a>(&'a self, prediction: &'a Prediction) -> impl Iterator<Item = bool> + 'a {
        let bin = prediction.bin;
        let (light, view) = (bin.light.map(f64::from), bin.view.map(f64::from));
        let error = self.standard_error(light, view, prediction.log, prediction.variance);
        let noise = self.noise_variance / bin.count as f32;
        (0..3).filter_map(move |c| {
            let residual = prediction.residual(c)?;
            Some(residual.powi(2) <= Z95 * Z95 * (error[c] * error[c] + noise))
        })
    }
}

impl Classes {
    fn new(predictions: &[&Prediction], noise_variance: f32) -> Self {
        let mut sorted: Vec<(f32, &Prediction)> =
            predictions.iter().map(|p| (size(p.variance), *p)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let length = sorted.len().div_ceil(SIZES).max(CLASS_MIN);
        let mut limits = Vec::new();
        let mut factors = Vec::new();
        for class in sorted.chunks(length) {
            limits.push(class.last().map_or(0.0, |last| last.0));
            factors.push(factor_of(class, noise_variance));
        }
        limits.pop();
        if factors.is_empty() {
            factors.push(1.0);
        }
        Self { limits, factors }
    }

    fn factor(&self, size: f32) -> f32 {
        let class = self.limits.partition_point(|limit| *limit < size);
        self.factors[class.min(self.factors.len() - 1)]
    }
}

/// The factor with which 95 % of the residuals lie within 1.96 standard errors: of each residual the
/// factor that just reaches it, and of these the 95th percentile.
fn factor_of(class: &[(f32, &Prediction)], noise_variance: f32) -> f32 {
    let mut needed: Vec<f32> = class
        .iter()
        .flat_map(|(_, p)| {
            (0..3).filter_map(|c| {
                let beyond_noise =
                    (p.residual(c)? / Z95).powi(2) - noise_variance / p.bin.count as f32;
                Some((beyond_noise.max(0.0) / p.variance[c].max(1e-12)).sqrt())
            })
        })
        .collect();
    needed.sort_by(f32::total_cmp);
    let rank = (0.95 * needed.len() as f32) as usize;
    needed
        .get(rank.min(needed.len().saturating_sub(1)))
        .copied()
        .unwrap_or(1.0)
}

fn size(variance: [f32; 3]) -> f32 {
    variance.iter().map(|v| v.max(0.0)).sum::<f32>().sqrt()
}

fn mean(log: [f32; 3]) -> f32 {
    log.iter().sum::<f32>() / 3.0
}

/// Which cells are beyond all that was measured: beyond the pairs of elevations (for each elevation of
/// one direction, the highest of the other), or in a gap of the directions.
pub(super) struct Reach {
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
    pub(super) fn new(bins: &Bins) -> Self {
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

    pub(super) fn origin(&self, light: usize, view: usize) -> Origin {
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
    let known: Vec<Vec3> = (0..measured.len())
        .filter(|d| measured[*d])
        .map(vector)
        .collect();
    let closest = GAP_DEG.to_radians().cos();
    (0..measured.len())
        .into_par_iter()
        .map(|d| {
            let here = vector(d);
            measured[d] || known.iter().any(|k| dot(*k, here) >= closest)
        })
        .collect()
}

/// Writes the cells with samples, and their mirrors, over what the blocks gave.
pub(super) fn write_measured(
    bars: &mut ErrorBars,
    bins: &Bins,
    calibration: &Calibration,
    values: &[Vec<f32>; 3],
) {
    let grid: Grid = bins.grid();
    for (origin, mirrored) in [(Origin::Reciprocal, true), (Origin::Measured, false)] {
        for bin in bins.bins() {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            let cell = if mirrored {
                grid.cell(view, light)
            } else {
                bin.cell as usize
            };
            bars.origin[cell] = origin as u8;
            let error = calibration.of_measured(bin);
            for c in 0..3 {
                bars.standard_error[c][cell] = error[c] * values[c][cell];
            }
        }
    }
}
