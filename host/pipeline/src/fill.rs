//! Samples → bins → dense BRDF.

use crate::Error;
use crate::doubts::{self, AlbedoRows, DirectionalAlbedo, Isotropy};
use crate::progress::{Progress, Step, step};
use crate::provenance::{Provenance, of_this_program};
use gonia_brdf::baselines::{self, BaselineSettings, UnknownBaseline};
use gonia_brdf::interpolate::{
    self, AnyKernel, ByRows, Calibration, Data, ErrorBars, FillError, FillSettings,
    IsotropicOrigins, Kernel, Matern32, NewBlock, OriginCounts, Preset,
};
use gonia_brdf::scattered::{FEW_ANISOTROPIC, Reason, ScatteredFit, is_few};
use gonia_brdf::{Bin, Bins, DenseBrdf, Direction, Grid, Sample, Symmetry, SymmetryKind};
use gonia_formats::dense::{RowsNote, write_dense_by_rows};
use gonia_rig::{Channels, DenseFile, Remark, SampleSet, keep_sound};
use std::path::Path;
use std::str::FromStr;

/// How to fill a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillOptions {
    /// Step of the grid in θ and in φ, degrees.
    pub step_deg: f64,
    /// Speed against accuracy.
    pub preset: Preset,
    /// By which method.
    pub method: FillMethod,
    /// Side of the blocks that share a factorisation, degrees; the preset's without it.
    pub block_deg: Option<f64>,
    /// Data in a block's neighbourhood, 8 ..= 1024; the preset's without it.
    pub nodes: Option<usize>,
    /// A block is refined where a finer one differs from it by more than this many times the noise
    /// of the samples, 0 ..= ∞; the preset's without it, or more where refining would cost too much.
    pub tolerance: Option<f32>,
    /// The kernel of the blocks: [`Matern32`], or one of your own.
    pub kernel: &'static dyn AnyKernel,
    /// Whether each cell gets a standard error.
    pub with_errors: bool,
    /// The symmetry of the material about its normal; without it, what few samples show or leave to be assumed,
    /// and none of many.
    pub symmetry: Option<SymmetryKind>,
}

impl Default for FillOptions {
    /// The paper's grid of 2°, the default preset, no standard errors.
    fn default() -> Self {
        Self {
            step_deg: 2.0,
            preset: Preset::Default,
            method: FillMethod::Blocks,
            block_deg: None,
            nodes: None,
            tolerance: None,
            kernel: &Matern32,
            with_errors: false,
            symmetry: None,
        }
    }
}

/// By which method a grid is filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FillMethod {
    /// Blocks that share a kriging system, with the settings that suit the material.
    Blocks,
    /// One cell at a time: the paper's method and other baselines.
    Cellwise(BaselineSettings),
}

impl FromStr for FillMethod {
    type Err = UnknownBaseline;

    /// `default`, `paper`, or another baseline by name.
    fn from_str(text: &str) -> Result<Self, UnknownBaseline> {
        if text == "default" {
            return Ok(FillMethod::Blocks);
        }
        text.parse().map(FillMethod::Cellwise)
    }
}

/// A grid of more cells than this (12 bytes each) is filled row by row, in twice the time.
pub(crate) const CELLS_IN_MEMORY: usize = 150_000_000;

impl FillOptions {
    /// The default with another step.
    pub fn with_step_deg(step_deg: f64) -> Self {
        Self {
            step_deg,
            ..Self::default()
        }
    }

    /// The grid, and the settings before the material's own are chosen.
    ///
    /// # Errors
    /// A value that is not possible, or two that do not go together.
    pub fn check(&self) -> Result<(Grid, FillSettings), Error> {
        let refuse = |option, found: String, remedy: String| {
            Err(Error::Option {
                option,
                found,
                remedy,
            })
        };
        let grid = Grid::with_step_deg(self.step_deg).map_err(|error| Error::Option {
            option: "--step",
            found: self.step_deg.to_string(),
            remedy: error.to_string(),
        })?;
        let preset = self.preset.settings();
        let settings = FillSettings {
            // Blocks of few cells share too little.
            block_deg: self
                .block_deg
                .unwrap_or(preset.block_deg.max(2.0 * self.step_deg)),
            neighbours: self.nodes.unwrap_or(preset.neighbours),
            tolerance: self.tolerance.unwrap_or(preset.tolerance),
            kernel: self.kernel,
            // Who asks for a tolerance gets it.
            budget: self.tolerance.map_or(preset.budget, |_| f32::INFINITY),
            ..preset
        };
        // A coarse grid has coarse blocks; only a size that was asked for can be too large.
        let most_deg = if self.block_deg.is_some() {
            45.0
        } else {
            f64::INFINITY
        };
        if !(self.step_deg..=most_deg).contains(&settings.block_deg) {
            return refuse(
                "--block",
                settings.block_deg.to_string(),
                format!(
                    "must lie between the step ({}) and 45 degrees",
                    self.step_deg
                ),
            );
        }
        if !(8..=1024).contains(&settings.neighbours) {
            return refuse(
                "--nodes",
                settings.neighbours.to_string(),
                "must lie in 8..=1024".into(),
            );
        }
        if settings.tolerance.is_nan() || settings.tolerance < 0.0 {
            return refuse(
                "--tolerance",
                settings.tolerance.to_string(),
                "must be 0 or more, or inf".into(),
            );
        }
        self.check_together(grid)?;
        Ok((grid, settings))
    }

