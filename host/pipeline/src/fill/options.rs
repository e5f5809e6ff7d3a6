//! How a grid is filled, and what of that goes together.

use crate::Error;
use gonia_brdf::baselines::{BaselineSettings, UnknownBaseline};
use gonia_brdf::interpolate::{AnyKernel, FillSettings, Kernel, Matern32, Preset};
use gonia_brdf::{Grid, MirrorPlane, SymmetryKind};
use gonia_rig::Channels;
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
    /// And by more than this relative difference, whatever the noise, 0 ..= 1; the preset's without it.
    pub target_error: Option<f32>,
    /// The kernel of the blocks: [`Matern32`], or one of your own.
    pub kernel: &'static dyn AnyKernel,
    /// Whether each cell gets a standard error.
    pub with_errors: bool,
    /// The symmetry of the material about its normal; without it, what few samples show or leave to be assumed,
    /// and none of many.
    pub symmetry: Option<SymmetryKind>,
    /// The azimuth of the plane of a bilateral symmetry, degrees, where it is known: samples on one side of it do not
    /// tell.
    pub plane_deg: Option<f64>,
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
            target_error: None,
            kernel: &Matern32,
            with_errors: false,
            symmetry: None,
            plane_deg: None,
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

/// A grid of more cells than this, each of three channels (12 bytes), is filled row by row, by way of the
/// disk.
pub(super) const CELLS_IN_MEMORY: usize = 150_000_000;

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
            // Who asks for so many gets them.
            neighbours_most: self.nodes.unwrap_or(preset.neighbours_most),
            tolerance: self.tolerance.unwrap_or(preset.tolerance),
            target_error: match (self.target_error, self.tolerance) {
                (None, Some(_)) => 0.0,
                (target, _) => target.unwrap_or(preset.target_error),
            },
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
        if !(0.0..=1.0).contains(&settings.target_error) {
            return refuse(
                "--target-error",
                (100.0 * settings.target_error).to_string(),
                "must lie in 0..=100 percent".into(),
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
        if let Some(plane) = self.plane_deg
            && self.symmetry_of_plane().is_none()
        {
            let remedy = "only --symmetry bilateral and half-turn-bilateral have a plane, of -360 to 360 degrees";
            return refuse("--plane", plane.to_string(), remedy.into());
        }
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

    /// The symmetry about a plane that is known; `None` of any other.
    pub(super) fn symmetry_of_plane(&self) -> Option<(SymmetryKind, MirrorPlane)> {
        let azimuth = self.plane_deg.filter(|deg| deg.abs() <= 360.0)?;
        let has_plane = [SymmetryKind::Bilateral, SymmetryKind::HalfTurnBilateral];
        let kind = self.symmetry.filter(|kind| has_plane.contains(kind))?;
        Some((kind, MirrorPlane::at_deg(azimuth)))
    }

    /// Whether something is asked for that only blocks have: few anisotropic samples are filled by them then.
    pub(super) fn asks_for_blocks(&self) -> bool {
        self.block_deg.is_some()
            || self.nodes.is_some()
            || self.tolerance.is_some()
            || self.kernel.name() != Matern32.name()
    }

    /// Whether so many channels on the grid fit memory: [`fill`](super::fill) makes it then, and
    /// [`fill_to_file`](super::fill_to_file) otherwise.
    ///
    /// # Errors
    /// As [`FillOptions::check`]; a method that does not fill such channels, and error bars of more than fit.
    pub fn fits_memory(&self, channels: &Channels) -> Result<bool, Error> {
        let (grid, _) = self.check()?;
        self.check_method(channels)?;
        if grid.n_cells() * channels.count() <= 3 * CELLS_IN_MEMORY {
            return Ok(true);
        }
        self.check_rows(channels)?;
        Ok(false)
    }

    fn check_method(&self, channels: &Channels) -> Result<(), Error> {
        if self.method == FillMethod::Blocks || *channels == Channels::Rgb {
            return Ok(());
        }
        Err(Error::Option {
            option: "--method",
            found: format!("with the channels {channels}"),
            remedy: "only the default method fills other channels than r, g, b; leave it out"
                .into(),
        })
    }

    /// Whether such channels can be filled row by row.
    pub(super) fn check_rows(&self, channels: &Channels) -> Result<(), Error> {
        self.check_method(channels)?;
        let (grid, _) = self.check()?;
        let n = channels.count();
        let gigabytes = grid.n_cells() as f64 * n as f64 * 4e-9;
        let refuse = |option, what| {
            Err(Error::Option {
                option,
                found: format!("with {n} channels at a step of {} degrees", self.step_deg),
                remedy: format!(
                    "these are {gigabytes:.1} GB, which are filled row by row, and that {what}; leave it out, or take a coarser step"
                ),
            })
        };
        if self.with_errors {
            return refuse("--error", "gives no error bars");
        }
        if self.method != FillMethod::Blocks {
            return refuse("--method", "only the default method does");
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
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
                wrong(|o| o.target_error = Some(f32::NAN)),
                "--target-error NaN",
            ),
            (wrong(|o| o.target_error = Some(1.5)), "--target-error 150"),
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

    #[test]
    fn any_number_of_channels_fits_memory_or_is_written_by_rows_and_only_error_bars_are_not() {
        let bands = |n: usize| Channels::Bands((0..n).map(|k| 400.0 + k as f64).collect());
        let mut options = FillOptions::default();
        for (channels, fits) in [
            (Channels::Rgb, true),
            (Channels::Single, true),
            (bands(7), true),
            (bands(8), false),
            (bands(31), false),
        ] {
            assert_eq!(
                options.fits_memory(&channels).ok(),
                Some(fits),
                "{channels}"
            );
        }
        options.with_errors = true;
        assert!(options.fits_memory(&bands(7)).unwrap());
        let said = options.fits_memory(&bands(8)).unwrap_err().to_string();
        assert!(
            said.starts_with("--error with 8 channels at a step of 2 degrees: these are 2.0 GB"),
            "{said}"
        );
        options = FillOptions {
            method: FillMethod::Cellwise(BaselineSettings::PAPER),
            ..FillOptions::default()
        };
        assert!(options.fits_memory(&Channels::Rgb).unwrap());
        let said = options
            .fits_memory(&Channels::Single)
            .unwrap_err()
            .to_string();
        assert!(said.starts_with("--method with the channels Y"), "{said}");
    }
}
