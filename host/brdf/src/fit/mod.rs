//! Fits of analytic models to a dense BRDF, or to the bins behind it.
//!
//! The residual of a cell and channel is `ln((f + ε)/(d + ε))` with ε a thousandth of the mean
//! (published comparisons find logarithms the loss that agrees best with what people see; ε keeps
//! the darkest cells from deciding), or the cosine-weighted difference. All channels are fitted at
//! once, from many random starts on few cells; the best of them go on with all.

mod artist;
mod cells;
mod family;
mod least_squares;
mod range;
mod standard;
mod uncertainty;

pub use artist::{AZIMUTH, ArtistModel};
pub use cells::{Cell, draw, draw_measured};
pub use family::{ModelFamily, Parameter, ParameterValues};
pub use range::Range;
pub use standard::{StandardFamily, UnknownFamily};

use crate::elementary::Elementary;
use crate::model::Brdf;
use crate::progress::Progress;
use crate::random::Random;
use least_squares::{Minimum, minimise};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::ControlFlow;

/// What is minimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loss {
    /// Squared differences of logarithms.
    Logarithm,
    /// Squared differences of f cos θi cos θv.
    Cosine,
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// What is minimised.
    pub loss: Loss,
    /// Cells to draw for the last search.
    pub cells: usize,
    /// Random starts.
    pub starts: usize,
    /// Most steps of a search.
    pub iterations: usize,
    /// Seed of cells and starts.
    pub seed: u64,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            loss: Loss::Logarithm,
            cells: 12_000,
            starts: 32,
            iterations: 120,
            seed: 1,
        }
    }
}

/// A fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedModel<F = StandardFamily> {
    /// The kind of model.
    pub family: F,
    /// The values of its parameters, in their canonical form.
    pub values: ParameterValues,
    /// The standard uncertainty of each, in the same order, from how much residuals vary together over
    /// patches of 30°; `None` where the data do not determine the number.
    pub uncertainties: Vec<Option<f64>>,
    /// Root mean square of the residuals over the cells of the fit.
    pub residual_rms: f64,
    /// Whether the search came to its end.
    pub converged: bool,
    /// Steps of the last search.
    pub iterations: usize,
    /// Cells it used.
    pub cells: usize,
    /// How many of the starts that went on ended within one per cent of the best residual.
    pub agreeing_starts: usize,
}

/// Why there is nothing to fit.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum FitError {
    /// No positive value.
    #[error("the BRDF holds no positive value to fit; check that it is a BRDF")]
    NotPositive,
    /// A family does not know its own parameters.
    #[error(
        "the family makes no model of its own parameters; check that their names are the same in both"
    )]
    NoModel,
    /// The caller's progress callback ended the work.
    #[error("cancelled")]
    Cancelled,
}

/// Cells and steps of the first look from each start.
const FIRST_CELLS: usize = 800;
const FIRST_ITERATIONS: usize = 15;
/// Starts that go on from there, and their cells and steps.
const SECOND_STARTS: usize = 4;
const SECOND_CELLS: usize = 2500;
const SECOND_ITERATIONS: usize = 60;

/// Fits a family to cells, as [`draw`] or [`draw_measured`] gives `settings.cells` of them. `progress` is
/// called with the share done, 0 ..= 1, from any thread.
///
/// # Errors
/// No cell with a positive value, or a family without a model.
pub fn fit<F: ModelFamily>(
    cells: &[Cell],
    family: F,
    settings: &FitSettings,
    progress: &Progress<'_>,
) -> Result<FittedModel<F>, FitError> {
    let problem = Problem::new(cells, &family, settings.loss)?;
    let (best, agreeing_starts) = search_from_many_starts(&problem, settings, progress)?;
    let values = family.canonical(problem.named.with(&problem.values(&best.at)));
    let uncertainties = uncertainty::standard(&problem, &values, &[]);
    Ok(FittedModel {
        values,
        uncertainties,
        residual_rms: (best.cost / (3 * cells.len()) as f64).sqrt(),
        converged: best.converged,
        iterations: best.iterations,
        cells: cells.len(),
        agreeing_starts,
        family,
    })
}

/// The best minimum, and how many of the starts that went on ended within one per cent of it.
fn search_from_many_starts(
    problem: &Problem<'_>,
    settings: &FitSettings,
    progress: &Progress<'_>,
) -> Result<(Minimum, usize), FitError> {
    let heard = |share: f64| match progress(share) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(FitError::Cancelled),
    };
    let done = std::sync::atomic::AtomicUsize::new(0);
    let starts: Vec<u64> = (0..settings.starts.max(1) as u64).collect();
    let mut first: Vec<Minimum> = starts
        .par_iter()
        .with_max_len(1)
        .map(|k| {
            let mut random =
                Random::new(settings.seed ^ (k + 1).wrapping_mul(0x2545_f491_4f6c_dd1d));
            let start = problem.to_free(&problem.start(&mut random));
            let found = problem.search(
                start,
                FIRST_CELLS,
                settings.iterations.min(FIRST_ITERATIONS),
            );
            let count = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            heard(0.5 * count as f64 / starts.len() as f64)?;
            Ok(found)
        })
        .collect::<Result<_, _>>()?;
    first.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    first.truncate(SECOND_STARTS);
    let mut second: Vec<Minimum> = first
        .into_par_iter()
        .with_max_len(1)
        .map(|found| {
            problem.search(
                found.at,
                SECOND_CELLS,
                settings.iterations.min(SECOND_ITERATIONS),
            )
        })
        .collect();
    second.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    heard(0.8)?;
    let best_cost = second.first().map_or(f64::INFINITY, |m| m.cost);
    let agreeing_starts = second
        .iter()
        .filter(|m| m.cost.sqrt() <= 1.01 * best_cost.sqrt())
        .count();
    let start = second.swap_remove(0).at;
    let best = problem.search(start, problem.cells.len(), settings.iterations);
    heard(1.0)?;
    Ok((best, agreeing_starts))
}

