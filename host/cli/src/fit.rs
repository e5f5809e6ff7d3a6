//! `gonia fit`: an analytic model fitted to a dense BRDF.

use crate::progress::Progress;
use crate::provenance::of_this_program;
use crate::table;
use anyhow::{Context, Result, bail};
use gonia_brdf::fit::{self, Cell, Family, Loss, Settings};
use gonia_brdf::{Bins, DenseBrdf};
use gonia_formats::check_writable;
use gonia_formats::dense::{read_dense, write_dense};
use gonia_formats::fit_toml::{FitNote, FittedNumber};
use gonia_formats::samples::read_samples;
use gonia_pipeline as evaluate;
use gonia_pipeline::compare::Table;
use gonia_pipeline::{Options, Side};
use gonia_rig::{DenseFile, Figures, Scale};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Fits a model to a dense BRDF by Levenberg and Marquardt's method from many random starts, all
/// channels at once, and prints its numbers with their standard uncertainties (from how much the
/// residuals vary together over patches of 30 degrees) and its error by stratum.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia fit dense.exr --model sadeghi -o sadeghi.exr\n  gonia fit dense.exr --samples samples.npy --model kurt2\n\nMODEL is lambert, ward, ggx, kurt1 to kurt4 (that many lobes, each with its azimuth), or sadeghi:\nthe microcylinder model of two threads, each with two tangents tilted by ±tilt, its reciprocal\nmean. Beside FIT.exr stands FIT.fit.toml, which `gonia report` of that folder shows.\n\nWith --samples the model is fitted to their bins. Uncertainties of a fit to the table alone do not\nhold what interpolation does to it: where it smooths a highlight, a lobe is as much too wide."
)]
pub struct Fit {
    /// The dense BRDF
    dense: PathBuf,
    /// The samples behind it, .npy or .csv: fit to what was measured, not to what was interpolated
    #[arg(long, value_name = "SAMPLES")]
    samples: Option<PathBuf>,
    /// Which model to fit
    #[arg(long, value_name = "MODEL")]
    model: Family,
    /// The fitted model as a dense BRDF, on the same grid (OpenEXR)
    #[arg(short, long, value_name = "FIT.exr")]
    output: Option<PathBuf>,
    /// What is minimised: differences of logarithms, or of f cosθi cosθv
    #[arg(long, value_enum, default_value = "log")]
    loss: LossArgument,
    /// Cells to fit to: half of them spread evenly, half where it is bright
    #[arg(long, value_name = "N", default_value_t = Settings::default().cells)]
    cells: usize,
    /// Random starts
    #[arg(long, value_name = "N", default_value_t = Settings::default().starts)]
    starts: usize,
    /// Most steps of a search
    #[arg(long, value_name = "N", default_value_t = Settings::default().iterations)]
    iterations: usize,
    /// Seed of cells and starts
    #[arg(long, default_value_t = Settings::default().seed)]
    seed: u64,
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum LossArgument {
    Log,
    Cosine,
}

/// A fit with its table and how far that is from what it was fitted to.
pub struct FitResult {
    /// The numbers, with their error.
    pub note: FitNote,
    /// The model on the grid.
    pub dense: DenseBrdf,
}

impl Fit {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let settings = Settings {
            loss: match self.loss {
                LossArgument::Log => Loss::Logarithm,
                LossArgument::Cosine => Loss::Cosine,
            },
            cells: self.cells,
            starts: self.starts,
            iterations: self.iterations,
            seed: self.seed,
        };
        for (name, value, range) in [
            ("--cells", self.cells, 100..=1_000_000),
            ("--starts", self.starts, 1..=10_000),
            ("--iterations", self.iterations, 1..=10_000),
        ] {
            if !range.contains(&value) {
                bail!(
                    "{name} {value}: must lie in {}..={}",
                    range.start(),
                    range.end()
                );
            }
        }
        if let Some(folder) = self.output.as_deref().and_then(Path::parent)
            && !folder.as_os_str().is_empty()
        {
            check_writable(folder)?;
        }
        let mut progress = Progress::new();
        let measured = progress.stage("reading the dense BRDF", |_| read_dense(&self.dense))?;
        let name = self.dense.display().to_string();
        let cells = match &self.samples {
            None => fit::draw(&measured.brdf, settings.cells, settings.seed),
            Some(path) => {
                let samples = progress.stage("reading samples", |_| read_samples(path))?;
                let bins = Bins::new(measured.brdf.grid(), &samples);
                let cells = fit::draw_measured(&bins, settings.cells, settings.seed);
                if cells.is_empty() {
                    bail!(
                        "{}: no sample lies on the grid; give those of {name}",
                        path.display()
                    );
                }
                cells
            }
        };
        let result = fit_model(
            &measured,
            &name,
            &cells,
            self.model,
            &settings,
            &mut progress,
        )?;
        print_note(&result.note);
        let converged = result.note.converged;
        if let Some(path) = &self.output {
            progress.stage("writing the fitted model", |_| {
                write_fit(path, result, measured.scale)
            })?;
        }
        if !converged {
            bail!(
                "{name}: {} did not converge in {} steps; the best so far is {}, marked as such; try more --starts or --iterations",
                self.model,
                self.iterations,
                match &self.output {
                    Some(path) => format!("in {}", path.display()),
                    None => "printed above".to_owned(),
                }
            );
        }
        Ok(())
    }
}

