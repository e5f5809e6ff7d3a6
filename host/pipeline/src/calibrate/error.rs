//! Why a rig cannot be calibrated.

use crate::process::ProcessError;
use crate::progress::Cancelled;
use gonia_imaging::{NoHighlight, Turn};

/// Why a rig cannot be calibrated. Each says in one line what was found and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// No frame can be used; the first one's reason.
    #[error(transparent)]
    Frames(ProcessError),
    /// Fewer frames than a calibration needs show the target.
    #[error(
        "a calibration needs {needed} frames that show the target, and there are {frames}: take some at other poses of the camera"
    )]
    TooFew {
        /// Frames there are.
        frames: usize,
        /// Frames that are needed.
        needed: usize,
    },
    /// No frame shows the four lines.
    #[error(
        "none of the {frames} frames shows the four fiducial lines: check the target's sizes and focal_px and distance_m in rig.toml, and look at a frame"
    )]
    NoLines {
        /// Frames that were looked at.
        frames: usize,
    },
    /// All views are alike.
    #[error(
        "all frames that show the target are of one direction of view (within {apart_deg:.0} degrees): take some at views {needed_deg:.0} degrees apart and more, and at other azimuths"
    )]
    OneDirection {
        /// How far views are apart, degrees.
        apart_deg: f64,
        /// How far they must be.
        needed_deg: f64,
    },
    /// Frames contradict each other.
    #[error(
        "the lines of {misfits} of {frames} frames do not fit one camera (frame {frame} by {misfit_px:.1} pixels): frames of two rigs, or a rig that was moved; calibrate each part by itself"
    )]
    TwoRigs {
        /// Frames that do not fit.
        misfits: usize,
        /// All that show the target.
        frames: usize,
        /// The first that does not fit.
        frame: u32,
        /// By how much, pixels.
        misfit_px: f64,
    },
    /// The orientation mark is beside another line than rig.toml has it.
    #[error(
        "the target is {turn} in {frames} of {of} frames that show its orientation mark{}: {}",
        first.map(|frame| format!(" (frame {frame} the first)")).unwrap_or_default(),
        match first {
            None => "turn it back and take the frames again; where it lay right, correct target.mark_mm, or turn the frames as the sensor saw them",
            Some(_) => "it was put back otherwise in between; calibrate each part by itself",
        }
    )]
    TargetTurned {
        /// How it lies.
        turn: Turn,
        /// Frames that show it so.
        frames: usize,
        /// All that show the mark.
        of: usize,
        /// The first of them, where others show it as it should lie.
        first: Option<u32>,
    },
    /// A frame of the mirror says nothing of the light.
    #[error(
        "mirror frame {frame} ({file}): {why}; put the arms where the camera sees the light in the middle of the mirror, in a dark room, and take it again, or leave its row out"
    )]
    NoHighlight {
        /// Its number.
        frame: u32,
        /// Its file.
        file: String,
        /// What it shows instead.
        why: NoHighlight,
    },
    /// The rig does not say how high a mirror lies.
    #[error(
        "{frames} frames are of a mirror, and rig.toml does not say how high it lies: give target.mirror_height_mm, how far its reflecting surface lies above the sample's (0 where it is flush), to 0.2 mm"
    )]
    NoMirrorHeight {
        /// Frames of a mirror.
        frames: usize,
    },
    /// The equations have no solution.
    #[error(
        "no rig near rig.toml's fits the frames: check its distances, the target's sizes and the poses in frames.csv"
    )]
    NoSolution,
    /// The caller has ended the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