impl<F: ModelFamily> FittedModel<F> {
    /// The model. `None` only where the values are not those of the family's parameters.
    pub fn model(&self) -> Option<Box<dyn Brdf>> {
        self.family.model(&self.values)
    }
}

/// The standard uncertainties of a fit's numbers where all cells share errors too: each of `shared` gives for every
/// cell of the fit, in the same order, and channel the share by which one standard uncertainty of an error changes the
/// value. The errors are independent of each other. `None` of numbers that the data do not determine.
///
/// # Errors
/// As [`fit`].
pub fn uncertainties_with_shared<F: ModelFamily>(
    fit: &FittedModel<F>,
    cells: &[Cell],
    loss: Loss,
    shared: &[Vec<[f64; 3]>],
) -> Result<Vec<Option<f64>>, FitError> {
    let problem = Problem::new(cells, &fit.family, loss)?;
    let (mut here, mut there) = (Vec::new(), Vec::new());
    problem.residuals(&fit.values, &problem.cells, &mut here);
    let shifts = shared.iter().map(|shares| {
        let mut moved = cells.to_vec();
        for (cell, shares) in moved.iter_mut().zip(shares) {
            for (value, share) in cell.value.iter_mut().zip(shares) {
                *value *= 1.0 + share;
            }
        }
        let off = Problem::new(&moved, &fit.family, loss)?;
        // Measured by the same mean: only the values are others.
        problem.residuals(&fit.values, &off.cells, &mut there);
        Ok(there.iter().zip(&here).map(|(a, b)| a - b).collect())
    });
    let shifts: Vec<Vec<f64>> = shifts.collect::<Result<_, FitError>>()?;
    Ok(uncertainty::standard(&problem, &fit.values, &shifts))
}

/// Cells, and the model they are to be described by.
struct Problem<'a> {
    cells: Vec<&'a Cell>,
    family: &'a dyn ModelFamily,
    parameters: Vec<Parameter>,
    /// Values with the parameters' names.
    named: ParameterValues,
    loss: Loss,
    /// The mean of the values.
    mean: f64,
    /// What amplitudes are multiplied by: an albedo of one where values are 1/sr.
    unit: f64,
}

impl<'a> Problem<'a> {
    fn new(cells: &'a [Cell], family: &'a dyn ModelFamily, loss: Loss) -> Result<Self, FitError> {
        let sum: f64 = cells.iter().flat_map(|cell| cell.value).sum();
        let mean = sum / (3 * cells.len().max(1)) as f64;
        if mean.is_nan() || mean <= 0.0 {
            return Err(FitError::NotPositive);
        }
        let parameters = family.parameters();
        let middles = parameters.iter().map(|p| p.range.at_share(0.5)).collect();
        let named = ParameterValues::new(&parameters, middles).ok_or(FitError::NoModel)?;
        family.model(&named).ok_or(FitError::NoModel)?;
        // Dark and bright cells alternate, so that any first part is a fair sample.
        let half = cells.len().div_ceil(2);
        let (dark, bright) = cells.split_at(half);
        let mut mixed = Vec::with_capacity(cells.len());
        for k in 0..half {
            mixed.push(&dark[k]);
            mixed.extend(bright.get(k));
        }
        Ok(Self {
            cells: mixed,
            family,
            parameters,
            named,
            loss,
            mean,
            unit: mean * PI,
        })
    }

    fn search(&self, start: Vec<f64>, cells: usize, iterations: usize) -> Minimum {
        let cells = &self.cells[..cells.min(self.cells.len())];
        let residuals =
            |free: &[f64], out: &mut Vec<f64>| self.residuals(&self.values(free), cells, out);
        minimise(&residuals, start, iterations)
    }

    fn residuals(&self, values: &[f64], cells: &[&Cell], out: &mut Vec<f64>) {
        out.clear();
        let Some(model) = self.family.model(&self.named.with(values)) else {
            out.push(f64::NAN);
            return;
        };
        let floor = 1e-3 * self.mean;
        for cell in cells {
            let f = model.eval(cell.light, cell.view);
            let cosines = cell.light[2] * cell.view[2] / self.mean;
            out.extend((0..3).map(|c| match self.loss {
                Loss::Logarithm => {
                    ((f[c] + floor) / (cell.value[c].max(0.0) + floor)).natural_log()
                }
                Loss::Cosine => (f[c] - cell.value[c]) * cosines,
            }));
        }
    }

    /// A random place to start from.
    fn start(&self, random: &mut Random) -> ParameterValues {
        let drawn: Vec<f64> = self.parameters.iter().map(|p| p.draw(random)).collect();
        let mut values = self.named.with(&drawn);
        self.family.adjust_start(&mut values, random);
        values
    }

    /// What a parameter's number is in the range's terms.
    fn unit_of(&self, parameter: &Parameter) -> f64 {
        if parameter.is_amplitude {
            self.unit
        } else {
            1.0
        }
    }

    fn values(&self, free: &[f64]) -> Vec<f64> {
        let each = self.parameters.iter().zip(free);
        each.map(|(p, free)| self.unit_of(p) * p.range.of_free(*free))
            .collect()
    }

    /// Free numbers of a start, whose amplitudes are in units of the mean.
    fn to_free(&self, start: &[f64]) -> Vec<f64> {
        let each = self.parameters.iter().zip(start);
        each.map(|(p, value)| p.range.to_free(*value)).collect()
    }
}