    /// Whether the options go together.
    fn check_together(&self, grid: Grid) -> Result<(), Error> {
        let refuse = |option, found: String, remedy: String| {
            Err(Error::Option {
                option,
                found,
                remedy,
            })
        };
        let by_rows = format!(
            "not on a grid of {} degrees, which is filled row by row; leave it out",
            self.step_deg
        );
        if self.symmetry == Some(SymmetryKind::Isotropic) && grid.n_cells() > CELLS_IN_MEMORY {
            return refuse("--symmetry", "isotropic".into(), by_rows);
        }
        let is_blocks = self.method == FillMethod::Blocks;
        if self.with_errors && !is_blocks {
            return refuse(
                "--error",
                "with --method".into(),
                "only the default method has error bars; leave out one of them".into(),
            );
        }
        if self.symmetry.is_some_and(|kind| kind != SymmetryKind::None) && !is_blocks {
            return refuse(
                "--symmetry",
                "with --method".into(),
                "only the default method has symmetries; leave out one of them".into(),
            );
        }
        if grid.n_cells() > CELLS_IN_MEMORY && self.with_errors {
            return refuse("--error", self.step_deg.to_string(), by_rows);
        }
        if grid.n_cells() > CELLS_IN_MEMORY && !is_blocks {
            return refuse("--method", self.step_deg.to_string(), by_rows);
        }
        Ok(())
    }

    /// Whether something is asked for that only blocks have: few anisotropic samples are filled by them then.
    fn asks_for_blocks(&self) -> bool {
        self.block_deg.is_some()
            || self.nodes.is_some()
            || self.tolerance.is_some()
            || self.kernel.name() != Matern32.name()
    }

    /// Whether the grid fits memory: [`fill`] makes it then, and [`fill_to_file`] otherwise.
    ///
    /// # Errors
    /// As [`FillOptions::check`].
    pub fn fits_memory(&self) -> Result<bool, Error> {
        Ok(self.check()?.0.n_cells() <= CELLS_IN_MEMORY)
    }
}

/// What became of the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct FillCounts {
    /// Samples that fell into a bin.
    pub binned: usize,
    /// Samples outside the grid, or left out.
    pub outside: usize,
    /// Bins that hold a sample.
    pub bins: usize,
    /// Interpolations that failed and got the nearest value; baselines only.
    pub failed: u64,
    /// Values that were not positive and were raised; baselines only.
    pub raised: u64,
}

/// A dense BRDF, and how it came about.
#[derive(Clone, Debug)]
pub struct Filled {
    /// The values with their scale and provenance.
    pub dense: DenseFile,
    /// Standard errors, where asked for.
    pub errors: Option<ErrorBars>,
    /// Cells with a sample, by number ([`Grid::cell`]).
    pub cells: Vec<u32>,
    /// What became of the samples.
    pub counts: FillCounts,
    /// The method's settings, as chosen for the material, for people.
    pub settings: String,
    /// The symmetry that the values have, and why, for people.
    pub symmetry: String,
    /// Where the cells' values come from.
    pub origins: OriginCounts,
    /// The directional albedo, its highest within the measured polar angles.
    pub albedo: DirectionalAlbedo,
    /// What in the samples and in the result speaks against what they are taken for.
    pub remarks: Vec<Remark>,
}

