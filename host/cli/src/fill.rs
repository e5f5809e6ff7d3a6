//! `gonia fill`: samples → bins → dense BRDF.

use crate::progress::Progress;
use crate::remarks;
use crate::scale::{self, ScaleArgument};
use crate::symmetry::SymmetryArgument;
use crate::table;
use anyhow::{Context, Result, bail};
use gonia_brdf::interpolate::{OriginCounts, Preset};
use gonia_formats::dense::{
    ChannelErrors, CombineErrors, ERRORS_OF, check_dense_name, write_dense_channels,
    write_error_bars,
};
use gonia_formats::fit_source::files_of_samples;
use gonia_formats::samples::read_channels_of_all;
use gonia_formats::{check_output, checksum, is_same_file};
use gonia_pipeline::budget::{
    CellBudget, Holding, StratumBudget, UNCERTAINTIES, albedo_uncertainty, budget_in,
    combine_errors, summary,
};
use gonia_pipeline::provenance::Provenance;
use gonia_pipeline::{DirectionalAlbedo, FillAccount, FillMethod, FillOptions, fill, fill_to_file};
use gonia_rig::{Budget, Channels, DenseChannels, SampleValues, Scale};
use std::path::{Path, PathBuf};

/// Interpolates samples to every cell of the grid.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia fill samples.npy -o dense.exr\n\nSAMPLES is .npy (N x 7, or N x 8 with the frame), .npz with one such array, or a table of text (.csv,\n.txt, .tsv) with columns theta_i, phi_i, theta_v, phi_v (degrees), r, g, b, or one value (brdf), or bands\n(380nm, 390nm, ...) and, if known, frame. The dense BRDF has their channels: R, G, B, or Y, or 380nm, ... Other names, separators, types and orders: reference/files/samples of the book.\nTheir scale is what a table says above its header (# scale = absolute), or the note beside an array\n(NAME.npy.toml, as gonia process writes it)."
)]
pub struct Fill {
    /// Samples, .npy, .npz or .csv; several files of one material count together
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
    /// Refine no block for a smaller relative difference than this, percent, however little noise samples have: what
    /// the use of the BRDF needs [default: 0.2; 0 with --tolerance]
    #[arg(long, value_name = "PERCENT")]
    target_error: Option<f32>,
    /// The material's symmetry about its normal: auto (what few samples show, or leave to be assumed),
    /// none, isotropic, bilateral, half-turn or half-turn-bilateral
    #[arg(long, value_enum, default_value = "auto")]
    symmetry: SymmetryArgument,
    /// Azimuth of the plane of a bilateral symmetry, degrees, where it is known (as of gonia plan --symmetry)
    /// [default: found, where samples lie on both of its sides]
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    plane: Option<f64>,
    /// default, or a method that works cell by cell: paper, nearest, shepard, mls1, mls2,
    /// rbf-KERNEL (core-hours on the 2-degree grid)
    #[arg(long, value_name = "NAME", default_value = "default")]
    method: FillMethod,
    /// What the samples' values are, where their files do not say it: relative, or absolute (1/sr)
    /// [default: what the files say, else relative]
    #[arg(long, value_enum)]
    scale: Option<ScaleArgument>,
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
            target_error: self.target_error.map(|percent| percent / 100.0),
            with_errors: self.error.is_some(),
            symmetry: self.symmetry.into(),
            plane_deg: self.plane,
            ..FillOptions::default()
        };
        let (grid, _) = options.check()?;
        let inputs: Vec<&Path> = self.samples.iter().map(PathBuf::as_path).collect();
        for output in [Some(&self.output), self.error.as_ref()]
            .into_iter()
            .flatten()
        {
            check_dense_name(output)?;
            check_output(output, &inputs)?;
        }
        if let Some(error) = &self.error
            && is_same_file(error, &self.output)
        {
            bail!(
                "--error {}: is the output too; give another name",
                error.display()
            );
        }
        let progress = Progress::new();
        let names = self.names();
        let said = self.scale.map(Scale::from);
        let read = progress.stage("reading samples", |_| {
            read_channels_of_all(&self.samples, said)
        })?;
        remarks::print(&read.remarks);
        let scale_row = scale::row(read.scale, said.is_some());
        let scale = read.scale.unwrap_or(Scale::Relative);
        let mut facts = read.provenance;
        facts.insert("samples".to_owned(), names.clone());
        facts.extend(files_of_samples(&self.output, &self.samples)?);
        let channels = read.values.channels().clone();
        let filled = self.fill(read.values, scale, &options, facts, &progress);
        let (account, uncertainty) = filled.with_context(|| names)?;
        let mut rows = self.describe(&account, &channels, scale);
        rows.extend(uncertainty);
        rows.insert(3, ("cells".into(), table::count(grid.n_cells() as u64)));
        if channels != Channels::Rgb {
            rows.insert(4, ("channels".into(), channels.to_string()));
        }
        rows.push(scale_row);
        rows.push(("written".into(), self.output.display().to_string()));
        for stage in progress.stages() {
            rows.push((stage.name, format!("{:.1} s", stage.seconds)));
        }
        table::print(&rows);
        Ok(())
    }

    /// Fills the grid and writes what was asked for.
    fn fill(
        &self,
        samples: SampleValues,
        scale: Scale,
        options: &FillOptions,
        facts: Provenance,
        progress: &Progress,
    ) -> Result<(FillAccount, Vec<(String, String)>)> {
        let watch = progress.watch();
        if !options.fits_memory(samples.channels())? {
            let account = fill_to_file(samples, scale, options, &self.output, &facts, &watch)?;
            remarks::print(&account.remarks);
            return Ok((account, Vec::new()));
        }
        let filled = fill(samples, scale, options, &watch)?;
        remarks::print(&filled.account.remarks);
        let budget = budget_in(&facts)?;
        let mut file = filled.dense;
        file.provenance.extend(facts);
        let mut error_facts = file.provenance.clone();
        if self.error.is_some() {
            let of = checksum::of_channels(&file);
            error_facts.insert(ERRORS_OF.to_owned(), of);
        }
        progress.stage("writing the dense BRDF", |_| {
            write_dense_channels(&self.output, &file)
        })?;
        let mut uncertainty = Vec::new();
        if let (Some(path), Some(bars)) = (&self.error, filled.errors) {
            uncertainty = uncertainty_rows(&file, &bars, budget.as_ref());
            let combine = budget.as_ref().and_then(|budget| {
                error_facts.insert(UNCERTAINTIES.to_owned(), budget.to_string());
                combine_errors(file.grid, &file.planes, &bars.origin, budget)
            });
            let combine = combine
                .as_ref()
                .map(|combine| combine as &CombineErrors<'_>);
            progress.stage("writing the error bars", |_| {
                write_error_bars(path, file.grid, bars, combine, scale, &error_facts)
            })?;
        }
        Ok((filled.account, uncertainty))
    }

    /// What became of the samples and of the cells, as rows.
    fn describe(
        &self,
        account: &FillAccount,
        channels: &Channels,
        scale: Scale,
    ) -> Vec<(String, String)> {
        let count = |n: usize| table::count(n as u64);
        let counts = &account.counts;
        let mut rows = vec![
            ("samples binned".to_owned(), count(counts.binned)),
            ("samples outside the grid".into(), count(counts.outside)),
            ("bins filled".into(), count(counts.bins)),
            ("settings".into(), account.settings.clone()),
            ("symmetry".into(), account.symmetry.clone()),
        ];
        rows.extend(origins(&account.origins));
        rows.push(albedo(&account.albedo, channels, scale));
        if let FillMethod::Cellwise(_) = self.method {
            let failed = table::count(counts.failed);
            let raised = table::count(counts.raised);
            rows.push(("failed, given the nearest value".into(), failed));
            rows.push(("not positive, raised".into(), raised));
        }
        rows
    }

    /// The files of samples, for people.
    fn names(&self) -> String {
        let name = |path: &PathBuf| Path::display(path).to_string();
        self.samples.iter().map(name).collect::<Vec<_>>().join(" ")
    }
}

