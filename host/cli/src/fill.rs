//! `gonia fill`: samples → bins → dense BRDF.

use crate::progress::Progress;
use crate::remarks;
use crate::table;
use anyhow::{Context, Result, bail};
use gonia_brdf::interpolate::{OriginCounts, Preset};
use gonia_formats::check_writable_beside;
use gonia_formats::dense::{write_dense, write_error_bars};
use gonia_formats::samples::read_samples_of_all;
use gonia_pipeline::provenance::Provenance;
use gonia_pipeline::{
    DirectionalAlbedo, FillCounts, FillMethod, FillOptions, Filled, fill, fill_to_file,
};
use gonia_rig::{SampleSet, Scale};
use std::path::{Path, PathBuf};

/// Interpolates samples to every cell of the grid.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia fill samples.npy -o dense.exr\n\nSAMPLES is .npy (float32, N x 7 or N x 8) or .csv with columns theta_i, phi_i, theta_v, phi_v\n(degrees), r, g, b and, if known, frame."
)]
pub struct Fill {
    /// Samples, .npy or .csv; several files of one material count together
    #[arg(required = true)]
    samples: Vec<PathBuf>,
    /// The dense BRDF to write (OpenEXR)
    #[arg(short, long, value_name = "DENSE.exr")]
    output: PathBuf,
    /// Also write the standard error of each cell, and whether it was measured (OpenEXR)
    #[arg(long, value_name = "ERR.exr")]
    error: Option<PathBuf>,
    /// Step of the grid in degrees
    #[arg(long, default_value_t = 2.0, value_name = "DEG")]
    step: f64,
    /// Speed against accuracy: a point of the front
    #[arg(long, value_enum, default_value = "default")]
    preset: PresetArgument,
    /// Size of the blocks that share a factorisation, degrees [default: the preset's]
    #[arg(long, value_name = "DEG")]
    block: Option<f64>,
    /// Data in the neighbourhood of a block [default: the preset's]
    #[arg(long, value_name = "N")]
    nodes: Option<usize>,
    /// Refine a block where finer ones differ from it by more than this many times the samples'
    /// noise; 0 refines all, inf none [default: the preset's, or more where refining would cost too much]
    #[arg(long, value_name = "T")]
    tolerance: Option<f32>,
    /// default, or a method that works cell by cell: paper, nearest, shepard, mls1, mls2,
    /// rbf-KERNEL (core-hours on the 2-degree grid)
    #[arg(long, value_name = "NAME", default_value = "default")]
    method: FillMethod,
    /// What the samples' values are: relative, or absolute (1/sr)
    #[arg(long, value_enum, default_value = "relative")]
    scale: ScaleArgument,
}

/// A preset on the command line.
#[derive(clap::ValueEnum, Clone, Copy)]
enum PresetArgument {
    /// A first look, a few seconds
    Preview,
    /// Two thirds of the work of the default
    Fast,
    /// Accurate to the noise on most materials
    Default,
    /// The last of what is to be gained, at several times the work
    Best,
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum ScaleArgument {
    Relative,
    Absolute,
}

impl From<PresetArgument> for Preset {
    fn from(argument: PresetArgument) -> Self {
        match argument {
            PresetArgument::Preview => Preset::Preview,
            PresetArgument::Fast => Preset::Fast,
            PresetArgument::Default => Preset::Default,
            PresetArgument::Best => Preset::Best,
        }
    }
}

impl From<ScaleArgument> for Scale {
    fn from(argument: ScaleArgument) -> Self {
        match argument {
            ScaleArgument::Relative => Scale::Relative,
            ScaleArgument::Absolute => Scale::Absolute,
        }
    }
}

impl Fill {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let options = FillOptions {
            step_deg: self.step,
            preset: self.preset.into(),
            method: self.method,
            block_deg: self.block,
            nodes: self.nodes,
            tolerance: self.tolerance,
            with_errors: self.error.is_some(),
            ..FillOptions::default()
        };
        let (grid, _) = options.check()?;
        check_writable_beside(&self.output)?;
        if let Some(error) = &self.error {
            check_writable_beside(error)?;
            if *error == self.output {
                bail!(
                    "--error {}: is the output too; give another name",
                    error.display()
                );
            }
        }
        let progress = Progress::new();
        let names = self.names();
        let read = progress.stage("reading samples", |_| read_samples_of_all(&self.samples))?;
        remarks::print(&read.remarks);
        let samples = SampleSet {
            samples: read.samples,
            scale: self.scale.into(),
        };
        let facts = Provenance::from([("samples".to_owned(), names.clone())]);
        let mut rows = if options.fits_memory()? {
            let filled =
                fill(samples, &options, &progress.watch()).with_context(|| names.clone())?;
            self.write(filled, facts, &progress)?
        } else {
            let filled = fill_to_file(samples, &options, &self.output, &facts, &progress.watch())
                .with_context(|| names.clone())?;
            remarks::print(&filled.remarks);
            let mut rows = describe(&filled.counts, &filled.settings);
            rows.extend(origins(&filled.origins));
            rows
        };
        rows.insert(3, ("cells".into(), table::count(grid.n_cells() as u64)));
        rows.push(("written".into(), self.output.display().to_string()));
        for stage in progress.stages() {
            rows.push((stage.name, format!("{:.1} s", stage.seconds)));
        }
        table::print(&rows);
        Ok(())
    }

