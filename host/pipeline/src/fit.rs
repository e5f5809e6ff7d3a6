//! A model's parameters from a dense BRDF, or from the samples behind it.

use crate::Error;
use crate::budget::{budget_in, shared_errors};
use crate::compare::{Options, Side, Table, compare};
use crate::progress::{Progress, Step, step};
use crate::provenance::{SCALE_ASSUMED, of_this_program, scale_assumed};
use gonia_brdf::Elementary;
use gonia_brdf::fit::{self, Cell, FitSettings, ModelFamily};
use gonia_brdf::{Bins, DenseBrdf, Direction, Sample};
use gonia_formats::checksum;
use gonia_formats::dense::write_dense;
use gonia_formats::fit_toml::FitNote;
use gonia_rig::{DenseFile, Figures, Remark, Scale};
use std::fmt::Display;
use std::path::Path;
use std::time::Instant;

/// A fitted model, tabulated, with its parameters and how far it is from what it was fitted to.
#[derive(Clone, Debug)]
pub struct FitResult {
    /// Parameters with their standard uncertainties, and the error by stratum.
    pub note: FitNote,
    /// The model on the grid of the dense BRDF.
    pub dense: DenseBrdf,
    /// By what factor its values are 1/sr, where somebody said so.
    pub scale_assumed: Option<String>,
}

/// Cells to fit to: of the dense BRDF itself, half of them spread evenly and half where it is bright.
pub fn cells_of_dense(dense: &DenseBrdf, settings: &FitSettings) -> Vec<Cell> {
    fit::draw(dense, settings.cells, settings.seed)
}

/// Cells to fit to: the bins of samples on the grid of a dense BRDF, as they were measured.
///
/// # Errors
/// No sample lies on the grid.
pub fn cells_of_samples(
    dense: &DenseBrdf,
    samples: &[Sample],
    settings: &FitSettings,
) -> Result<Vec<Cell>, Error> {
    let bins = Bins::new(dense.grid(), samples);
    let cells = fit::draw_measured(&bins, settings.cells, settings.seed);
    if cells.is_empty() {
        return Err(Error::NoSampleOnGrid);
    }
    Ok(cells)
}

/// Levels of samples and of the dense BRDF behind which they are may differ by this factor: interpolation
/// smooths highlights, and noise does not move a median.
const LEVEL_MAX: f64 = 1.25;
/// Beyond this polar angle a table is mostly extrapolated, degrees.
const LEVEL_THETA_MAX_DEG: f64 = 75.0;

/// What speaks against measured cells being those behind a dense BRDF: another level.
pub fn level_remark(dense: &DenseBrdf, cells: &[Cell], samples: &Path) -> Option<Remark> {
    let mut logs: Vec<f64> = cells
        .iter()
        .filter_map(|cell| {
            let [light, view] = [cell.light, cell.view].map(Direction::from_vec3);
            let is_near = |d: Direction| d.theta_deg() <= LEVEL_THETA_MAX_DEG;
            let ratio = cell.value[1] / f64::from(dense.lookup(light, view)[1]);
            (is_near(light) && is_near(view) && ratio > 0.0 && ratio.is_finite())
                .then(|| ratio.natural_log())
        })
        .collect();
    let middle = logs.len() / 2;
    if logs.is_empty() {
        return None;
    }
    let (_, median, _) = logs.select_nth_unstable_by(middle, f64::total_cmp);
    (median.abs() > LEVEL_MAX.natural_log()).then(|| {
        Remark::new(
            samples.display(),
            format_args!(
                "its values are {:.3} times those of the dense BRDF (median): they are not of one measurement or not of one scale",
                median.exponential()
            ),
            "give the samples that it was filled from",
        )
    })
}

