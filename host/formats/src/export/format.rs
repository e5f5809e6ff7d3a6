//! What a format of another program must bring along to be exported.

use crate::FileError;
use crate::format::ReadForeign;
use gonia_brdf::{Direction, Sample};
use gonia_rig::{DenseChannels, DenseFile, Remark};
use std::fmt;
use std::path::Path;

/// A format that a dense BRDF is exported in.
pub struct ExportFormat {
    /// Its name on the command line.
    pub name: &'static str,
    /// Whose format it is: `RGL .bsdf`.
    pub title: &'static str,
    /// The ending of its files in lower case, without the first dot.
    pub ending: &'static str,
    /// Programs that read it.
    pub readers: &'static str,
    /// What its values are.
    pub means: Meaning,
    /// Which channels it holds.
    pub holds: Holds,
    /// Which directions it holds.
    pub angles: &'static str,
    /// Where it holds the provenance; `None` where it has no place for it.
    pub provenance: Option<&'static str>,
    /// Whether it is a folder of files.
    pub is_folder: bool,
    /// What its size can be chosen by; `None` where it has one size.
    pub resolution: Option<Resolution>,
    /// About how far its directions lie apart, degrees, at a resolution: a table that is more than twice as coarse makes a
    /// file that looks finer than its data. Zero where its directions are the table's.
    pub step_deg: fn(usize) -> f64,
    /// How it is written, and read back.
    pub how: How,
}

impl ExportFormat {
    /// Whether it has a place for standard uncertainties.
    pub fn holds_uncertainties(&self) -> bool {
        matches!(self.how, How::Points { .. } | How::Table { .. })
    }
}

/// What the values of a format are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// 1/sr.
    Absolute,
    /// What the file says: absolute or relative.
    Stated,
}

impl fmt::Display for Meaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Absolute => "1/sr",
            Self::Stated => "1/sr or relative: the file says which",
        })
    }
}

/// The channels that a format holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holds {
    /// Three colours; one value becomes a grey, bands become colours.
    Colours,
    /// Three colours or one value; bands become colours.
    ColoursOrOne,
    /// One value: the luminance of colours and bands.
    One,
    /// Any: colours, one value, bands.
    Any,
}

impl fmt::Display for Holds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Colours => "colours",
            Self::ColoursOrOne => "colours, or one",
            Self::One => "one (luminance)",
            Self::Any => "any",
        })
    }
}

/// How a format is written, and how it is read back to say how far it is from its table.
pub enum How {
    /// Directions of its own: what is read back has a value at any pair of directions.
    Brdf {
        /// Writes a file whole.
        write: WriteColours,
        /// Reads it as readers of the format do.
        read: ReadForeign,
    },
    /// Directions of its own, and no agreed way between them: what is read back are samples.
    Samples {
        /// Writes a file whole.
        write: WriteColours,
        /// Reads it.
        read: fn(&Path) -> Result<Vec<Sample>, FileError>,
    },
    /// Some nodes of the table, in any channels.
    Points {
        /// Writes a file whole, at a resolution: the values, and their standard uncertainties where they are known (of
        /// the same channels and grid).
        write: WritePoints,
        /// Reads it.
        read: fn(&Path) -> Result<Vec<Point>, FileError>,
    },
    /// The table itself.
    Table {
        /// Writes a file whole: the table, and its standard uncertainties where they are known (the same
        /// channels and grid).
        write: WriteTable,
        /// Reads the table.
        read: fn(&Path) -> Result<DenseChannels, FileError>,
    },
}

/// Writes colours whole; what is to be said of the material in that format comes back.
pub type WriteColours = fn(&Path, &DenseFile, &ExportSettings) -> Result<Vec<Remark>, FileError>;

/// Writes a table whole, with its standard uncertainties.
pub type WriteTable = fn(&Path, &DenseChannels, Option<&DenseChannels>) -> Result<(), FileError>;

/// Writes nodes of a table whole, with their standard uncertainties; what is to be said of the file comes back.
pub type WritePoints =
    fn(&Path, &DenseChannels, Option<&DenseChannels>, usize) -> Result<Vec<Remark>, FileError>;

/// A value at a pair of directions in a channel, with its standard uncertainty where that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Towards the light.
    pub light: Direction,
    /// Towards the viewer.
    pub view: Direction,
    /// Number of the channel.
    pub channel: usize,
    /// The BRDF.
    pub value: f64,
    /// Its standard uncertainty, in the same unit.
    pub uncertainty: Option<f64>,
}

/// A number that the size of a file, and with it its error, is chosen by.
pub struct Resolution {
    /// The usual one.
    pub default: usize,
    /// The least that makes sense.
    pub least: usize,
    /// The most that readers and memory bear.
    pub most: usize,
    /// What it counts.
    pub of: &'static str,
}

/// How a dense BRDF is exported.
#[derive(Clone, Copy, Debug)]
pub struct ExportSettings {
    /// The format's [`Resolution`], within its bounds; of no meaning where it has none.
    pub resolution: usize,
    /// Whether the three colours are one value, which is written alone where a format can hold that.
    pub is_one_value: bool,
}