    /// Writes what was asked for, and describes it.
    fn write(
        &self,
        filled: Filled,
        facts: Provenance,
        progress: &Progress,
    ) -> Result<Vec<(String, String)>> {
        remarks::print(&filled.remarks);
        let mut rows = describe(&filled.counts, &filled.settings);
        rows.extend(origins(&filled.origins));
        rows.push(albedo(&filled.albedo, filled.dense.scale));
        if let FillMethod::Cellwise(_) = self.method {
            rows.extend([
                (
                    "failed, given the nearest value".into(),
                    table::count(filled.counts.failed),
                ),
                (
                    "not positive, raised".into(),
                    table::count(filled.counts.raised),
                ),
            ]);
        }
        let mut file = filled.dense;
        let (grid, scale, error_facts) = (file.brdf.grid(), file.scale, file.provenance.clone());
        file.provenance.extend(facts);
        progress.stage("writing the dense BRDF", |_| {
            write_dense(&self.output, file).map(drop)
        })?;
        if let (Some(path), Some(bars)) = (&self.error, filled.errors) {
            progress.stage("writing the error bars", |_| {
                write_error_bars(path, grid, bars, scale, &error_facts)
            })?;
        }
        Ok(rows)
    }

    /// The files of samples, for people.
    fn names(&self) -> String {
        let name = |path: &PathBuf| Path::display(path).to_string();
        self.samples.iter().map(name).collect::<Vec<_>>().join(" ")
    }
}

/// What became of the samples.
fn describe(counts: &FillCounts, settings: &str) -> Vec<(String, String)> {
    let count = |n: usize| table::count(n as u64);
    vec![
        ("samples binned".to_owned(), count(counts.binned)),
        ("samples outside the grid".into(), count(counts.outside)),
        ("bins filled".into(), count(counts.bins)),
        ("settings".into(), settings.to_owned()),
    ]
}

/// Where the cells' values come from.
fn origins(counts: &OriginCounts) -> [(String, String); 4] {
    let guessed = 100.0 * counts.extrapolated_share();
    let extrapolated = table::count(counts.extrapolated);
    [
        ("cells measured", table::count(counts.measured)),
        ("cells by reciprocity", table::count(counts.reciprocal)),
        ("cells interpolated", table::count(counts.interpolated)),
        (
            "cells extrapolated",
            format!("{extrapolated} ({guessed:.1} %)"),
        ),
    ]
    .map(|(name, text)| (name.to_owned(), text))
}

/// The share of the light that is reflected, in green at three polar angles, and the highest of all.
fn albedo(albedo: &DirectionalAlbedo, scale: Scale) -> (String, String) {
    let [at_0, at_30, at_60] = [0.0, 30.0, 60.0].map(|theta| albedo.at(theta)[1]);
    let relative = match scale {
        Scale::Absolute => "",
        Scale::Relative => " (relative)",
    };
    (
        format!("directional albedo{relative}"),
        format!(
            "{at_0:.3}, {at_30:.3}, {at_60:.3} (G at theta_i 0, 30, 60); highest {:.3} ({} at theta_i {:.0}, phi_i {:.0})",
            albedo.highest,
            albedo.channel_name(),
            albedo.theta_i_deg,
            albedo.phi_i_deg
        ),
    )
}
