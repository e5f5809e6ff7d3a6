//! What a file format must bring along: its names, and the functions that read and write it.
//!
//! A new format is one file that defines a [`Format`], and one row in [`crate::table`].

use crate::FileError;
use gonia_brdf::{Brdf, Grid, Sample};
use gonia_rig::{ChannelSamples, Channels, DenseChannels, DenseFile, Remark, SampleValues, Scale};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// A file format of dense BRDFs, of samples, or of other people's measurements.
pub(crate) struct Format {
    /// Its name, for messages.
    pub name: &'static str,
    /// The endings of its files in lower case, without the dot; the first one is recommended.
    pub endings: &'static [&'static str],
    /// What each of its files begins with; empty where the first bytes tell nothing.
    pub magic: &'static [u8],
    /// What its files hold.
    pub content: Content,
}

/// What the files of a format hold.
pub(crate) enum Content {
    /// A dense BRDF on gonia's grid.
    Dense(DenseFormat),
    /// Samples.
    Samples(SampleFormat),
    /// Another group's measurement, to be imported.
    Foreign(ForeignFormat),
}

/// How a dense BRDF is read and written.
pub(crate) struct DenseFormat {
    /// Reads a file whole.
    pub read: fn(&Path) -> Result<DenseChannels, FileError>,
    /// Opens a file of which a few cells are wanted; `None` for a file that must be read whole.
    pub open: OpenCells,
    /// Absent where the format is only read.
    pub write: Option<DenseWriter>,
}

/// The ways to write a dense BRDF.
pub(crate) struct DenseWriter {
    /// From memory.
    pub whole: fn(&Path, DenseFile) -> Result<DenseFile, FileError>,
    /// From memory, of any channels.
    pub channels: fn(&Path, &DenseChannels) -> Result<(), FileError>,
    /// Row by row, as they are made.
    pub by_rows: WriteRows,
    /// The standard errors that belong to it.
    pub error_bars: WriteErrorBars,
}

/// Opens a file for [`CellReader`], where it can be.
pub(crate) type OpenCells = fn(&Path) -> Result<Option<Box<dyn CellReader>>, FileError>;

/// See [`crate::dense::write_dense_by_rows`].
pub(crate) type WriteRows = fn(&Path, Grid, &RowsNote<'_>, MakeRows<'_>) -> Result<(), FileError>;

/// What the file of a dense BRDF that is made row by row says of it.
pub struct RowsNote<'a> {
    /// What the channels are.
    pub channels: &'a Channels,
    /// Whether the values are 1/sr.
    pub scale: Scale,
    /// Where the data came from, by name.
    pub provenance: &'a BTreeMap<String, String>,
}

/// Makes all rows of a dense BRDF and gives each to a function, in no order and from several threads.
pub type MakeRows<'a> = &'a mut dyn FnMut(&TakeRow<'_>) -> io::Result<()>;

/// Takes a row of light in some channels: its number, the numbers of the channels, and of each the values of all
/// views.
pub type TakeRow<'a> = dyn Fn(usize, &[usize], &[&[f32]]) -> io::Result<()> + Sync + 'a;

/// Standard errors of a dense BRDF of any channels.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelErrors {
    /// What the planes are of.
    pub channels: Channels,
    /// A plane a channel, in the unit of the values.
    pub standard_error: Vec<Vec<f32>>,
    /// An [`Origin`](gonia_brdf::interpolate::Origin) a cell.
    pub origin: Vec<u8>,
}

/// The standard errors of a row of light, with what they consist of.
pub struct ErrorRow {
    /// Combined, a list of views a channel, in the unit of the values.
    pub combined: Vec<Vec<f32>>,
    /// Of each part ([`ERROR_PARTS`]) as a share of the value, mean over the channels.
    pub parts: [Vec<f32>; ERROR_PARTS.len()],
}

/// What standard errors consist of: noise and interpolation, directions, the values' scale. Names of the channels that
/// hold them.
pub const ERROR_PARTS: [&str; 3] = ["noise", "direction", "scale"];

/// Combines the standard errors of a row of light from those of noise and interpolation alone: the number of the
/// light, and of each channel the views.
pub type CombineErrors<'a> = dyn Fn(usize, &[&[f32]]) -> ErrorRow + Sync + 'a;

/// See [`crate::dense::write_error_bars`].
pub(crate) type WriteErrorBars = fn(
    &Path,
    Grid,
    ChannelErrors,
    Option<&CombineErrors<'_>>,
    Scale,
    &BTreeMap<String, String>,
) -> Result<(), FileError>;

/// A file open for reading single cells.
pub(crate) trait CellReader: Send {
    /// The grid.
    fn grid(&self) -> Grid;

    /// What the channels are.
    fn channels(&self) -> &Channels;

    /// Whether the values are 1/sr.
    fn scale(&self) -> Scale;

    /// Where the data came from, by name.
    fn provenance(&self) -> &BTreeMap<String, String>;

    /// The value of a cell, by the indices of its light and view directions, in a channel.
    ///
    /// # Errors
    /// When the file cannot be read, or the value is NaN or infinite.
    fn cell(&self, light: usize, view: usize, channel: usize) -> Result<f32, FileError>;
}