/// Fits a family to cells of a table, or to the bins behind it, and compares it with the table.
pub fn fit_model(
    measured: &DenseFile,
    name: &str,
    cells: &[Cell],
    family: Family,
    settings: &Settings,
    progress: &mut Progress,
) -> Result<FitResult> {
    let family = family.for_values(measured.scale == Scale::Relative);
    let start = Instant::now();
    let fit = progress
        .stage(&format!("fitting {family}"), |tell| {
            fit::fit(cells, family, settings, tell)
        })
        .with_context(|| name.to_owned())?;
    let seconds = start.elapsed().as_secs_f64();
    let model = fit.model().context("the model has no numbers")?;
    let dense = progress.stage(&format!("tabulating {family}"), |_| {
        anyhow::Ok(DenseBrdf::tabulate(measured.brdf.grid(), model.as_ref()))
    })?;
    let figures = progress.stage(&format!("judging {family}"), |_| {
        judge(&dense, &family.to_string(), measured, name)
    })?;
    let note = FitNote::new(&fit, seconds, figures);
    Ok(FitResult { note, dense })
}

/// How far a table is from a measured one, as it is: the fit was made in the measured one's scale.
fn judge(
    dense: &DenseBrdf,
    name: &str,
    measured: &DenseFile,
    measured_name: &str,
) -> Result<Figures> {
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
    Ok(evaluate::compare(absolute(dense), other, &options)?)
}

/// Writes the table, and the note beside it.
pub fn write_fit(path: &Path, result: FitResult, scale: Scale) -> Result<()> {
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
        .map(|p| format!("{} {}", p.name, significant(p.value)))
        .collect();
    provenance.insert("fit_parameters".into(), numbers.join(", "));
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

fn print_note(note: &FitNote) {
    let mut rows = vec![(
        "model".to_owned(),
        format!(
            "{}, {} cells, residual RMS {:.4}, {}, {}",
            note.model,
            table::count(note.cells),
            note.residual_rms,
            if note.converged {
                "converged"
            } else {
                "NOT CONVERGED: the best so far"
            },
            table::duration(note.seconds)
        ),
    )];
    rows.extend(
        note.parameters
            .iter()
            .map(|p| (p.name.clone(), value_text(p))),
    );
    table::print(&rows);
    println!("\n{}", note.figures);
}

/// A fitted number as people read it.
fn value_text(p: &FittedNumber) -> String {
    let uncertainty = match p.uncertainty {
        Some(u) => format!("± {u:.1e}"),
        None => "not determined".to_owned(),
    };
    let unit = if p.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", p.unit)
    };
    let bound = if p.at_bound { ", at its bound" } else { "" };
    format!("{}{unit} {uncertainty}{bound}", significant(p.value))
}

/// Five significant digits.
fn significant(value: f64) -> String {
    let digits = 4 - value.abs().max(1e-9).log10().floor() as i32;
    format!("{value:.*}", digits.clamp(0, 8) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_five_digits_and_their_uncertainty() {
        for (value, text) in [
            (0.140_004_9, "0.14000"),
            (113.0109, "113.01"),
            (0.0, "0.00000000"),
        ] {
            assert_eq!(significant(value), text);
        }
        let mut p = FittedNumber {
            name: "tilt1".into(),
            value: 25.0,
            uncertainty: Some(0.0123),
            unit: "deg".into(),
            at_bound: false,
        };
        assert_eq!(value_text(&p), "25.000 deg ± 1.2e-2");
        p.uncertainty = None;
        p.at_bound = true;
        assert_eq!(value_text(&p), "25.000 deg not determined, at its bound");
    }
}
