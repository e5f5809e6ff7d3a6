//! `gonia fit`: an analytic model fitted to a dense BRDF.

use crate::progress::Progress;
use crate::remarks;
use crate::say::outln;
use crate::table;
use anyhow::{Context, Result, bail};
use gonia_brdf::fit::{FitSettings, Loss, StandardFamily};
use gonia_formats::dense::{check_dense_name, read_dense};
use gonia_formats::fit_toml::{FitNote, FittedNumber};
use gonia_formats::samples::{check_scale, read_samples};
use gonia_formats::{check_output, check_writable_beside};
use gonia_pipeline::fit::{
    cells_of_dense, cells_of_samples, fit_model, five_digits, level_remark, write_fit,
};
use gonia_rig::Scale;
use std::path::{Path, PathBuf};

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
    /// The samples behind it, .npy, .npz or .csv: fit to what was measured, not to what was interpolated
    #[arg(long, value_name = "SAMPLES")]
    samples: Option<PathBuf>,
    /// Which model to fit
    #[arg(long, value_name = "MODEL")]
    model: StandardFamily,
    /// The fitted model as a dense BRDF, on the same grid (OpenEXR)
    #[arg(short, long, value_name = "FIT.exr")]
    output: Option<PathBuf>,
    /// What is minimised: differences of logarithms, or of f cosθi cosθv
    #[arg(long, value_enum, default_value = "log")]
    loss: LossArgument,
    /// Cells to fit to: half of them spread evenly, half where it is bright
    #[arg(long, value_name = "N", default_value_t = FitSettings::default().cells)]
    cells: usize,
    /// Random starts
    #[arg(long, value_name = "N", default_value_t = FitSettings::default().starts)]
    starts: usize,
    /// Most steps of a search
    #[arg(long, value_name = "N", default_value_t = FitSettings::default().iterations)]
    iterations: usize,
    /// Seed of cells and starts
    #[arg(long, default_value_t = FitSettings::default().seed)]
    seed: u64,
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum LossArgument {
    Log,
    Cosine,
}

impl Fit {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let settings = FitSettings {
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
        if let Some(output) = &self.output {
            check_dense_name(output)?;
            let samples = self.samples.as_deref();
            let inputs: Vec<&Path> = samples.into_iter().chain([&*self.dense]).collect();
            check_output(output, &inputs)?;
            check_writable_beside(&FitNote::path_beside(output))?;
        }
        let progress = Progress::new();
        let measured = progress.stage("reading the dense BRDF", |_| read_dense(&self.dense))?;
        let name = self.dense.display().to_string();
        let cells = match &self.samples {
            None => cells_of_dense(&measured.brdf, &settings),
            Some(path) => {
                let read = progress.stage("reading samples", |_| read_samples(path))?;
                remarks::print(&read.remarks);
                check_scale(path, read.scale, measured.scale)?;
                let cells = cells_of_samples(&measured.brdf, &read.samples, &settings)
                    .with_context(|| path.display().to_string())?;
                remarks::print(level_remark(&measured.brdf, &cells, path).as_slice());
                cells
            }
        };
        let result = fit_model(
            &measured,
            &name,
            &cells,
            self.model.for_values(measured.scale == Scale::Relative),
            &settings,
            &progress.watch(),
        )
        .with_context(|| name.clone())?;
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
    outln!("\n{}", note.figures);
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
    format!("{}{unit} {uncertainty}{bound}", five_digits(p.value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_their_uncertainty() {
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
