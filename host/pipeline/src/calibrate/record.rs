//! A calibration as `rig.toml` and its table keep it.

use crate::calibrate::camera::priors;
use crate::calibrate::numbers::{Number, NumberState, Spread, direction_u};
use crate::calibrate::unknowns::{CAMERA, LIGHT, Unknown, values};
use gonia_brdf::Pose;
use gonia_rig::{Calibration, Rig};
use nalgebra::DMatrix;

/// Standard uncertainties of directions where the light stays as it was: nobody knows more of it than before.
pub fn direction_u_of_light_as_it_was(
    rig: &Rig,
    camera: &[f64],
    covariance: &DMatrix<f64>,
    poses: &[Pose],
) -> [Spread; 2] {
    let numbers = [camera, &values(&LIGHT, rig)].concat();
    let (n, all) = (camera.len(), numbers.len());
    let mut joined = DMatrix::zeros(all, all);
    joined.view_mut((0, 0), (n, n)).copy_from(covariance);
    for (k, prior) in priors(&LIGHT, rig).into_iter().enumerate() {
        joined[(n + k, n + k)] = prior * prior;
    }
    direction_u(rig, &[&CAMERA, &LIGHT], &numbers, &joined, poses)
}

/// The calibration as `rig.toml` keeps it, without its date.
pub fn record(
    numbers: &[Number],
    frames: usize,
    checksum: String,
    values: Vec<f64>,
    covariance: &DMatrix<f64>,
) -> Calibration {
    Calibration {
        date: String::new(),
        frames,
        checksum,
        names: numbers.iter().map(|n| n.name.to_owned()).collect(),
        values,
        u: numbers.iter().map(|n| n.u).collect(),
        covariance: covariance
            .row_iter()
            .map(|r| r.iter().copied().collect())
            .collect(),
    }
}

/// Rows of the table of numbers.
pub fn table(
    unknowns: &[Unknown],
    nominal: &[f64],
    found: &[f64],
    prior: &[f64],
    covariance: &DMatrix<f64>,
    states: &[NumberState],
) -> Vec<Number> {
    (0..unknowns.len())
        .map(|k| Number {
            name: unknowns[k].name,
            nominal: nominal[k],
            found: found[k],
            u: covariance[(k, k)].sqrt(),
            prior: prior[k],
            state: states[k],
        })
        .collect()
}
