//! `gonia fill`: samples → bins → dense BRDF.

use crate::method::Method;
use crate::progress::Progress;
use crate::provenance::{Provenance, of_this_program};
use crate::table;
use anyhow::{Context, Result, bail};
use gonia_brdf::cellwise::{self, CellSettings};
use gonia_brdf::interpolate::{
    self, ByRows, Calibration, ErrorBars, Known, Origin, Preset, Settings,
};
use gonia_brdf::{Bins, DenseBrdf, Grid, Sample};
use gonia_formats::check_writable;
use gonia_formats::dense::write_error_bars;
use gonia_formats::dense::{write_dense, write_dense_by_rows};
use gonia_formats::samples::read_samples_of_all;
use gonia_rig::{DenseFile, Scale};
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
    #[command(flatten)]
    how: How,
    /// default, or a method that works cell by cell: paper, nearest, shepard, mls1, mls2,
    /// rbf-KERNEL (core-hours on the 2-degree grid)
    #[arg(long, value_name = "NAME", default_value = "default")]
    method: Method,
    /// What the samples' values are: relative, or absolute (1/sr)
    #[arg(long, value_enum, default_value = "relative")]
    scale: ScaleArgument,
}

/// A grid of more cells than this (12 bytes each) is filled row by row, in twice the time.
const CELLS_IN_MEMORY: usize = 150_000_000;

/// How to interpolate.
#[derive(clap::Args, Clone, Copy)]
pub struct How {
    /// Step of the grid in degrees
    #[arg(long, default_value_t = 2.0, value_name = "DEG")]
    pub step: f64,
    /// Speed against accuracy: a point of the front
    #[arg(long, value_enum, default_value = "default")]
    pub preset: PresetArgument,
    /// Size of the blocks that share a factorisation, degrees [default: the preset's]
    #[arg(long, value_name = "DEG")]
    pub block: Option<f64>,
    /// Neighbours a block [default: the preset's]
    #[arg(long, value_name = "N")]
    pub nodes: Option<usize>,
    /// Cut a block in finer ones where they differ by more than this many times the samples'
    /// noise; 0 cuts all, inf none [default: the preset's, or more where cutting would cost too much]
    #[arg(long, value_name = "T")]
    pub tolerance: Option<f32>,
}

