//! How well a calibrated rig knows its directions.

use crate::calibrate::numbers::direction_variances;
use gonia_brdf::Pose;
use gonia_rig::Rig;

/// Step of numeric derivatives, in standard uncertainties.
const STEP: f64 = 0.05;

/// Standard uncertainties of the light's and of the camera's direction, degrees a component, as the rig's
/// calibration leaves them: the root of their mean square over poses. `None` of what no calibration found.
pub fn direction_u(rig: &Rig, poses: &[Pose]) -> [Option<f64>; 2] {
    let Some(calibration) = &rig.calibration else {
        return [None; 2];
    };
    // A light that the calibration left as it was is known no better than before.
    let found = |table: &str| calibration.names.iter().any(|n| n.starts_with(table));
    let found = [found("light."), found("camera.")];
    let moved: Vec<Option<(f64, Rig)>> = calibration
        .names
        .iter()
        .zip(&calibration.u)
        .map(|(name, u)| {
            let mut rig = rig.clone();
            let number = rig.number_mut(name)?;
            *number += STEP * u;
            (*u > 0.0).then_some((STEP * u, rig))
        })
        .collect();
    let covariance = |j: usize, k: usize| {
        let row = calibration.covariance.get(j);
        row.and_then(|row| row.get(k)).copied().unwrap_or(0.0)
    };
    let mut mean = [0.0; 2];
    for pose in poses {
        let of = direction_variances(rig, &moved, covariance, *pose);
        for i in 0..2 {
            mean[i] += of[i] / poses.len() as f64;
        }
    }
    // Two components share the whole.
    [0, 1].map(|i| (found[i] && mean[i] > 0.0).then(|| (0.5 * mean[i]).sqrt().to_degrees()))
}
