//! The shape that all lights share over half vectors, which the field `ndf` holds: the finer it is, the fewer places the
//! values themselves need, and it is held once and not for every light.

use super::warp::{cell, theta_of_place};
use gonia_brdf::direction::{Vec3, normalize};
use gonia_brdf::{DenseBrdf, Direction, Elementary};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Nodes of the shape a step of the values.
const FINER: usize = 4;
/// Most steps along each side.
const MOST: usize = 256;
/// Angle between the half vector and the light where the shape is taken, radians; less towards the horizon.
const DIFFERENCE: f64 = 20.0 * PI / 180.0;
/// The half vector's distance from the horizon that no light comes nearer to, radians.
const MARGIN: f64 = 4.0 * PI / 180.0;
/// Azimuths of the light about the half vector, whose mean is taken.
const AROUND: usize = 8;
/// Least value, of the mean.
const LEAST: f64 = 1e-3;

/// A positive function on the square of places of the half vector.
pub struct Shape {
    side: usize,
    values: Vec<f32>,
}

impl Shape {
    /// Of a table that is written with `side`² places: the geometric mean of f over pairs of light and view about each
    /// half vector.
    pub fn of(brdf: &DenseBrdf, side: usize) -> Self {
        let steps = (FINER * (side - 1)).min(MOST);
        let side = steps + 1;
        let node = |k: usize| {
            let place = [k % side, k / side].map(|i| i as f64 / steps as f64);
            around(brdf, place)
        };
        let logs: Vec<f64> = (0..side * side).into_par_iter().map(node).collect();
        let most = logs.iter().copied().fold(f64::MIN, f64::max);
        let least = most + LEAST.natural_log();
        let values = logs.iter().map(|log| log.max(least).exponential() as f32);
        Self {
            side,
            values: values.collect(),
        }
    }

    /// One everywhere: nothing is taken out.
    pub fn flat() -> Self {
        Self {
            side: 2,
            values: vec![1.0; 4],
        }
    }

    /// Nodes along each side.
    pub fn side(&self) -> usize {
        self.side
    }

    /// The nodes, the polar angle's fast.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Between the nodes, as readers have it.
    pub fn at(&self, place: [f64; 2]) -> f64 {
        let ([x, y], [u, v]) = cell([self.side; 2], place);
        let node = |dx, dy| f64::from(self.values[(y + dy) * self.side + x + dx]);
        let row = |dy| node(0, dy) + u * (node(1, dy) - node(0, dy));
        row(0) + v * (row(1) - row(0))
    }
}

/// The half vector at a place.
pub fn half_vector([u, v]: [f64; 2]) -> Vec3 {
    let (theta, phi) = (theta_of_place(u), TAU * v - PI);
    Direction { theta, phi }.to_vec3()
}

/// The mean of three channels.
pub fn mean([r, g, b]: [f64; 3]) -> f64 {
    (r + g + b) / 3.0
}

/// The mean logarithm of f over pairs of directions whose half vector is that of a place.
fn around(brdf: &DenseBrdf, place: [f64; 2]) -> f64 {
    let m = half_vector(place);
    let (theta, phi) = (theta_of_place(place[0]), TAU * place[1] - PI);
    let (sine, cosine) = DIFFERENCE
        .min(FRAC_PI_2 - MARGIN - theta)
        .max(0.0)
        .sine_cosine();
    // Two vectors at right angles to the half vector.
    let (st, ct) = theta.sine_cosine();
    let (sp, cp) = phi.sine_cosine();
    let (down, across) = ([ct * cp, ct * sp, -st], [-sp, cp, 0.0]);
    let logs = (0..AROUND).map(|k| {
        let (s, c) = (TAU * k as f64 / AROUND as f64).sine_cosine();
        let towards = |sign: f64| {
            let v = [0, 1, 2].map(|i| cosine * m[i] + sign * sine * (c * down[i] + s * across[i]));
            Direction::from_vec3(normalize(v))
        };
        let value = mean(brdf.lookup(towards(1.0), towards(-1.0)).map(f64::from));
        value.max(f64::MIN_POSITIVE).natural_log()
    });
    logs.sum::<f64>() / AROUND as f64
}