/// A preset on the command line.
#[derive(clap::ValueEnum, Clone, Copy)]
pub enum PresetArgument {
    /// A first look, a few seconds
    Preview,
    /// Half the work of the default
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

impl How {
    /// Grid and starting settings; one line when they make no sense.
    pub fn check(&self) -> Result<(Grid, Settings)> {
        let grid = Grid::with_step_deg(self.step).context("--step")?;
        let preset = match self.preset {
            PresetArgument::Preview => Preset::Preview,
            PresetArgument::Fast => Preset::Fast,
            PresetArgument::Default => Preset::Default,
            PresetArgument::Best => Preset::Best,
        }
        .settings();
        let settings = Settings {
            // Blocks of few cells share too little.
            block_deg: self.block.unwrap_or(preset.block_deg.max(2.0 * self.step)),
            nodes: self.nodes.unwrap_or(preset.nodes),
            tolerance: self.tolerance.unwrap_or(preset.tolerance),
            // Who asks for a tolerance gets it.
            budget: self.tolerance.map_or(preset.budget, |_| f32::INFINITY),
            ..preset
        };
        if !(self.step..=45.0).contains(&settings.block_deg) {
            bail!(
                "--block {}: must lie between the step ({}) and 45 degrees",
                settings.block_deg,
                self.step
            );
        }
        if !(8..=1024).contains(&settings.nodes) {
            bail!("--nodes {}: must lie in 8..=1024", settings.nodes);
        }
        if settings.tolerance.is_nan() || settings.tolerance < 0.0 {
            bail!(
                "--tolerance {}: must be 0 or more, or inf",
                settings.tolerance
            );
        }
        Ok((grid, settings))
    }
}

/// What filling gave, beside the values.
pub struct Filled {
    /// The values.
    pub dense: DenseBrdf,
    /// Standard errors, where asked for.
    pub errors: Option<ErrorBars>,
    /// Cells with a sample, by number.
    pub cells: Vec<u32>,
    /// Samples that fell into a bin.
    pub binned: usize,
    /// Samples outside the grid.
    pub outside: usize,
    /// The settings, as chosen for the material.
    pub settings: Settings,
}

/// Bins samples (and drops them), chooses the settings, and interpolates.
pub fn fill(
    samples: Vec<Sample>,
    grid: Grid,
    base: Settings,
    with_errors: bool,
    progress: &mut Progress,
) -> Result<Filled> {
    let total = samples.len();
    let bins = progress.stage("binning", |_| anyhow::Ok(Bins::new(grid, &samples)))?;
    drop(samples);
    let known = progress.stage("sorting", |_| {
        anyhow::Ok(Known::thinned(&bins, base.one_bin_in))
    })?;
    let settings = progress.stage("choosing settings", |_| {
        anyhow::Ok(interpolate::select(&known, base).settings)
    })?;
    let (dense, errors) = if with_errors {
        let calibration = progress.stage("calibrating error bars", |_| {
            Calibration::new(&known, &settings).context(
                "too few frames to calibrate error bars: measure more poses, or leave --error out",
            )
        })?;
        let (dense, errors) = progress.stage("interpolating", |tell| {
            interpolate::fill_with_errors(&known, &settings, &calibration, tell)
        })?;
        (dense, Some(errors))
    } else {
        let dense = progress.stage("interpolating", |tell| {
            interpolate::fill(&known, &settings, tell)
        })?;
        (dense, None)
    };
    Ok(Filled {
        dense,
        errors,
        cells: bins.bins().iter().map(|b| b.cell).collect(),
        binned: total - bins.outside(),
        outside: bins.outside(),
        settings,
    })
}

impl Fill {
    /// The files of samples, for people.
    fn names(&self) -> String {
        let names: Vec<String> = self
            .samples
            .iter()
            .map(|p| p.display().to_string())
            .collect();
        names.join(" ")
    }

    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let (grid, base) = self.how.check()?;
        check_writable(folder_of(&self.output))?;
        if let Some(error) = &self.error {
            check_writable(folder_of(error))?;
            if *error == self.output {
                bail!(
                    "--error {}: is the output too; give another name",
                    error.display()
                );
            }
        }
        if grid.n_cells() > CELLS_IN_MEMORY {
            let alone = "it is filled row by row";
            if self.error.is_some() {
                bail!(
                    "--error: not on a grid of {} degrees, {alone}; leave it out",
                    self.how.step
                );
            }
            if self.method != Method::Default {
                bail!(
                    "--method: not on a grid of {} degrees, {alone}; leave it out",
                    self.how.step
                );
            }
        }
        let mut progress = Progress::new();
        let samples = progress.stage("reading samples", |_| read_samples_of_all(&self.samples))?;
        if let Method::Cellwise(settings) = self.method {
            if self.error.is_some() {
                bail!("--error: only the default method has error bars; leave out --method");
            }
            return self.fill_cellwise(samples, grid, &settings, &mut progress);
        }
        if grid.n_cells() > CELLS_IN_MEMORY {
            return self.fill_by_rows(samples, grid, base, &mut progress);
        }
        let filled = fill(samples, grid, base, self.error.is_some(), &mut progress)
            .with_context(|| self.names())?;
        let scale = self.scale.into();
        let file = DenseFile {
            brdf: filled.dense,
            scale,
            provenance: {
                let mut facts = provenance_of(&filled.settings);
                facts.insert("samples".into(), self.names());
                facts
            },
        };
        progress.stage("writing the dense BRDF", |_| {
            write_dense(&self.output, file).map(drop)
        })?;
        let mut origins = Vec::new();
        if let (Some(path), Some(bars)) = (&self.error, filled.errors) {
            let count = |o: Origin| bars.origin.iter().filter(|k| **k == o as u8).count();
            let counts = [
                ("cells measured", Origin::Measured),
                ("cells by reciprocity", Origin::Reciprocal),
                ("cells interpolated", Origin::Interpolated),
                ("cells extrapolated", Origin::Extrapolated),
            ]
            .map(|(name, origin)| (name.to_owned(), table::count(count(origin) as u64)));
            origins.extend(counts);
            let facts = provenance_of(&filled.settings);
            progress.stage("writing the error bars", |_| {
                write_error_bars(path, grid, bars, scale, &facts)
            })?;
        }
        let mut rows = vec![
            (
                "samples binned".to_owned(),
                table::count(filled.binned as u64),
            ),
            (
                "samples outside the grid".into(),
                table::count(filled.outside as u64),
            ),
            (
                "bins filled".into(),
                table::count(filled.cells.len() as u64),
            ),
            ("cells".into(), table::count(grid.n_cells() as u64)),
        ];
        rows.extend(origins);
        rows.extend([
            ("settings".into(), filled.settings.to_string()),
            ("written".into(), self.output.display().to_string()),
        ]);
        for stage in progress.stages() {
            rows.push((stage.name.clone(), format!("{:.1} s", stage.seconds)));
        }
        table::print(&rows);
        Ok(())
    }
}