/// What became of samples whose dense BRDF was written row by row.
#[derive(Clone, Debug)]
pub struct FilledFile {
    /// What became of the samples.
    pub counts: FillCounts,
    /// The method's settings, as chosen for the material, for people.
    pub settings: String,
    /// Where the cells' values come from.
    pub origins: OriginCounts,
    /// The directional albedo, its highest within the measured polar angles.
    pub albedo: DirectionalAlbedo,
    /// What in the samples and in the result speaks against what they are taken for.
    pub remarks: Vec<Remark>,
}

/// Bins samples, chooses the settings that suit the material, and interpolates every cell of the
/// grid. The result has the samples' scale. The grid must fit memory. Samples below the horizon or not
/// finite are left out, negative polar angles are turned ([`keep_sound`]); the remarks say so, and what else
/// speaks against the samples.
///
/// # Errors
/// Options that are not possible, samples that contradict what they are taken for, too few bins, or too few
/// frames for standard errors.
pub fn fill(
    samples: SampleSet,
    options: &FillOptions,
    progress: &Progress<'_>,
) -> Result<Filled, Error> {
    let (grid, base) = options.check()?;
    let scale = samples.scale;
    let binned = Binned::new(samples, grid, options, progress)?;
    let (brdf, errors, settings, counts) = match (options.method, &binned.fit) {
        (FillMethod::Blocks, Some(fit)) => {
            let (dense, errors) = step(progress, Step::Interpolating, |_| {
                Ok::<_, Error>(fit.dense(grid, options.with_errors))
            })?;
            let errors = errors.map(|standard_error| ErrorBars {
                standard_error,
                origin: Origins::of(&binned.bins, fit).of_cells(),
            });
            (
                dense,
                errors,
                fit.choice().settings.to_string(),
                binned.counts(),
            )
        }
        (FillMethod::Blocks, None) => {
            let blocks = fill_bins(&binned.bins, base, options.with_errors, progress)?;
            let text = blocks.settings.to_string();
            (blocks.dense, blocks.errors, text, binned.counts())
        }
        (FillMethod::Cellwise(settings), _) => {
            let filled = step(progress, Step::Interpolating, |share| {
                baselines::fill(&binned.bins, &settings, share).map_err(Error::from)
            })?;
            let counts = FillCounts {
                failed: filled.failed,
                raised: filled.raised,
                ..binned.counts()
            };
            (filled.dense, None, settings.to_string(), counts)
        }
    };
    let albedo = DirectionalAlbedo::of(&brdf, binned.highest_deg());
    let mut provenance = provenance_of(&settings);
    provenance.insert("symmetry".into(), binned.symmetry.clone());
    let mut remarks = binned.remarks;
    remarks.extend(doubts::remark_on_energy(&albedo, scale));
    Ok(Filled {
        dense: DenseFile {
            brdf,
            scale,
            provenance,
        },
        errors,
        cells: binned.bins.bins().iter().map(|b| b.cell).collect(),
        counts,
        settings,
        symmetry: binned.symmetry,
        origins: binned.origins,
        albedo,
        remarks,
    })
}

/// Fills a grid that does not fit memory, and writes it row by row. `facts` are added to the file's
/// provenance.
///
/// # Errors
/// As [`fill`], and when the file cannot be written.
pub fn fill_to_file(
    samples: SampleSet,
    options: &FillOptions,
    path: &Path,
    facts: &Provenance,
    progress: &Progress<'_>,
) -> Result<FilledFile, Error> {
    let (grid, base) = options.check()?;
    let scale = samples.scale;
    let binned = Binned::new(samples, grid, options, progress)?;
    let known = sorted(&binned.bins, base, progress)?;
    let settings = chosen(&known, base, progress)?;
    let rows = step(progress, Step::FittingBlocks, |share| {
        ByRows::new(&known, &settings, share).map_err(Error::from)
    })?;
    let mut provenance = provenance_of(&settings.to_string());
    provenance.insert("symmetry".into(), binned.symmetry.clone());
    provenance.extend(facts.clone());
    let sums = AlbedoRows::new(grid);
    let seen = |light: usize, row: &[&[f32]]| sums.add(light, first_three(row));
    let note = RowsNote {
        channels: &Channels::Rgb,
        scale,
        provenance: &provenance,
    };
    step(progress, Step::InterpolatingAndWriting, |share| {
        write_dense_by_rows(path, grid, &rows, &note, &seen, share).map_err(Error::from)
    })?;
    let albedo = sums.finish(binned.highest_deg());
    let counts = binned.counts();
    let mut remarks = binned.remarks;
    remarks.extend(doubts::remark_on_energy(&albedo, scale));
    Ok(FilledFile {
        counts,
        settings: settings.to_string(),
        origins: binned.origins,
        albedo,
        remarks,
    })
}

