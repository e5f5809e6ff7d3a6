//! Calibrates one axis, its encoder and its gear, against a reference, at the bench.

use gonia_protocol::message::RequestOutcome;
use gonia_protocol::settings::{Axis, Key};

use crate::link::error_map::{ErrorMapFit, MapFitError, Reading, fit_error_map};
use crate::link::gear_map::{GearMapFit, GearReading, fit_gear_map};
use crate::link::{LinkError, RemoteController, Ticket};

/// Readings of the encoder that are averaged at a stand, and the time between two, µs.
const READINGS: i32 = 16;
const PAUSE_US: u64 = 20_000;
/// Longest homing or move, µs.
const LIMIT_US: u64 = 240_000_000;
/// While the map is measured, what it is for cannot be asked of the axis, µdeg.
const WIDE_UDEG: i32 = 1_000_000;
/// A gear is as regular as its map says when no more than this is left, RMS, degrees.
const REGULAR_GEAR_DEG: f64 = 0.0015;
/// How far steps and encoder may disagree on an axis with such a gear and such an encoder, µdeg: what
/// is left of both, at home and at the pose, is half of it.
const STEP_LOSS_LIMIT_UDEG: i32 = 10_000;

/// What a calibration has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderCalibration {
    /// The encoder's error over the turn.
    pub encoder: ErrorMapFit,
    /// The gear's over a turn of the worm; `None` where the stands do not tell.
    pub gear: Option<GearMapFit>,
    /// How far steps and encoder may disagree at rest from now on, µdeg.
    pub step_loss_limit_udeg: i32,
}

/// Why an axis was not calibrated. Its old settings are in use again after a restart.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// The link failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The readings make no map.
    #[error(transparent)]
    Fit(#[from] MapFitError),
    /// A move or homing did not end well.
    #[error("{arm}: {what} ended in {outcome:?}; clear the fault and begin again")]
    Ended {
        /// Which controller.
        arm: String,
        /// What it did.
        what: &'static str,
        /// How it ended.
        outcome: RequestOutcome,
    },
    /// The reference was not read.
    #[error("no reading of the reference: {0}")]
    Reference(String),
}

/// Visits `stands_udeg` of an axis without an error map, asks `reference` at each where the axis
/// truly is (degrees; it is told where the encoder says), fits a map, sets it, and homes again.
/// With `is_absolute` the reference's zero becomes the axis's; else only the shape is taken from it.
/// The same readings tell the gear's error, without which `steps_disagree` cannot be narrow. The
/// settings are in use, not yet saved.
///
/// # Errors
/// A fault under way, a reference that is not read, or readings that make no map.
pub fn calibrate_axis(
    arm: &mut RemoteController,
    axis: Axis,
    stands_udeg: &[i32],
    is_absolute: bool,
    reference: &mut dyn FnMut(&mut RemoteController, f64) -> Result<f64, String>,
) -> Result<EncoderCalibration, CalibrateError> {
    // Of both axes: the other one may not be calibrated yet, and homing homes both.
    let mut guards = Vec::new();
    for key in [Key::HomeTolerance, Key::StepLossLimit] {
        for axis in Axis::BOTH {
            guards.push((axis, key, arm.setting(axis, key)?));
            arm.set_setting(axis, key, WIDE_UDEG)?;
        }
    }
    for key in Key::ERROR_MAP {
        arm.set_setting(axis, key, 0)?;
    }
    home(arm)?;

    let mut target_udeg = [0; 2];
    for other in Axis::BOTH {
        target_udeg[other.index()] = arm.setting(other, Key::SoftMin)?;
    }
    let (mut readings, mut gear_readings) = (Vec::new(), Vec::new());
    for &stand in stands_udeg {
        target_udeg[axis.index()] = stand;
        let ticket = arm.move_to(target_udeg)?;
        end_well(arm, ticket, "a move")?;
        let encoder_deg = mean_encoder_deg(arm, axis)?;
        let reference_deg = reference(arm, encoder_deg).map_err(CalibrateError::Reference)?;
        readings.push(Reading {
            encoder_deg,
            reference_deg,
        });
        let commanded = arm.status()?.axes[axis.index()].commanded_udeg;
        gear_readings.push(GearReading {
            shaft_deg: if is_absolute {
                reference_deg
            } else {
                encoder_deg
            },
            ahead_deg: reference_deg - f64::from(commanded) * 1e-6,
        });
    }

    let counts = f64::from(arm.setting(axis, Key::EncoderCountsPerTurn)?);
    let zero = f64::from(arm.setting(axis, Key::EncoderZero)?);
    let fit = fit_error_map(&readings, zero / counts * 360.0)?;
    for (key, value) in Key::ERROR_MAP.into_iter().zip(fit.amplitudes_udeg) {
        arm.set_setting(axis, key, value)?;
    }
    if is_absolute {
        let moved = zero + (fit.zero_off_deg / 360.0 * counts).round();
        arm.set_setting(axis, Key::EncoderZero, moved.rem_euclid(counts) as i32)?;
    }
    let worm_turn_deg = f64::from(arm.setting(axis, Key::WormTurn)?) * 1e-6;
    let gear = fit_gear_map(&gear_readings, worm_turn_deg);
    let [cos, sin] = gear.map_or([0; 2], |gear| gear.amplitudes_udeg);
    arm.set_setting(axis, Key::GearCos, cos)?;
    arm.set_setting(axis, Key::GearSin, sin)?;
    home(arm)?;
    for (axis, key, value) in guards {
        arm.set_setting(axis, key, value)?;
    }
    let before_udeg = arm.setting(axis, Key::StepLossLimit)?;
    let step_loss_limit_udeg = match gear {
        Some(gear) if gear.rms_after_deg <= REGULAR_GEAR_DEG => {
            STEP_LOSS_LIMIT_UDEG.min(before_udeg)
        }
        _ => before_udeg.max(Key::StepLossLimit.default_of(axis)),
    };
    arm.set_setting(axis, Key::StepLossLimit, step_loss_limit_udeg)?;
    Ok(EncoderCalibration {
        encoder: fit,
        gear,
        step_loss_limit_udeg,
    })
}

/// Whether an axis has no error map: then nobody knows how far its encoder is off over the turn.
///
/// # Errors
/// The link failed.
pub fn is_uncalibrated(arm: &mut RemoteController, axis: Axis) -> Result<bool, LinkError> {
    for key in Key::ERROR_MAP {
        if arm.setting(axis, key)? != 0 {
            return Ok(false);
        }
    }
    Ok(true)
}

fn home(arm: &mut RemoteController) -> Result<(), CalibrateError> {
    let ticket = arm.home()?;
    end_well(arm, ticket, "homing")
}

fn end_well(
    arm: &mut RemoteController,
    ticket: Ticket,
    what: &'static str,
) -> Result<(), CalibrateError> {
    match arm.wait(ticket, LIMIT_US)?.outcome {
        RequestOutcome::Done => Ok(()),
        outcome => Err(CalibrateError::Ended {
            arm: arm.name().to_owned(),
            what,
            outcome,
        }),
    }
}

fn mean_encoder_deg(arm: &mut RemoteController, axis: Axis) -> Result<f64, LinkError> {
    let mut sum_deg = 0.0;
    for _ in 0..READINGS {
        arm.rest(PAUSE_US)?;
        sum_deg += f64::from(arm.status()?.axes[axis.index()].encoder_udeg) * 1e-6;
    }
    Ok(sum_deg / f64::from(READINGS))
}