/// What the standard errors hold, and their size: the largest contributions of each part of the domain.
fn uncertainty_rows(
    dense: &DenseChannels,
    errors: &ChannelErrors,
    budget: Option<&Budget>,
) -> Vec<(String, String)> {
    let Some(budget) = budget else {
        let alone = "noise and interpolation alone: the samples say nothing of their rig";
        return vec![("error bars hold".to_owned(), alone.to_owned())];
    };
    let middle = dense.planes.len() / 2;
    let of_middle = dense
        .planes
        .get(middle)
        .zip(errors.standard_error.get(middle));
    let cells = of_middle.and_then(|(plane, noise)| {
        let noise = (&noise[..], Holding::Noise);
        CellBudget::new(dense.grid, plane, noise, &errors.origin, budget)
    });
    let Some(cells) = cells else {
        return Vec::new();
    };
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let row = |of: &StratumBudget| {
        let largest = of.sorted().into_iter().take(3);
        let largest: Vec<String> = largest
            .map(|(part, u)| format!("{} {}", part.name(), percent(u)))
            .collect();
        (
            format!("u (k = 1), {}", of.stratum),
            format!(
                "{}: {}, ... (medians)",
                percent(of.combined),
                largest.join(", ")
            ),
        )
    };
    let mut rows: Vec<(String, String)> = summary(&cells).iter().map(row).collect();
    let albedos: Vec<String> = [0.0, 30.0, 60.0]
        .map(|theta| albedo_uncertainty(&cells, theta))
        .iter()
        .map(|of| format!("{:.3} ± {:.3}", of.albedo, 2.0 * of.u))
        .collect();
    let name = dense.channels.names().get(middle).cloned();
    rows.push((
        "albedo and U (k = 2)".to_owned(),
        format!(
            "{} ({} at theta_i 0, 30, 60)",
            albedos.join(", "),
            name.unwrap_or_default()
        ),
    ));
    rows
}

