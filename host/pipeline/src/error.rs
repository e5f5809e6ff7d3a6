//! Why the pipeline ends without a result.

use crate::compare::CompareError;
use crate::process::ProcessError;
use crate::progress::Cancelled;
use gonia_brdf::fit::FitError;
use gonia_brdf::interpolate::FillError;
use gonia_formats::FileError;
use gonia_rig::{Channels, NoBudget};

/// Any error of this library. Each says in one line what is wrong and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file cannot be read or written, or says what cannot be.
    #[error(transparent)]
    File(#[from] FileError),
    /// Frames cannot become samples.
    #[error(transparent)]
    Process(ProcessError),
    /// The frames gave no sample.
    #[error("none of the {frames} frames gave a sample: {why}; check rig.toml and the poses")]
    NoSamples {
        /// Frames looked at.
        frames: usize,
        /// The commonest reason.
        why: String,
    },
    /// An option has a value that is not possible.
    #[error("{option} {found}: {remedy}")]
    Option {
        /// The option, as the command line spells it.
        option: &'static str,
        /// The value.
        found: String,
        /// What is possible.
        remedy: String,
    },
    /// The samples contradict what they are taken for.
    #[error("{what}; {remedy}")]
    Contradicted {
        /// The evidence.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// The samples cannot be interpolated.
    #[error(transparent)]
    Fill(FillError),
    /// Error bars need more frames.
    #[error("too few frames to calibrate error bars: measure more poses, or leave --error out")]
    TooFewFrames,
    /// A model cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// No sample lies on the grid of what a model is to be fitted to.
    #[error("no sample lies on the grid; give those of the same measurement")]
    NoSampleOnGrid,
    /// Two BRDFs cannot be compared.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// A measurement has too few frames to be compared with its baselines.
    #[error(
        "has {frames} frames to take central samples of; give samples with frame numbers (N x 8)"
    )]
    TooFewCentres {
        /// Frames with a number.
        frames: usize,
    },
    /// Colours are asked for of what has none.
    #[error("the BRDF has no R, G, B but {0}; see its bands as colours first")]
    NoColours(Channels),
    /// A format means 1/sr, and the values are relative.
    #[error(
        "the BRDF is relative, and the format {format} means 1/sr: give the factor that makes it so (--assume-scale 1 takes the values as they are)"
    )]
    RelativeExport {
        /// The format's name.
        format: &'static str,
    },
    /// An export of a grid that is much coarser than the format's directions, which is not said to be meant.
    #[error(
        "{path}: its step of {step_deg} degrees is coarser than the {format_deg} degrees of {format}, where interpolated values would pass for measured ones: fill a finer grid (gonia fill --step), {formats}or say that it is meant (--allow-coarse)"
    )]
    TooCoarse {
        /// The table.
        path: String,
        /// Its step.
        step_deg: f64,
        /// About how far the format's directions lie apart.
        format_deg: f64,
        /// The format.
        format: &'static str,
        /// What else there is, with a comma at its end.
        formats: String,
    },
    /// An export of uncertainties to a format that has no place for them.
    #[error(
        "the format {format} has no place for uncertainties: leave --error out, or give --format netcdf, zarr or bird"
    )]
    NoUncertainties {
        /// The format's name.
        format: &'static str,
    },
    /// A table whose channels are not of one size.
    #[error("the table's planes differ in size; make it again")]
    UnequalPlanes,
    /// What the data say of their uncertainties is unsound.
    #[error(transparent)]
    Budget(#[from] NoBudget),
    /// The caller's progress callback said so.
    #[error("cancelled")]
    Cancelled,
}

impl From<Cancelled> for Error {
    fn from(_: Cancelled) -> Self {
        Error::Cancelled
    }
}

impl From<FillError> for Error {
    fn from(error: FillError) -> Self {
        match error {
            FillError::Cancelled => Error::Cancelled,
            error => Error::Fill(error),
        }
    }
}

impl From<ProcessError> for Error {
    fn from(error: ProcessError) -> Self {
        match error {
            ProcessError::Cancelled(_) => Error::Cancelled,
            error => Error::Process(error),
        }
    }
}
