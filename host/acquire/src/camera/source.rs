//! What a camera is to a session.

use crate::program::ProgramError;
use gonia_formats::FileError;
use gonia_rig::{Frame, FrameRow};
use std::error::Error;
use std::io;

/// A trigger pulse that was given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// How long it was, and so the exposure, seconds.
    pub exposure_s: f64,
    /// When it rose, by the clock of the controller that gave it, µs.
    pub time_us: u64,
}

impl Pulse {
    /// With its length and its time.
    pub fn new(exposure_s: f64, time_us: u64) -> Self {
        Self {
            exposure_s,
            time_us,
        }
    }
}

/// Gives a frame for every shot of a session.
///
/// Frames and trigger pulses are matched by count: before each trigger the session says by
/// [`Camera::ready`] that what came until then belongs to earlier ones. A camera that numbers its
/// frames and stamps them with their time matches by these too ([`super::matching`]).
///
/// A camera of one's own implements this: `examples/own_camera.rs`.
pub trait Camera: Send {
    /// Maker, model, serial number, as a session's provenance keeps them. A session goes on only with
    /// the same camera.
    fn identity(&self) -> String;

    /// Makes ready for the next trigger, and discards all frames that came before it. The frames of
    /// `strays` pulses are not wanted; they may still be on their way, and are waited for. Returns the
    /// number of frames that belong to no pulse at all.
    ///
    /// # Errors
    /// The camera is gone.
    fn ready(&mut self, strays: usize) -> Result<usize, CameraError>;

    /// The frame of the shot that was triggered last, merged from the exposures of its pulses: linear
    /// radiance, of the size that the rig gives.
    ///
    /// # Errors
    /// No frame, or one that cannot be used; the shot can be taken again.
    fn fetch(&mut self, shot: &FrameRow, pulses: &[Pulse]) -> Result<Frame, CameraError>;

    /// Opens the camera anew after an error.
    ///
    /// # Errors
    /// It is still gone.
    fn reopen(&mut self) -> Result<(), CameraError>;

    /// Whether the exposure happens in [`Camera::fetch`], so that the arms must stand still for it.
    fn exposes_in_fetch(&self) -> bool {
        false
    }

    /// Whether the sample on the target changes by itself where a session turns from the reference to
    /// the material. On a bench a person does that.
    fn changes_the_sample(&self) -> bool {
        false
    }
}

/// Why there is no frame.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// It did not come in time.
    #[error(
        "{came} of {expected} frames came within {timeout_s} s of the trigger; check the camera and its trigger cable"
    )]
    Late {
        /// Frames that came.
        came: usize,
        /// Pulses given.
        expected: usize,
        /// How long it was waited for, seconds.
        timeout_s: f64,
    },
    /// Files came whose ending is not read, and none that is.
    #[error(
        "{came} of {expected} frames came within {timeout_s} s of the trigger, and \"{other}\", whose ending is not read; let the camera's program save exr, png, tif or tiff"
    )]
    Unread {
        /// Frames that came.
        came: usize,
        /// Pulses given.
        expected: usize,
        /// How long it was waited for, seconds.
        timeout_s: f64,
        /// A file that came.
        other: String,
    },
    /// More files than pulses.
    #[error(
        "{came} files came for {expected} trigger pulses ({files}); check the camera's trigger input, and that its program saves one file a frame"
    )]
    TooManyFiles {
        /// Files that came.
        came: usize,
        /// Pulses given.
        expected: usize,
        /// Their names.
        files: String,
    },
    /// More frames than pulses.
    #[error("{came} frames came for {expected} trigger pulses; check the camera's trigger input")]
    TooMany {
        /// Frames that came.
        came: usize,
        /// Pulses given.
        expected: usize,
    },
    /// Part of a frame was lost on the way.
    #[error(
        "frame {frame} of {expected} arrived incomplete ({status}); check the network, its packet size and the socket buffers"
    )]
    Incomplete {
        /// Which, from 1.
        frame: usize,
        /// Pulses given.
        expected: usize,
        /// In the library's words.
        status: String,
    },
    /// Frames came that are not of the shot's pulses, by their numbers or their times.
    #[error("the frames are not those of the trigger pulses: {0}; check the trigger cable")]
    OtherPulse(String),
    /// It came, and cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// The program that exposes a frame failed.
    #[error("the program {program} {source}; run it by hand as source.run in rig.toml has it")]
    Program {
        /// The program.
        program: String,
        /// What became of it.
        source: ProgramError,
    },
    /// `source.run` is empty.
    #[error("there is no program to run; name it in source.run in rig.toml")]
    NoProgram,
    /// The program did not leave a file for each pulse.
    #[error("the program left {came} files where {expected} are due; check {{file}} in source.run")]
    FilesOfProgram {
        /// Files that it left.
        came: usize,
        /// Pulses given.
        expected: usize,
    },
    /// The folder in which the program leaves its files.
    #[error("no temporary folder for the frame ({0}); check the disk")]
    TemporaryFolder(#[source] io::Error),
    /// A simulated camera without a trigger, or without the simulated arms that trigger it.
    #[error("the simulated camera saw no trigger; use it with the simulated arms")]
    NoTrigger,
    /// GenICam was left out of this program.
    #[error(
        "this gonia was built without GenICam: install libaravis-dev, and build it with --features genicam (docs/src/guides/camera.md)"
    )]
    NoGenicam,
    /// The rig lacks what a camera of raw frames needs.
    #[error(
        "rig.toml describes no sensor or no pixel format of the camera; add them (docs/src/guides/camera.md)"
    )]
    NoSensor,
    /// A camera on a network.
    #[error("the camera at {address}: {problem}; {remedy}")]
    Device {
        /// Its address.
        address: String,
        /// What is wrong.
        problem: String,
        /// What to do.
        remedy: &'static str,
        /// What the library or the system says.
        #[source]
        source: Option<Box<dyn Error + Send + Sync>>,
    },
    /// A camera of one's own: its error in its own words.
    #[error(transparent)]
    Other(Box<dyn Error + Send + Sync>),
}
