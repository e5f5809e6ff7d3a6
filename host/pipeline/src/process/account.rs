//! What became of frames and points.

use gonia_imaging::{LeftOut, PoseOffset, Registration, RegistrationFailure, RegistrationState};
use gonia_rig::Role;
use std::ops::AddAssign;

/// What became of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameReport {
    /// Its number.
    pub frame: u32,
    /// What it shows.
    pub role: Role,
    /// Whether it was used, and on what ground.
    pub outcome: Outcome,
    /// RMS distance of the fiducial lines' points from the fitted lines, pixels.
    pub residual_px: f64,
    /// Estimated true camera direction minus the reading.
    pub pose_offset: PoseOffset,
}

/// Whether and how a frame was used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Registered by its fiducial lines.
    Locked,
    /// Used at the place its pose predicts, because too little of the fiducial lines can be seen.
    FellBack(RegistrationFailure),
    /// Not used.
    Refused(Refusal),
}

/// Why a frame was not used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// It does not show the target where the pose puts it.
    #[error("it does not show the target where its pose puts it: {0}")]
    NotTheTarget(RegistrationFailure),
    /// Its files cannot be read or are not of the rig's camera: the remark that names it says why.
    #[error("it cannot be read or is not of this rig's camera")]
    Unusable,
    /// No usable frame of the reference was taken at its pose.
    #[error("no usable frame of the reference was taken at its pose")]
    NoReference,
}

/// Fiducial lines of which fewer than this many are seen do not even show that the frame is of the
/// target.
const FEWEST_LINES: usize = 2;

impl Outcome {
    /// What a registration lets one do with its frame.
    pub fn of(registration: &Registration) -> Self {
        match registration.state {
            RegistrationState::Locked => Self::Locked,
            // Some lines are hidden; what is seen agrees with the pose.
            RegistrationState::FellBack(reason @ RegistrationFailure::LinesMissing { found })
                if found >= FEWEST_LINES =>
            {
                Self::FellBack(reason)
            }
            RegistrationState::FellBack(reason) => Self::Refused(Refusal::NotTheTarget(reason)),
        }
    }
}

/// Number of points of material frames that became no sample, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOutCounts {
    /// Something hid the target, in the frame or in the reference's.
    pub occlusion: u64,
    /// The patch reached beyond the material.
    pub mark: u64,
    /// The patch, or the reference's, held a pixel that was not a number.
    pub not_finite: u64,
    /// The patch, or the reference's, held a saturated pixel.
    pub saturated: u64,
    /// The patch reached beyond the frame.
    pub border: u64,
    /// The reference was not brighter than black there.
    pub dark_reference: u64,
    /// The light was below the horizon there.
    pub below_horizon: u64,
}

impl LeftOutCounts {
    /// Counts one point.
    pub fn count(&mut self, reason: LeftOut) {
        match reason {
            LeftOut::Occlusion => self.occlusion += 1,
            LeftOut::Mark => self.mark += 1,
            LeftOut::NotFinite => self.not_finite += 1,
            LeftOut::Saturated => self.saturated += 1,
            LeftOut::Border => self.border += 1,
        }
    }

    /// All of them.
    pub fn total(&self) -> u64 {
        self.occlusion
            + self.mark
            + self.not_finite
            + self.saturated
            + self.border
            + self.dark_reference
            + self.below_horizon
    }
}

impl AddAssign for LeftOutCounts {
    fn add_assign(&mut self, other: Self) {
        self.occlusion += other.occlusion;
        self.mark += other.mark;
        self.not_finite += other.not_finite;
        self.saturated += other.saturated;
        self.border += other.border;
        self.dark_reference += other.dark_reference;
        self.below_horizon += other.below_horizon;
    }
}

/// The distribution of a session's pose offsets, over its locked frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffsetStatistics {
    /// Locked frames.
    pub frames: usize,
    /// Mean offset of the camera's polar angle, degrees.
    pub theta_mean_deg: f64,
    /// Its standard deviation, degrees.
    pub theta_sd_deg: f64,
    /// Mean offset of the azimuth, degrees.
    pub phi_mean_deg: f64,
    /// Its standard deviation, degrees.
    pub phi_sd_deg: f64,
    /// The largest offset of either, degrees.
    pub largest_deg: f64,
}

impl OffsetStatistics {
    /// Over the locked ones among some frames; `None` where none is.
    pub fn of(frames: &[FrameReport]) -> Option<Self> {
        let locked = || {
            frames
                .iter()
                .filter(|f| f.outcome == Outcome::Locked)
                .map(|f| f.pose_offset)
        };
        let n = locked().count();
        if n == 0 {
            return None;
        }
        let moments = |of: fn(&PoseOffset) -> f64| {
            let mean = locked().map(|o| of(&o)).sum::<f64>() / n as f64;
            let variance = locked().map(|o| (of(&o) - mean).powi(2)).sum::<f64>() / n as f64;
            (mean, variance.sqrt())
        };
        let (theta_mean_deg, theta_sd_deg) = moments(|o| o.theta_deg);
        let (phi_mean_deg, phi_sd_deg) = moments(|o| o.phi_deg);
        Some(Self {
            frames: n,
            theta_mean_deg,
            theta_sd_deg,
            phi_mean_deg,
            phi_sd_deg,
            largest_deg: locked()
                .map(|o| o.theta_deg.abs().max(o.phi_deg.abs()))
                .fold(0.0, f64::max),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_those_of_locked_frames_alone() {
        let frame = |outcome, theta_deg| FrameReport {
            frame: 0,
            role: Role::Material,
            outcome,
            residual_px: 0.0,
            pose_offset: PoseOffset {
                theta_deg,
                phi_deg: 0.0,
            },
        };
        let lost = Outcome::FellBack(RegistrationFailure::LinesMissing { found: 2 });
        let frames = [
            frame(Outcome::Locked, 0.01),
            frame(Outcome::Locked, -0.03),
            frame(lost, 5.0),
        ];
        let statistics = OffsetStatistics::of(&frames).unwrap();
        assert_eq!(statistics.frames, 2);
        assert!((statistics.theta_mean_deg + 0.01).abs() < 1e-12);
        assert!((statistics.theta_sd_deg - 0.02).abs() < 1e-12);
        assert_eq!(statistics.largest_deg, 0.03);
        assert_eq!(OffsetStatistics::of(&frames[2..]), None);
    }
}
