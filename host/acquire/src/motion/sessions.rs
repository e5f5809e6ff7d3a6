//! Sessions of the real host and the real firmware core on the simulated rig, each with one setting
//! that differs from the default.

use crate::capture::{Arms, ShotOutcome, run_session};
use crate::link::{LinkError, RemoteController};
use gonia_brdf::Pose;
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::rig::SimRig;
use rayon::prelude::*;

/// A setting that trades time for accuracy, and the values that are tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor {
    /// Which setting.
    pub key: Key,
    /// Its unit in the chart.
    pub unit: &'static str,
    /// Setting's units in one of the chart's.
    pub scale: f64,
    /// What is tried, in the chart's unit.
    pub values: &'static [f64],
}

/// The speed.
pub(super) const SPEED: Factor = Factor {
    key: Key::MaxSpeed,
    unit: "deg/s",
    scale: 1e6,
    values: &[4.0, 7.0, 10.0, 15.0, 20.0, 25.0, 30.0, 39.0],
};

/// What is varied.
pub const FACTORS: [Factor; 5] = [
    Factor {
        key: Key::SettlingTime,
        unit: "ms",
        scale: 1e3,
        values: &[4.0, 20.0, 40.0, 60.0, 80.0, 120.0, 160.0, 240.0, 400.0],
    },
    Factor {
        key: Key::InPositionWindow,
        unit: "deg",
        scale: 1e6,
        values: &[0.002, 0.003, 0.004, 0.006, 0.008, 0.012, 0.02, 0.03],
    },
    SPEED,
    Factor {
        key: Key::Acceleration,
        unit: "deg/s2",
        scale: 1e6,
        values: &[15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 120.0, 180.0],
    },
    Factor {
        key: Key::JerkTime,
        unit: "ms",
        scale: 1e3,
        values: &[0.0, 25.0, 50.0, 75.0, 100.0, 125.0, 150.0, 200.0],
    },
];

/// What a session came to with one value of one setting.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionRow {
    /// The setting's name.
    pub setting: &'static str,
    /// Its unit here.
    pub unit: &'static str,
    /// Its value.
    pub value: f64,
    /// Whether it is the default.
    pub is_default: bool,
    /// Time from pose to pose, mean, seconds.
    pub pose_s: f64,
    /// Shots kept.
    pub kept: usize,
    /// Poses given up.
    pub given_up: usize,
    /// Faults that were recovered automatically.
    pub recoveries: u32,
    /// Largest |commanded − true shaft angle| of a kept shot's four axes, degrees: the median.
    pub p50_deg: f64,
    /// The 99th percentile.
    pub p99_deg: f64,
    /// The largest.
    pub max_deg: f64,
    /// Why the session ended early, if it did.
    pub stopped: Option<String>,
}

/// Every factor at every value, over stretches of neighbouring poses: the way from one stretch to the
/// next is not counted.
pub fn motion_rows(stretches: &[Vec<Pose>], seed: u64) -> Vec<MotionRow> {
    let jobs: Vec<(&Factor, f64)> = FACTORS
        .iter()
        .flat_map(|factor| factor.values.iter().map(move |value| (factor, *value)))
        .collect();
    jobs.into_par_iter()
        .map(|(factor, value)| {
            row(
                factor,
                value,
                stretches,
                SimRig::new(seed, FaultPlan::default()),
            )
        })
        .collect()
}

/// Sessions on this rig, with one setting at one value.
pub(super) fn row(factor: &Factor, value: f64, stretches: &[Vec<Pose>], rig: SimRig) -> MotionRow {
    let setting = (value * factor.scale).round() as i32;
    let mut row = MotionRow {
        setting: factor.key.meaning().name,
        unit: factor.unit,
        value,
        is_default: setting == factor.key.default_of(Axis::Theta),
        pose_s: f64::NAN,
        kept: 0,
        given_up: 0,
        recoveries: 0,
        p50_deg: f64::NAN,
        p99_deg: f64::NAN,
        max_deg: f64::NAN,
        stopped: None,
    };
    let (mut errors, mut steps_s) = (Vec::new(), Vec::new());
    let run = measure(
        &rig,
        factor.key,
        setting,
        stretches,
        &mut row,
        &mut errors,
        &mut steps_s,
    );
    row.stopped = run.err();
    errors.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let last = errors.len().saturating_sub(1);
        errors
            .get((last as f64 * share).round() as usize)
            .copied()
            .unwrap_or(f64::NAN)
    };
    (row.p50_deg, row.p99_deg, row.max_deg) = (at(0.5), at(0.99), at(1.0));
    row.pose_s = steps_s.iter().sum::<f64>() / steps_s.len() as f64;
    row
}

fn measure(
    rig: &SimRig,
    key: Key,
    setting: i32,
    stretches: &[Vec<Pose>],
    row: &mut MotionRow,
    errors: &mut Vec<f64>,
    steps_s: &mut Vec<f64>,
) -> Result<(), String> {
    let port = |arm| Box::new(rig.port(arm));
    let mut arms = Arms::connect(port(Arm::Light), port(Arm::Camera)).map_err(|e| e.to_string())?;
    for arm in [Arm::Light, Arm::Camera] {
        let controller = match arm {
            Arm::Light => arms.light(),
            Arm::Camera => arms.camera(),
        };
        set(controller, key, setting).map_err(|error| error.to_string())?;
    }
    for poses in stretches {
        let mut last_us = None;
        let summary = run_session(&mut arms, poses, &mut |outcome| {
            match outcome {
                ShotOutcome::Kept(shot) => {
                    if let Some(record) = rig.triggers().last() {
                        errors.push(largest_error_deg(&poses[shot.index], &record.pose()));
                    }
                    row.kept += 1;
                }
                ShotOutcome::Refused { .. } => row.given_up += 1,
            }
            let now_us = rig.now_us();
            if let Some(last_us) = last_us.replace(now_us) {
                steps_s.push((now_us - last_us) as f64 * 1e-6);
            }
            Ok(())
        });
        row.recoveries += summary.map_err(|error| error.to_string())?.recoveries;
    }
    Ok(())
}

fn set(controller: &mut RemoteController, key: Key, setting: i32) -> Result<(), LinkError> {
    for axis in Axis::BOTH {
        if key == Key::MaxSpeed {
            // Homing is no faster than the arm may be.
            let fast = Key::HomeFastSpeed.default_of(axis).min(setting);
            controller.set_setting(axis, Key::HomeFastSpeed, fast)?;
        }
        if key == Key::InPositionWindow {
            // No pulse is refused that settling has allowed.
            let window = Key::TriggerWindow.default_of(axis).max(setting);
            controller.set_setting(axis, Key::TriggerWindow, window)?;
        }
        controller.set_setting(axis, key, setting)?;
    }
    // A session compares the settings with those at the last hello.
    controller.reconnect().map(drop)
}

/// The largest difference of two poses over the four axes, degrees. Where θ is 0, φ has no meaning.
fn largest_error_deg(commanded: &Pose, truth: &Pose) -> f64 {
    let turn = |x: f64| ((x + 180.0).rem_euclid(360.0) - 180.0).abs();
    [(commanded.light, truth.light), (commanded.view, truth.view)]
        .into_iter()
        .map(|(a, b)| {
            let theta = (a.theta_deg() - b.theta_deg()).abs();
            let phi = turn(a.phi_deg() - b.phi_deg());
            if a.theta_deg() > 0.0 {
                theta.max(phi)
            } else {
                theta
            }
        })
        .fold(0.0, f64::max)
}
