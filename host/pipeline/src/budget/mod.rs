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
//! standard uncertainty, with its sign, since one error acts in all cells. A cell of a reciprocal table has the
//! effects at its directions or those with light and view exchanged, by the shares in which samples lie on either side: the
//! root of their mean square. Effects are independent of each other;
//! the uncertainty of a cell is the root of their squares' sum, with that of noise and interpolation; that of a sum
//! over cells follows from each effect's sum.
//!
//! Not in it, because it is in the noise (it differs from frame to frame): registration, the edges of shadows, the
//! arms' scatter, shot noise. Neglected: polarisation, fluorescence, and light that enters the material at one
//! place and leaves it at another.

mod albedo;
mod cells;
mod contribution;
mod directions;
mod equation;
mod fits;
#[cfg(test)]
pub(crate) mod fixture;
mod patches;
mod poses;
mod record;
mod samples;
mod sides;
mod summary;

pub use albedo::{AlbedoUncertainty, albedo_uncertainty};
pub use cells::{CellUncertainty, combine_errors};
pub(crate) use cells::{PLACES, places, shape};
pub use contribution::Contribution;
pub use equation::{Effect, Effects, Equation, Part, Shape, Slant};
pub(crate) use fits::shared_errors;
pub(crate) use poses::fall_fact;
pub use poses::{fall_in, with_poses};
pub use record::budget_in;
pub use samples::scale_uncertainty;
pub(crate) use sides::SidesOfSamples;
pub use summary::{
    CellBudget, Holding, Shares, StratumBudget, coverage, not_stated, stated, summary,
};

use directions::direction_u;
use gonia_brdf::{Pose, Sample};
use gonia_rig::{
    Budget, Input, KnownFrom, ReferenceCalibration, Reflectance, ReflectanceTable, Rig,
};
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
    let level = level(rig, calibration, samples);
    Budget::new(calibration, level, lengths, of).with_frame(frame(rig, calibration, level))
}

/// Reflectance that the target's lines are taken to have: they are bright, so that they are found …
const LINES: f64 = 0.9;
/// … and of what else a frame shows: black paint or cloth.
const AROUND: f64 = 0.05;

/// The share of a frame from straight above that shows the sample, and what lines and the rest add to the sample's mean
/// over that share, in the unit of the values; of values without a unit, white is taken to be as bright as the samples'
/// mean.
fn frame(rig: &Rig, calibration: ReferenceCalibration, level: f64) -> [f64; 2] {
    let (camera, target) = (&rig.camera, &rig.target);
    let side_mm = 2.0 * target.material_half_mm;
    let side_px = |focal_px: f64| side_mm * focal_px / (1000.0 * camera.distance_m);
    let across = side_px(camera.focal_px) / camera.width_px as f64;
    let along = side_px(camera.focal_y_px.unwrap_or(camera.focal_px)) / camera.height_px as f64;
    let share = across.min(1.0) * along.min(1.0);
    let white = if calibration.is_absolute() {
        1.0 / PI
    } else {
        level
    };
    // Four lines, each as long as the square that they make.
    let lines = 8.0 * target.line_offset_mm * target.line_width_mm / (side_mm * side_mm);
    [
        share,
        white * (LINES * lines + AROUND * (1.0 / share - 1.0)),
    ]
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
            Reflectance::Lambertian(rho) => Some(sum(*rho) / PI),
            Reflectance::Table { table, .. } => {
                let factors: Vec<f64> = match table {
                    ReflectanceTable::ByIncidence(rows) => rows.iter().map(|r| sum(r.1)).collect(),
                    ReflectanceTable::ByPose(rows) => rows.iter().map(|r| sum(r.1)).collect(),
                };
                let n = factors.len() as f64;
                (n > 0.0).then(|| factors.iter().sum::<f64>() / n / PI)
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_rig::Reference;

    #[test]
    fn a_grey_references_table_is_the_level_that_counts_are_compared_at() {
        let mut rig = Rig::paper(100);
        rig.reference = Some(Reference::from(Reflectance::Table {
            file: "grey.csv".into(),
            table: ReflectanceTable::ByIncidence(vec![(8.0, [0.2; 3]), (60.0, [0.1; 3])]),
        }));
        let known = budget_of(&rig, ReferenceCalibration::KnownReference, &[]);
        assert!((known.level - 0.15 / PI).abs() < 1e-12, "{}", known.level);
        // Without a known reference it is the samples' mean.
        let [light, view] = [10.0, 20.0].map(|deg| gonia_brdf::Direction::from_deg(deg, 0.0));
        let sample = |value: f32| Sample::new(light, view, [value; 3]);
        let relative = ReferenceCalibration::GeometricModel;
        let mean = budget_of(&rig, relative, &[sample(0.2), sample(0.4)]).level;
        assert!((mean - 0.3).abs() < 1e-6, "{mean}");
    }
}
