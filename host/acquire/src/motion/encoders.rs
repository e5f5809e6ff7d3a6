//! The simulated arms' encoders, calibrated as at the bench.

use crate::capture::Arms;
use crate::link::{CalibrateError, RemoteController, calibrate_axis};
use gonia_brdf::Elementary;
use gonia_protocol::settings::Axis;
use gonia_sim::fault::Arm;
use gonia_sim::rig::SimRig;

/// What an electronic autocollimator repeats to: a second of arc, degrees.
const AUTOCOLLIMATOR_DEG: f64 = 0.0003;

/// Calibrates every axis of a simulated rig against its true shaft angles, read as an autocollimator on a
/// polygon would read them. It takes some minutes of the rig's own time.
///
/// # Errors
/// A fault under way, or readings that make no map.
pub fn calibrate_encoders(rig: &SimRig, arms: &mut Arms) -> Result<(), CalibrateError> {
    let theta: Vec<i32> = (0..10).map(|i| i * 9_700_000).collect();
    let phi: Vec<i32> = (0..24).map(|i| -180_000_000 + i * 15_000_000).collect();
    for (axis, stands) in [(Axis::Theta, &theta), (Axis::Phi, &phi)] {
        for arm in [Arm::Light, Arm::Camera] {
            let mut n = 0.0;
            let mut autocollimator = |_: &mut RemoteController, _: f64| {
                n += 1.0;
                let scatter = AUTOCOLLIMATOR_DEG * (2.4 * n).sine();
                Ok(rig.true_deg(arm)[axis.index()] + scatter)
            };
            let controller = match arm {
                Arm::Light => arms.light(),
                Arm::Camera => arms.camera(),
            };
            calibrate_axis(controller, axis, stands, true, &mut autocollimator)?;
        }
    }
    Ok(())
}