impl Fill {
    /// Fills a grid that does not fit memory.
    fn fill_by_rows(
        &self,
        samples: Vec<Sample>,
        grid: Grid,
        base: Settings,
        progress: &mut Progress,
    ) -> Result<()> {
        let total = samples.len();
        let bins = progress.stage("binning", |_| anyhow::Ok(Bins::new(grid, &samples)))?;
        drop(samples);
        let known = progress.stage("sorting", |_| {
            anyhow::Ok(Known::thinned(&bins, base.one_bin_in))
        })?;
        let settings = progress.stage("choosing settings", |_| {
            anyhow::Ok(interpolate::select(&known, base).settings)
        })?;
        let rows = progress
            .stage("fitting", |tell| ByRows::new(&known, &settings, tell))
            .with_context(|| self.names())?;
        let mut facts = provenance_of(&settings);
        facts.insert("samples".into(), self.names());
        let (outside, filled) = (bins.outside(), bins.bins().len());
        progress.stage("interpolating and writing", |tell| {
            write_dense_by_rows(&self.output, grid, &rows, self.scale.into(), &facts, tell)
        })?;
        let mut lines = vec![
            (
                "samples binned".to_owned(),
                table::count((total - outside) as u64),
            ),
            (
                "samples outside the grid".into(),
                table::count(outside as u64),
            ),
            ("bins filled".into(), table::count(filled as u64)),
            ("cells".into(), table::count(grid.n_cells() as u64)),
            ("settings".into(), settings.to_string()),
            ("written".into(), self.output.display().to_string()),
        ];
        for stage in progress.stages() {
            lines.push((stage.name.clone(), format!("{:.1} s", stage.seconds)));
        }
        table::print(&lines);
        Ok(())
    }

    /// Fills with one of the methods that the default is compared with.
    fn fill_cellwise(
        &self,
        samples: Vec<Sample>,
        grid: Grid,
        settings: &CellSettings,
        progress: &mut Progress,
    ) -> Result<()> {
        let bins = progress.stage("binning", |_| anyhow::Ok(Bins::new(grid, &samples)))?;
        drop(samples);
        let filled = progress
            .stage("interpolating", |tell| {
                cellwise::fill(&bins, settings, tell)
            })
            .with_context(|| self.names())?;
        let mut provenance = of_this_program();
        provenance.insert("interpolation".into(), settings.to_string());
        provenance.insert("samples".into(), self.names());
        let file = DenseFile {
            brdf: filled.dense,
            scale: self.scale.into(),
            provenance,
        };
        progress.stage("writing the dense BRDF", |_| {
            write_dense(&self.output, file)
        })?;
        table::print(&[
            ("bins filled".into(), table::count(bins.bins().len() as u64)),
            ("cells".into(), table::count(grid.n_cells() as u64)),
            ("method".into(), settings.to_string()),
            (
                "failed, given the nearest value".into(),
                table::count(filled.failed),
            ),
            ("not positive, raised".into(), table::count(filled.raised)),
            ("written".into(), self.output.display().to_string()),
        ]);
        Ok(())
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

/// What a filled BRDF says of its making.
pub fn provenance_of(settings: &Settings) -> Provenance {
    let mut facts = of_this_program();
    facts.insert("interpolation".into(), settings.to_string());
    facts
}

/// The folder a file will be in.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