/// Samples of colours as a file holds them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SamplesRead {
    /// The samples, in the order of the file.
    pub samples: Vec<Sample>,
    /// Whether their values are 1/sr, where the file says so.
    pub scale: Option<Scale>,
    /// Where they came from, by name, where a note says it that was written of these samples.
    pub provenance: BTreeMap<String, String>,
    /// What was assumed of the file, and what in it cannot be trusted.
    pub remarks: Vec<Remark>,
}

/// Samples of any channels as a file holds them.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelsRead {
    /// The samples, in the order of the file.
    pub values: SampleValues,
    /// Whether their values are 1/sr, where the file says so.
    pub scale: Option<Scale>,
    /// Where they came from, by name, where a note says it that was written of these samples.
    pub provenance: BTreeMap<String, String>,
    /// What was assumed of the file, and what in it cannot be trusted.
    pub remarks: Vec<Remark>,
}

impl From<SampleValues> for ChannelsRead {
    fn from(values: SampleValues) -> Self {
        Self {
            values,
            scale: None,
            provenance: BTreeMap::new(),
            remarks: Vec::new(),
        }
    }
}

impl ChannelsRead {
    /// The same as colours: one value is a grey.
    ///
    /// # Errors
    /// Bands, which are no colours.
    pub(crate) fn into_rgb(self, path: &Path) -> Result<SamplesRead, FileError> {
        let samples = match self.values {
            SampleValues::Rgb(samples) => samples,
            SampleValues::Channels(samples) if samples.channels == Channels::Single => {
                samples.of_channels([0; 3])
            }
            SampleValues::Channels(samples) => {
                return Err(FileError::new(
                    path,
                    format_args!("has no r, g, b but {}", samples.channels),
                    "only gonia fill and gonia query take bands: fill them, and give the dense BRDF",
                ));
            }
        };
        Ok(SamplesRead {
            samples,
            scale: self.scale,
            provenance: self.provenance,
            remarks: self.remarks,
        })
    }
}

/// What is known of samples beside their rows.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SampleNote {
    /// Whether their values are 1/sr, where that is known.
    pub scale: Option<Scale>,
    /// Where they came from, by name: what made them, rig, plan, versions.
    pub provenance: BTreeMap<String, String>,
}

/// Writes samples whole, and what is known of them.
pub(crate) type WriteSamples = fn(&Path, &[Sample], Option<&SampleNote>) -> Result<(), FileError>;

/// Writes samples of other channels than colours whole, and what is known of them.
pub(crate) type WriteChannelSamples =
    fn(&Path, &ChannelSamples, Option<&SampleNote>) -> Result<(), FileError>;

/// How samples are written.
pub(crate) struct SampleWriter {
    /// Of colours.
    pub rgb: WriteSamples,
    /// Of other channels.
    pub channels: WriteChannelSamples,
}

/// How samples are read and written.
pub(crate) struct SampleFormat {
    /// Reads a file whole.
    pub read: ReadSamples,
    /// Writes a file whole, with what is known of the samples where it can hold that. Absent where the
    /// format is only read.
    pub write: Option<SampleWriter>,
    /// Whether its files hold what is known of the samples.
    pub holds_notes: bool,
}

/// See [`crate::samples::read_samples`].
pub(crate) type ReadSamples = fn(&Path) -> Result<ChannelsRead, FileError>;

/// A format of another group, which `gonia import` reads.
pub struct ForeignFormat {
    /// Whose format it is and its ending: `UTIA .bin`.
    pub name: &'static str,
    /// What its files hold, and how they are read.
    pub content: ForeignContent,
}

/// Reads another group's file.
pub type ReadForeign = fn(&Path) -> Result<Box<dyn ForeignBrdf>, FileError>;

/// What a file of another group holds.
pub enum ForeignContent {
    /// A BRDF that has a value for every pair of directions.
    Brdf {
        /// Whether its values are 1/sr; `None` where nobody knows.
        scale: Option<Scale>,
        /// Reads a file, which may fail with one line that names it.
        read: ReadForeign,
    },
    /// Samples, with directions that were not measured.
    Samples {
        /// Whether their values are 1/sr; `None` where nobody knows.
        scale: Option<Scale>,
        /// Reads a file, which may fail with one line that names it.
        read: fn(&Path) -> Result<Vec<Sample>, FileError>,
    },
}

/// Another group's BRDF, with what its file does not hold.
pub trait ForeignBrdf: Brdf {
    /// Values that the file does not hold, and what became of them; `None` where it holds all.
    fn gaps(&self) -> Option<Gaps>;

    /// The last polar angle that the file holds, degrees: beyond it values are those there.
    fn last_deg(&self) -> f64 {
        90.0
    }
}

/// Values that a file does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gaps {
    /// Values without a measurement.
    pub missing: u64,
    /// All values of the file.
    pub of: u64,
    /// What stands in their place.
    pub instead: &'static str,
    /// Evaluations so far that such a value went into.
    pub evaluations: u64,
}