/// The first three channels of a row; of fewer the rest has no values.
pub(crate) fn first_three<'a>(row: &[&'a [f32]]) -> [&'a [f32]; 3] {
    [0, 1, 2].map(|c| row.get(c).copied().unwrap_or_default())
}

/// Bins, interpolated block by block.
#[derive(Clone, Debug)]
pub struct FilledBins<const N: usize = 3> {
    /// The values.
    pub dense: DenseBrdf<N>,
    /// Standard errors, where asked for.
    pub errors: Option<ErrorBars<N>>,
    /// The settings, as chosen for the material.
    pub settings: FillSettings,
}

/// Interpolates bins block by block, with the settings that suit the material, starting from `base`.
///
/// # Errors
/// Too few bins, or too few frames for standard errors.
pub fn fill_bins(
    bins: &Bins,
    base: FillSettings,
    with_errors: bool,
    progress: &Progress<'_>,
) -> Result<FilledBins, Error> {
    fill_bins_of(bins, Start::Choose(base), with_errors, progress)
}

/// What the settings of a fill come from.
#[derive(Clone, Copy)]
pub(crate) enum Start {
    /// The material's own, from these.
    Choose(FillSettings),
    /// As they were chosen for other channels of the same samples.
    Chosen(FillSettings),
}

/// [`fill_bins`] of any number of channels that has blocks.
pub(crate) fn fill_bins_of<const N: usize>(
    bins: &Bins<N>,
    start: Start,
    with_errors: bool,
    progress: &Progress<'_>,
) -> Result<FilledBins<N>, Error>
where
    dyn AnyKernel: NewBlock<N>,
{
    let (Start::Choose(base) | Start::Chosen(base)) = start;
    let known = sorted(bins, base, progress)?;
    let settings = match start {
        Start::Choose(base) => chosen(&known, base, progress)?,
        Start::Chosen(settings) => settings,
    };
    let (dense, errors) = if with_errors {
        let calibration = step(progress, Step::CalibratingErrorBars, |_| {
            Calibration::new(&known, &settings).ok_or(Error::TooFewFrames)
        })?;
        let (dense, errors) = step(progress, Step::Interpolating, |share| {
            interpolate::fill_with_errors(&known, &settings, &calibration, share)
                .map_err(Error::from)
        })?;
        (dense, Some(errors))
    } else {
        let dense = step(progress, Step::Interpolating, |share| {
            interpolate::fill(&known, &settings, share).map_err(Error::from)
        })?;
        (dense, None)
    };
    Ok(FilledBins {
        dense,
        errors,
        settings,
    })
}

pub(crate) fn sorted<'a, const N: usize>(
    bins: &'a Bins<N>,
    base: FillSettings,
    progress: &Progress<'_>,
) -> Result<Data<'a, N>, Error> {
    step(progress, Step::Sorting, |_| {
        Ok(Data::thinned(bins, base.one_bin_in))
    })
}

pub(crate) fn chosen<const N: usize>(
    known: &Data<'_, N>,
    base: FillSettings,
    progress: &Progress<'_>,
) -> Result<FillSettings, Error>
where
    dyn AnyKernel: NewBlock<N>,
{
    step(progress, Step::ChoosingSettings, |_| {
        Ok(interpolate::select(known, base).settings)
    })
}

/// Samples in their bins, and what is to be said of them.
pub(crate) struct Binned {
    pub bins: Bins,
    samples: usize,
    /// How many of a sample are in the bins: with its images.
    images: usize,
    /// The fit of few samples, or of those of an isotropic material: it takes the place of the bins.
    pub fit: Option<ScatteredFit>,
    /// The symmetry, for people and for the provenance …
    pub symmetry: String,
    /// … and the images that the bins hold.
    pub completed_by: Symmetry,
    pub origins: OriginCounts,
    pub remarks: Vec<Remark>,
}