/// Where the cells' values come from.
fn origins(counts: &OriginCounts) -> Vec<(String, String)> {
    let guessed = 100.0 * counts.extrapolated_share();
    let extrapolated = table::count(counts.extrapolated);
    let symmetric =
        (counts.symmetric > 0).then(|| ("cells by symmetry", table::count(counts.symmetric)));
    let known = [
        ("cells measured", table::count(counts.measured)),
        ("cells by reciprocity", table::count(counts.reciprocal)),
    ];
    let others = [
        ("cells interpolated", table::count(counts.interpolated)),
        (
            "cells extrapolated",
            format!("{extrapolated} ({guessed:.1} %)"),
        ),
    ];
    let all = known.into_iter().chain(symmetric).chain(others);
    all.map(|(name, text)| (name.to_owned(), text)).collect()
}

/// The share of the light that is reflected: of colours in green at three polar angles, and the highest of all.
fn albedo(albedo: &DirectionalAlbedo, channels: &Channels, scale: Scale) -> (String, String) {
    let relative = match scale {
        Scale::Absolute => "",
        Scale::Relative => " (relative)",
    };
    let at = |theta: f64| albedo.at(theta).get(1).copied().unwrap_or_default();
    let green = match channels {
        Channels::Rgb => format!(
            "{:.3}, {:.3}, {:.3} (G at theta_i 0, 30, 60); ",
            at(0.0),
            at(30.0),
            at(60.0)
        ),
        _ => String::new(),
    };
    (
        format!("directional albedo{relative}"),
        format!(
            "{green}highest {:.3} ({} at theta_i {:.0}, phi_i {:.0})",
            albedo.highest, albedo.channel_name, albedo.theta_i_deg, albedo.phi_i_deg
        ),
    )
}
