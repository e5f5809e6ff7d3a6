//! Frames → samples → dense BRDF → figures: the library behind the commands.
//!
//! ```no_run
//! use gonia_brdf::Direction;
//! use gonia_pipeline::{FillOptions, fill, samples_of_folder, silent};
//!
//! let measured = samples_of_folder("capture".as_ref(), &silent)?.into_sample_set();
//! let filled = fill(measured.samples, measured.scale, &FillOptions::with_step_deg(4.0), &silent)?;
//! let (light, view) = (Direction::from_deg(30.0, 45.0), Direction::from_deg(60.0, 225.0));
//! println!("{:?} {}", filled.dense.lookup(light, view), filled.dense.scale);
//! # Ok::<(), gonia_pipeline::Error>(())
//! ```
//!
//! | module | from | to |
//! |---|---|---|
//! | [`samples_of_folder`], [`samples_of`] | a capture folder, or any [`FrameSource`](process::FrameSource) | samples, and what became of each frame |
//! | [`calibrate()`] | a capture folder's frames | the rig's geometry, with uncertainties |
//! | [`fill()`], [`fill_to_file`], [`fill_bins`] | samples of any channels, or bins | a dense BRDF, with standard errors where asked for |
//! | [`FillInParts`] | the same | a dense BRDF, by several processes |
//! | [`FitOfSamples`] | few samples | a fit that is asked anywhere, without a grid |
//! | [`Behind`] | a dense BRDF whose samples are there | the same fit |
//! | [`fit`] | a dense BRDF or samples | a model's parameters with uncertainties |
//! | [`compare()`] | two BRDFs | figures of merit by stratum |
//! | [`export`] | a dense BRDF | a file in another group's format, and what was lost |
//! | [`baselines`] | a measurement | other ways to the same BRDF, and how far each is |
//! | [`chart`] | samples | what accuracy costs, method by method |
//!
//! Nothing is printed. Every function that takes long hears a [`Progress`] callback, which may end
//! the work; every error is one line ([`Error`]).

mod accumulate;
pub mod baselines;
pub mod bracket;
mod bracket_sensor;
pub mod budget;
pub mod calibrate;
pub mod chart;
mod colours;
pub mod compare;
mod compare_bands;
mod error;
pub mod export;
pub mod export_samples;
mod fill;
pub mod fit;
pub mod process;
mod progress;
pub mod provenance;
mod samples;
mod warnings;

pub use calibrate::{CalibrateError, Calibrated, calibrate};
pub use colours::colours_of;
pub use compare::{CompareError, Options, Side, Table, compare};
pub use compare_bands::{BandFigures, compare_bands};
pub use error::Error;
pub use fill::{
    Begun, Behind, FillAccount, FillCounts, FillInParts, FillMethod, FillOptions, Filled,
    FilledBins, FitOfSamples, fill, fill_bins, fill_to_file,
};
pub use progress::{Cancelled, Progress, Step, silent};
pub use samples::{samples_of, samples_of_folder, samples_of_sampled, samples_of_shares};
pub use warnings::DirectionalAlbedo;