impl Binned {
    pub fn new(
        mut samples: SampleSet,
        grid: Grid,
        options: &FillOptions,
        progress: &Progress<'_>,
    ) -> Result<Self, Error> {
        let count = samples.samples.len();
        let odd = keep_sound(&mut samples.samples);
        let samples = samples.samples;
        let mut remarks = doubts::of_oddities(&odd);
        remarks.extend(doubts::of_samples(&samples)?);
        let fit = scattered_fit(&samples, grid, options, progress)?;
        let (symmetry, reason) = match (&fit, options.symmetry) {
            (Some(fit), _) => (fit.choice().settings.symmetry, fit.choice().reason),
            (None, Some(asked)) => {
                let (symmetry, said) = symmetry_of_many(&samples, asked);
                remarks.extend(said);
                (symmetry, Reason::Asked)
            }
            (None, None) => (Symmetry::None, Reason::Untested),
        };
        let fit = fit.filter(|fit| {
            let is_few = fit.places() <= FEW_ANISOTROPIC && !options.asks_for_blocks();
            let takes_place = symmetry.is_isotropic() || is_few;
            if takes_place || fit.choice().contradicted_by.is_some() {
                remarks.extend(doubts::remarks_on_symmetry(fit));
            }
            takes_place
        });
        let bins = step(progress, Step::Binning, |_| {
            Ok::<_, Error>(Bins::new(grid, &samples))
        })?;
        remarks.extend(doubts::of_bins(&samples, &bins));
        let isotropy = match (symmetry.is_isotropic(), reason) {
            (false, _) => Isotropy::No,
            (_, Reason::Asked) => Isotropy::Asked,
            (_, Reason::Assumed | Reason::TooFew) => Isotropy::Assumed,
            _ => Isotropy::Shown,
        };
        let images = symmetry.order();
        let bins = if images > 1 {
            Bins::new(grid, &symmetry.completed(samples.clone()))
        } else {
            bins
        };
        let origins = match &fit {
            Some(fit) => Origins::of(&bins, fit).counts(),
            None => OriginCounts::of(&bins),
        };
        let mut binned = Self {
            bins,
            samples: count,
            images,
            fit,
            symmetry: format!("{symmetry}, {reason}"),
            completed_by: symmetry,
            origins,
            remarks,
        };
        let layout = doubts::remark_on_layout(&samples, &binned.origins, isotropy);
        binned.remarks.extend(layout);
        Ok(binned)
    }

    /// The largest polar angle of light, or by reciprocity of view, that was measured.
    pub fn highest_deg(&self) -> f64 {
        let grid = self.bins.grid();
        let ring = |bin: &Bin| {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            light.max(view) / grid.n_phi()
        };
        let highest = self.bins.bins().iter().map(ring).max().unwrap_or(0);
        highest as f64 * grid.step_deg()
    }

    pub fn counts(&self) -> FillCounts {
        let in_bins: usize = self.bins.bins().iter().map(|bin| bin.count as usize).sum();
        let binned = in_bins / self.images;
        FillCounts {
            binned,
            outside: self.samples - binned,
            bins: self.bins.bins().len(),
            failed: 0,
            raised: 0,
        }
    }
}

/// Where the cells of a fit have their values from.
pub(crate) enum Origins<'a> {
    Isotropic(IsotropicOrigins),
    Anisotropic(&'a Bins),
}

impl<'a> Origins<'a> {
    pub fn of(bins: &'a Bins, fit: &ScatteredFit) -> Self {
        match fit.choice().settings.symmetry {
            Symmetry::Isotropic => Origins::Isotropic(IsotropicOrigins::of(bins, true)),
            Symmetry::Turns => Origins::Isotropic(IsotropicOrigins::of(bins, false)),
            _ => Origins::Anisotropic(bins),
        }
    }

    fn counts(&self) -> OriginCounts {
        match self {
            Origins::Isotropic(origins) => origins.counts(),
            Origins::Anisotropic(bins) => OriginCounts::of(bins),
        }
    }

    pub fn of_cells(&self) -> Vec<u8> {
        match self {
            Origins::Isotropic(origins) => origins.of_cells(),
            Origins::Anisotropic(bins) => interpolate::origins(bins),
        }
    }
}

/// A fit of few samples, or of those of a material that is said to be isotropic; `None` of others.
fn scattered_fit(
    samples: &[Sample],
    grid: Grid,
    options: &FillOptions,
    progress: &Progress<'_>,
) -> Result<Option<ScatteredFit>, Error> {
    let asked = options.symmetry;
    let possible = options.method == FillMethod::Blocks && grid.n_cells() <= CELLS_IN_MEMORY;
    if !possible {
        return Ok(None);
    }
    step(progress, Step::ChoosingSettings, |_| {
        Ok(if is_few(samples) {
            ScatteredFit::new(samples, asked)
        } else if asked == Some(SymmetryKind::Isotropic) {
            ScatteredFit::new(&few_of(samples, grid), asked)
        } else {
            None
        })
    })
}

