//! `gonia fit`: an analytic model fitted to a dense BRDF.

use crate::colours::colours;
use crate::progress::Progress;
use crate::remarks;
use crate::say::outln;
use crate::table;
use anyhow::{Context, Result, bail};
use gonia_brdf::fit::{FitSettings, Loss, StandardFamily};
use gonia_formats::dense::{check_dense_name, read_dense_channels};
use gonia_formats::fit_toml::{FitNote, FittedNumber};
use gonia_formats::material::{
    check_material, check_relative, is_material_name, material_endings, write_material,
};
use gonia_formats::samples::{check_scale, read_samples};
use gonia_formats::{FileError, check_output, check_writable_beside, checksum, is_same_file};
use gonia_pipeline::fit::{
    FitResult, assume_scale, cells_of_dense, cells_of_samples, fit_model, five_digits,
    level_remark, write_fit,
};
use gonia_pipeline::provenance::program;
use gonia_rig::{Channels, Remark, Scale};
use std::path::{Path, PathBuf};

/// Fits a model to a dense BRDF by Levenberg and Marquardt's method from many random starts, all
/// channels at once, and prints its numbers with their standard uncertainties (from how much the
/// residuals vary together over patches of 30 degrees) and its error by stratum.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia fit dense.exr --model sadeghi -o sadeghi.exr\n  gonia fit dense.exr --samples samples.npy --model kurt2\n  gonia fit dense.exr --model principled -o fabric.xml -o fabric.mtlx\n\nMODEL is lambert, ward, ggx, kurt1 to kurt4 (that many lobes, each with its azimuth), or sadeghi:\nthe microcylinder model of two threads, each with two tangents tilted by ±tilt, its reciprocal\nmean; or one of artists' programs, whose numbers mean 1/sr: principled (Disney's, as in Mitsuba),\ngltf or openpbr. Beside FIT.exr stands FIT.fit.toml, which `gonia report` of that folder shows.\n\nWith --samples the model is fitted to their bins. Uncertainties of a fit to the table alone do not\nhold what interpolation does to it: where it smooths a highlight, a lobe is as much too wide."
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
    /// The fitted model as a dense BRDF on the same grid (.exr), or as a material: .mtlx, .xml (Mitsuba), .gltf or .json; may be repeated
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Take a relative BRDF for 1/sr after multiplying it by this factor
    #[arg(long, value_name = "FACTOR")]
    assume_scale: Option<f64>,
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
        self.check_numbers()?;
        self.check_outputs()?;
        let progress = Progress::new();
        let read = progress.stage("reading the dense BRDF", |_| {
            read_dense_channels(&self.dense)
        })?;
        let fitted_to = checksum::of_channels(&read);
        if let Channels::Bands(_) = read.channels {
            remarks::print(&[Remark::new(
                self.dense.display(),
                format_args!(
                    "its {} are fitted as colours (CIE 1931, D65)",
                    read.channels
                ),
                "fit one band alone for its own numbers",
            )]);
        }
        let mut measured = colours(read, &self.dense)?;
        if measured.scale == Scale::Relative && self.assume_scale.is_none() {
            self.output
                .iter()
                .try_for_each(|path| check_relative(path))?;
        }
        let name = self.dense.display().to_string();
        let mut cells = match &self.samples {
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
        if let Some(factor) = self.assume_scale {
            measured = assume_scale(measured, &mut cells, factor).with_context(|| name.clone())?;
        }
        let family = self.model.for_values(measured.scale == Scale::Relative);
        let watch = progress.watch();
        let mut result = fit_model(&measured, &name, &cells, family, &settings, &watch)
            .with_context(|| name.clone())?;
        result.note.dense = Some(fitted_to);
        print_note(&result.note);
        let converged = result.note.converged;
        self.write(result, measured.scale, &progress)?;
        if !converged {
            let names: Vec<String> = self
                .output
                .iter()
                .map(|p| p.display().to_string())
                .collect();
            bail!(
                "{name}: {} did not converge in {} steps; the best so far is {}, marked as such; try more --starts or --iterations",
                self.model,
                self.iterations,
                if names.is_empty() {
                    "printed above".to_owned()
                } else {
                    format!("in {}", names.join(", "))
                }
            );
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<()> {
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
        match self.assume_scale {
            Some(factor) if !(factor > 0.0 && factor.is_finite()) => {
                bail!("--assume-scale {factor}: give a factor above 0")
            }
            _ => Ok(()),
        }
    }

    /// What can be known of the outputs before the work.
    fn check_outputs(&self) -> Result<()> {
        let samples = self.samples.as_deref();
        let inputs: Vec<&Path> = samples.into_iter().chain([&*self.dense]).collect();
        for (k, output) in self.output.iter().enumerate() {
            let others = &self.output[..k];
            if others.iter().any(|other| is_same_file(other, output)) {
                bail!("--output {}: is given twice", output.display());
            }
            if is_material_name(output) {
                check_material(output, &self.model.to_string())?;
            } else {
                let ending = output.extension();
                let is_table = ending.is_none_or(|e| e.eq_ignore_ascii_case("exr"));
                if !is_table || check_dense_name(output).is_err() {
                    return Err(FileError::new(
                        output,
                        "has not the ending of a fit",
                        format_args!("give .exr, {}", material_endings()),
                    )
                    .into());
                }
                if others.iter().any(|other| !is_material_name(other)) {
                    bail!(
                        "--output {}: one table is written; give one .exr",
                        output.display()
                    );
                }
                check_writable_beside(&FitNote::path_beside(output))?;
            }
            check_output(output, &inputs)?;
        }
        Ok(())
    }

    fn write(&self, result: FitResult, scale: Scale, progress: &Progress) -> Result<()> {
        if self.output.is_empty() {
            return Ok(());
        }
        progress.stage("writing the fitted model", |_| {
            let (materials, tables): (Vec<_>, Vec<_>) =
                self.output.iter().partition(|path| is_material_name(path));
            for path in materials {
                write_material(path, &result.note, &program())?;
            }
            match tables.first() {
                Some(path) => write_fit(path, result, scale).map_err(anyhow::Error::from),
                None => Ok(()),
            }
        })
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