/// Fits a model, one of gonia's or of your own, to cells (the uncertainties of its numbers hold what the provenance of
/// `measured` says of its rig: [`budget`](crate::budget)), tabulates it on the grid of `measured` and compares it with that. `name` is
/// what the figures call `measured`.
///
/// # Errors
/// No positive value to fit, or none to compare, or a provenance whose budget is none.
pub fn fit_model<F: ModelFamily + Display>(
    measured: &DenseFile,
    name: &str,
    cells: &[Cell],
    family: F,
    settings: &FitSettings,
    progress: &Progress<'_>,
) -> Result<FitResult, Error> {
    let model_name = family.to_string();
    let start = Instant::now();
    let mut fit = step(progress, Step::FittingModel, |share| {
        fit::fit(cells, family, settings, share).map_err(Error::from)
    })?;
    if let Some(budget) = budget_in(&measured.provenance)? {
        let shared = shared_errors(&measured.brdf, &budget, cells);
        fit.uncertainties = fit::uncertainties_with_shared(&fit, cells, settings.loss, &shared)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let dense = step(progress, Step::Tabulating, |_| {
        // A fit always has as many parameters as its family.
        let model = fit.model().ok_or(fit::FitError::NotPositive)?;
        Ok::<_, Error>(DenseBrdf::tabulate(measured.brdf.grid(), model.as_ref()))
    })?;
    let figures = step(progress, Step::Comparing, |_| {
        against(&dense, &model_name, measured, name)
    })?;
    let mut note = FitNote::new(&fit, seconds, figures);
    note.dense = Some(checksum::of_brdf(&measured.brdf));
    Ok(FitResult {
        note,
        dense,
        scale_assumed: measured.provenance.get(SCALE_ASSUMED).cloned(),
    })
}

/// How far a table is from a measured one, as it is: the fit was made in the measured one's scale.
fn against(
    dense: &DenseBrdf,
    name: &str,
    measured: &DenseFile,
    measured_name: &str,
) -> Result<Figures, Error> {
    let absolute = |brdf| Table {
        brdf,
        scale: Scale::Absolute,
    };
    let options = Options {
        name_a: name,
        name_b: measured_name,
        ..Options::default()
    };
    let other = Side::Table(absolute(&measured.brdf));
    Ok(compare(absolute(dense), other, &options)?)
}

/// Takes a relative BRDF, and the cells of it, for 1/sr after multiplying them; an absolute one stays as it is.
///
/// # Errors
/// As of a table with values that a BRDF cannot have.
pub fn assume_scale(
    measured: DenseFile,
    cells: &mut [Cell],
    factor: f64,
) -> Result<DenseFile, Error> {
    if measured.scale == Scale::Absolute {
        return Ok(measured);
    }
    let DenseFile {
        brdf,
        mut provenance,
        ..
    } = measured;
    let grid = brdf.grid();
    let mut planes = brdf.into_planes();
    for value in planes.iter_mut().flatten() {
        *value = (f64::from(*value) * factor) as f32;
    }
    for value in cells.iter_mut().flat_map(|cell| &mut cell.value) {
        *value *= factor;
    }
    provenance.insert(SCALE_ASSUMED.into(), scale_assumed(factor));
    Ok(DenseFile {
        brdf: DenseBrdf::new(grid, planes).ok_or(Error::UnequalPlanes)?,
        scale: Scale::Absolute,
        provenance,
    })
}

/// Writes the tabulated model, and its note beside it.
///
/// # Errors
/// A file cannot be written.
pub fn write_fit(path: &Path, result: FitResult, scale: Scale) -> Result<(), Error> {
    let note = &result.note;
    let mut provenance = of_this_program();
    let state = if note.converged {
        String::new()
    } else {
        ", NOT CONVERGED: the best so far".to_owned()
    };
    provenance.insert(
        "fit".into(),
        format!("{} fitted to {}{state}", note.model, note.figures.b),
    );
    let numbers: Vec<String> = note
        .parameters
        .iter()
        .map(|p| format!("{} {}", p.name, five_digits(p.value)))
        .collect();
    provenance.insert("fit_parameters".into(), numbers.join(", "));
    let assumed = result.scale_assumed;
    provenance.extend(assumed.map(|text| (SCALE_ASSUMED.to_owned(), text)));
    note.write(&FitNote::path_beside(path))?;
    write_dense(
        path,
        DenseFile {
            brdf: result.dense,
            scale,
            provenance,
        },
    )?;
    Ok(())
}

/// A number with five significant digits.
pub fn five_digits(value: f64) -> String {
    let digits = 4 - value.abs().max(1e-9).decimal_log().floor() as i32;
    format!("{value:.*}", digits.clamp(0, 8) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_five_digits() {
        for (value, text) in [
            (0.140_004_9, "0.14000"),
            (113.0109, "113.01"),
            (0.0, "0.00000000"),
        ] {
            assert_eq!(five_digits(value), text);
        }
    }
}