/// So many of many samples, at most, are looked at for a plane of symmetry, and for what contradicts it.
const LOOKED_AT: usize = 6000;

/// The symmetry of many samples that is asked for, with the plane that some of them show, and what these say against
/// it.
fn symmetry_of_many(samples: &[Sample], asked: SymmetryKind) -> (Symmetry, Vec<Remark>) {
    if matches!(asked, SymmetryKind::None | SymmetryKind::Isotropic) {
        return (Symmetry::None, Vec::new());
    }
    let step = samples.len().div_ceil(LOOKED_AT).max(1);
    let some: Vec<Sample> = samples.iter().step_by(step).copied().collect();
    match ScatteredFit::new(&some, Some(asked)) {
        Some(fit) => (
            fit.choice().settings.symmetry,
            doubts::remarks_on_symmetry(&fit),
        ),
        None => (Symmetry::None, Vec::new()),
    }
}

/// More samples than this are not asked without a grid.
const SAMPLES_AT_MOST: usize = 1_000_000;

/// A fit of samples that is asked at any directions, without a grid, and what is to be said of them.
///
/// # Errors
/// Samples that contradict what they are taken for, or too few or too many of them.
pub fn fit_of_samples(
    mut samples: Vec<Sample>,
    symmetry: Option<SymmetryKind>,
) -> Result<(ScatteredFit, Vec<Remark>), Error> {
    let odd = keep_sound(&mut samples);
    let mut remarks = doubts::of_oddities(&odd);
    remarks.extend(doubts::of_samples(&samples)?);
    if samples.len() > SAMPLES_AT_MOST {
        return Err(Error::Contradicted {
            what: format!(
                "{} samples are more than the {SAMPLES_AT_MOST} that can be asked without a grid",
                samples.len()
            ),
            remedy: "make a dense BRDF of them with gonia fill, and query that".into(),
        });
    }
    let fit = ScatteredFit::new(&samples, symmetry).ok_or(FillError::TooFewBins(samples.len()))?;
    remarks.extend(doubts::remarks_on_symmetry(&fit));
    if fit.choice().reason == Reason::Assumed {
        remarks.push(doubts::remark_on_assumed_isotropy());
    }
    Ok((fit, remarks))
}

/// Of many samples of an isotropic material, the medians of those that share a cell when all are turned to
/// one azimuth of light.
pub(crate) fn few_of(samples: &[Sample], grid: Grid) -> Vec<Sample> {
    let turned = samples.iter().map(|s| Sample {
        phi_i_deg: 0.0,
        phi_v_deg: (s.phi_v_deg - s.phi_i_deg).rem_euclid(360.0),
        ..*s
    });
    let bins = Bins::new(grid, &turned.collect::<Vec<Sample>>());
    let bins = bins.bins().iter();
    bins.map(|bin| {
        let direction = |v: [f32; 3]| Direction::from_vec3(v.map(f64::from));
        Sample::new(direction(bin.light), direction(bin.view), bin.median)
    })
    .collect()
}

/// What a filled BRDF says of its making.
pub(crate) fn provenance_of(settings: &str) -> Provenance {
    let mut facts = of_this_program();
    facts.insert("interpolation".into(), settings.to_owned());
    facts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_have_names() {
        assert_eq!("default".parse(), Ok(FillMethod::Blocks));
        assert_eq!(
            "paper".parse(),
            Ok(FillMethod::Cellwise(BaselineSettings::PAPER))
        );
        assert!("papers".parse::<FillMethod>().is_err());
    }

    #[test]
    fn options_that_are_not_possible_are_named_in_a_line() {
        let wrong = |change: fn(&mut FillOptions)| {
            let mut options = FillOptions::default();
            change(&mut options);
            options.check().unwrap_err().to_string()
        };
        for (found, option) in [
            (wrong(|o| o.step_deg = 7.7), "--step 7.7"),
            (wrong(|o| o.block_deg = Some(1.0)), "--block 1"),
            (wrong(|o| o.nodes = Some(7)), "--nodes 7"),
            (wrong(|o| o.tolerance = Some(f32::NAN)), "--tolerance NaN"),
            (
                wrong(|o| {
                    o.with_errors = true;
                    o.method = FillMethod::Cellwise(BaselineSettings::PAPER);
                }),
                "--error with --method",
            ),
        ] {
            assert!(found.starts_with(option), "{found}");
            assert_eq!(found.lines().count(), 1);
        }
        assert!(FillOptions::with_step_deg(30.0).check().is_ok());
    }
}
