//! Speed over other arms: the same sessions on arms that are built otherwise than the one that the defaults are
//! made for, since a speed that suits one may be too much for the next.

use core::f64::consts::TAU;
use gonia_brdf::Pose;
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::arm::SimulatedArm;
use gonia_sim::fault::FaultPlan;
use gonia_sim::plant::PlantConfig;
use gonia_sim::rig::SimRig;
use rayon::prelude::*;

use super::sessions::{MotionRow, SPEED, row};

/// Speeds, deg/s: the default and what is faster.
const SPEEDS: [f64; 4] = [15.0, 20.0, 25.0, 30.0];

/// An arm, and how it differs from the default one.
#[derive(Clone, Copy, Debug)]
struct Build {
    name: &'static str,
    change: fn(&mut PlantConfig),
}

/// What a frequency and a damping of the swing mean.
fn swings(axis: &mut PlantConfig, hz: f64, damping: f64) {
    axis.ring_hz = hz;
    axis.ring_decay_s = 1.0 / (damping * TAU * hz);
}

const BUILDS: [Build; 7] = [
    Build {
        name: "own",
        change: |_| {},
    },
    // Twice the inertia: the swing is slower by √2, and the motor follows half the jump.
    Build {
        name: "twice as heavy",
        change: |axis| {
            swings(axis, 7.07, 0.08);
            axis.pull_in_steps_s /= 2.0;
        },
    },
    Build {
        name: "half the damping",
        change: |axis| swings(axis, 10.0, 0.04),
    },
    Build {
        name: "softer gear 6 Hz",
        change: |axis| swings(axis, 6.0, 0.08),
    },
    // The play of the approach's take-up (0.1°) less a margin.
    Build {
        name: "backlash 0.06 deg",
        change: |axis| axis.backlash_udeg = 60_000.0,
    },
    // At half the supply's voltage a stepper's torque ends at about half the speed.
    Build {
        name: "motor pulls out at 375 rpm",
        change: |axis| axis.pull_out_steps_s = 10_000.0,
    },
    Build {
        name: "motor pulls out at 300 rpm",
        change: |axis| axis.pull_out_steps_s = 8_000.0,
    },
];

/// What sessions on an arm came to at a speed.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmRow {
    /// How the arm is built.
    pub arm: &'static str,
    /// The sessions; the setting is the speed.
    pub row: MotionRow,
}

/// Every arm at every speed, over the same stretches of poses.
pub fn arm_rows(stretches: &[Vec<Pose>], seed: u64) -> Vec<ArmRow> {
    let jobs: Vec<(Build, f64)> = BUILDS
        .into_iter()
        .flat_map(|build| SPEEDS.map(|speed| (build, speed)))
        .collect();
    jobs.into_par_iter()
        .map(|(build, speed)| {
            let rig = SimRig::with_arms(seed, FaultPlan::default(), arms(build, seed));
            ArmRow {
                arm: build.name,
                row: row(&SPEED, speed, stretches, rig),
            }
        })
        .collect()
}

/// Light and camera, both built so.
fn arms(build: Build, seed: u64) -> [SimulatedArm; 2] {
    [1, 2].map(|i| {
        let axes = [(Axis::Theta, 21.3e6), (Axis::Phi, -12.8e6)].map(|(axis, start_udeg)| {
            let home_udeg = f64::from(Key::HomeAngle.default_of(axis));
            let mut plant = PlantConfig::worm_axis(home_udeg, start_udeg);
            (build.change)(&mut plant);
            plant
        });
        SimulatedArm::new(axes, seed.wrapping_mul(4).wrapping_add(i))
    })
}
