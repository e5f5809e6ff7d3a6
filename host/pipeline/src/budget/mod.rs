//! The measurement equation: how well a value is known, beside its own scatter.
//!
//! With a known reference, a sample is
//!
//! ```text
//!            L(N) − o − s·S              ρ_R · (1 + a_i + a_v)
//! f(ωi, ωv) = ───────────────── · (1 + d) · ───────────────────── · E_R / E
//!            L(N_R) − o − s·S_R                    π
//! ```
//!
//! N are counts over exposure of material and reference, L the camera's curve, o its black level, s·S stray
//! light, d the lamp's drift between both, ρ_R the reference's reflectance with its departures a from a Lambertian
//! one, E_R / E the irradiance of a reference that is tilted or too high; and f is a mean over the cones of lamp,
//! lens and patch about directions that are known so far and no further.
//!
//! Each input ([`Input`](gonia_rig::Input)) has a standard uncertainty, stated in `rig.toml`, found by the calibration, or a cautious
//! default. [`Equation`] tells by which share each of these errors changes a value ([`Effect`]): an error of one
//! standard uncertainty, with its sign, since one error acts in all cells. Effects are independent of each other;
//! the uncertainty of a cell is the root of their squares' sum, with that of noise and interpolation; that of a sum
//! over cells follows from each effect's sum.
//!
//! Not in it, because it is in the noise (it differs from frame to frame): registration, the edges of shadows, the
//! arms' scatter, shot noise. Neglected: polarisation, fluorescence, and light that enters the material at one
//! place and leaves it at another.

mod cells;
mod directions;
mod equation;
mod record;
mod summary;

pub use cells::{CellUncertainty, combine_errors};
pub(crate) use cells::{PLACES, places, shape};
pub use equation::{Effect, Effects, Equation, Part, Shape, Slant};
pub use record::budget_in;
pub use summary::{StratumBudget, summary};

use directions::direction_u;
use gonia_brdf::{Pose, Sample};
use gonia_rig::{Budget, Input, KnownFrom, ReferenceCalibration, Rig};
use std::f64::consts::PI;

/// Name of the fact in the provenance of samples and dense BRDFs that is their [`Budget`].
pub const UNCERTAINTIES: &str = "uncertainties";

/// The budget of samples that were taken on a rig: of its own numbers, and of the directions that its calibration
/// leaves uncertain over these samples.
pub fn budget_of(rig: &Rig, calibration: ReferenceCalibration, samples: &[Sample]) -> Budget {
    let poses: Vec<Pose> = thinned(samples).map(pose_of).collect();
    let [light, view] = direction_u(rig, &poses);
    let of = |input: Input| {
        let found = match input {
            Input::LightDirection => light,
            Input::ViewDirection => view,
            _ => None,
        };
        match (rig.input(input), found) {
            ((_, KnownFrom::Default), Some(u)) => (u, KnownFrom::Calibration),
            (known, _) => known,
        }
    };
    let lengths = [
        1000.0 * rig.light.distance_m,
        1000.0 * rig.camera.distance_m,
        rig.sampling.patch_mm,
    ];
    Budget::new(calibration, level(rig, calibration, samples), lengths, of)
}

/// So many samples tell what holds for all of them.
const TOLD_BY: usize = 200;

fn thinned(samples: &[Sample]) -> impl Iterator<Item = &Sample> {
    samples
        .iter()
        .step_by(samples.len().div_ceil(TOLD_BY).max(1))
}

fn pose_of(sample: &Sample) -> Pose {
    let Sample {
        theta_i_deg,
        phi_i_deg,
        theta_v_deg,
        phi_v_deg,
        ..
    } = *sample;
    Pose::from_deg([theta_i_deg, phi_i_deg, theta_v_deg, phi_v_deg].map(f64::from))
}

/// The value whose counts the camera is compared at.
fn level(rig: &Rig, calibration: ReferenceCalibration, samples: &[Sample]) -> f64 {
    let sum = |values: [f64; 3]| values.iter().sum::<f64>() / 3.0;
    let known = match (&rig.reference, calibration) {
        (Some(reference), ReferenceCalibration::KnownReference) => match &reference.reflectance {
            gonia_rig::Reflectance::Lambertian(rho) => Some(sum(*rho) / PI),
            gonia_rig::Reflectance::Table { .. } => Some(1.0 / PI),
        },
        _ => None,
    };
    let mean = || {
        let n = samples
            .len()
            .div_ceil(samples.len().div_ceil(TOLD_BY).max(1));
        let all: f64 = thinned(samples).map(|s| sum(s.rgb.map(f64::from))).sum();
        all / n.max(1) as f64
    };
    // Of samples that are all zero or below, nothing can be a share.
    known.unwrap_or_else(mean).max(f64::from(f32::MIN_POSITIVE))
}
