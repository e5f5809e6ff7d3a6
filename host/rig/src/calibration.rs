//! What a calibration of the rig's geometry found, and how well.

use serde::{Deserialize, Serialize};

/// The record of a calibration, as `rig.toml` keeps it. The numbers themselves stand at their keys of the
/// rig; here they stand again with their uncertainties, in one order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// When it was made, UTC, as `2026-11-27T08:00:00Z`.
    pub date: String,
    /// Frames that it stands on.
    pub frames: usize,
    /// Checksum of those frames: eight hexadecimal digits.
    pub checksum: String,
    /// Keys of the numbers that were found, with their tables: `camera.focal_px`; an element of an array
    /// has its index, from 0: `camera.centre_px[0]`.
    pub names: Vec<String>,
    /// Their values, in the units of their keys.
    pub values: Vec<f64>,
    /// Their standard uncertainties.
    pub u: Vec<f64>,
    /// Their covariance matrix, row by row; u² is its diagonal.
    pub covariance: Vec<Vec<f64>>,
}

impl Calibration {
    /// The standard uncertainty of a number, where the calibration found it.
    pub fn u_of(&self, name: &str) -> Option<f64> {
        let at = self.names.iter().position(|n| n == name)?;
        self.u.get(at).copied()
    }

    /// What contradicts itself in it, if anything does: lists of different lengths, or uncertainties that
    /// are none.
    pub(crate) fn fault(&self) -> Option<String> {
        let n = self.names.len();
        let sizes = [self.values.len(), self.u.len(), self.covariance.len()];
        if sizes.iter().any(|size| *size != n) || self.covariance.iter().any(|row| row.len() != n) {
            return Some(format!(
                "it has {n} names, but {} values, {} u and {} rows of covariance",
                sizes[0], sizes[1], sizes[2]
            ));
        }
        let sound = |u: &f64| u.is_finite() && *u >= 0.0;
        let wrong = self.u.iter().position(|u| !sound(u))?;
        Some(format!("u of {} is {}", self.names[wrong], self.u[wrong]))
    }
}
