//! A measurement like that of Ngan, Durand and Matusik (2005): strips of the material, cut at
//! different azimuths, on a cylinder under a light that goes round it, seen by a fixed camera.
//!
//! What the paper tells of theirs: 20 strips, 16 hours, 1,924,494 samples, noisy. What is assumed
//! here: the cylinder leans from the camera by −60° to 60°, the light goes round in the horizontal
//! plane, the noise is 1 % of a white surface's radiance in every pixel, whatever the light's cosine,
//! and 3 % of the value for what strips differ in.

use gonia_brdf::Elementary;
use gonia_brdf::direction::dot;
use gonia_brdf::{Brdf, Direction, Sample, Vec3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

const STRIPS: usize = 20;
/// Leanings of the cylinder, positions of the light, and normals across the visible half.
const LEANINGS: usize = 13;
const LIGHTS: usize = 35;
const NORMALS: usize = 41;
/// Standard deviation of the radiance, of which a white surface that faces the light has 1/π.
const PIXEL_NOISE: f64 = 0.01 / PI;
/// Standard deviation between strips.
const STRIP_NOISE: f64 = 0.03;
/// Polar angles beyond this are not used.
const THETA_MAX_DEG: f64 = 86.0;

/// Samples of a material (in 1/sr, or near it) as such a measurement would give them.
pub fn measure_on_strips(material: &dyn Brdf, seed: u64) -> Vec<Sample> {
    let least_cosine = THETA_MAX_DEG.to_radians().cosine();
    (0..LEANINGS * LIGHTS)
        .into_par_iter()
        .flat_map_iter(|image| {
            let leaning = spread(image / LIGHTS, LEANINGS, 60.0).to_radians();
            let around = spread(image % LIGHTS, LIGHTS, 170.0).to_radians();
            // The camera looks along −z; the axis of the cylinder leans in the plane of y and z.
            let view = [0.0, 0.0, 1.0];
            let light = [around.sine(), 0.0, around.cosine()];
            let (s, c) = leaning.sine_cosine();
            let axis = [0.0, c, s];
            (0..NORMALS).flat_map(move |k| {
                let across = spread(k, NORMALS, 85.0).to_radians();
                let normal = [across.sine(), -s * across.cosine(), c * across.cosine()];
                let beside = cross(axis, normal);
                let local = |v: Vec3| [dot(v, beside), dot(v, axis), dot(v, normal)];
                let (l, v) = (local(light), local(view));
                let seen = l[2] > least_cosine && v[2] > least_cosine;
                (0..STRIPS).filter(move |_| seen).map(move |strip| {
                    let turn = TAU * strip as f64 / STRIPS as f64;
                    let (l, v) = (turned(l, turn), turned(v, turn));
                    let f = material.eval(l, v);
                    let index = (image * NORMALS + k) * STRIPS + strip;
                    let rgb = [0, 1, 2].map(|c| {
                        let pixel = PIXEL_NOISE * normal_number(seed, 3 * index + c) / l[2];
                        let own = STRIP_NOISE * normal_number(!seed, 3 * strip + c);
                        // A raw value below zero is no value: such cameras clip at black.
                        (f[c] * (1.0 + own) + pixel).max(1e-4) as f32
                    });
                    let (l, v) = (Direction::from_vec3(l), Direction::from_vec3(v));
                    Sample::new(l, v, rgb).in_frame(image as u32)
                })
            })
        })
        .collect()
}

/// The k-th of n numbers from −limit to limit.
fn spread(k: usize, n: usize, limit: f64) -> f64 {
    limit * (2.0 * k as f64 / (n - 1) as f64 - 1.0)
}

fn turned(v: Vec3, angle: f64) -> Vec3 {
    let (s, c) = angle.sine_cosine();
    [v[0] * c - v[1] * s, v[0] * s + v[1] * c, v[2]]
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// A nearly normal number from a counter: the sum of four uniform ones.
fn normal_number(seed: u64, counter: usize) -> f64 {
    let mut x = seed ^ (counter as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^= x >> 31;
    let sum: f64 = (0..4).map(|k| f64::from((x >> (16 * k)) as u16)).sum();
    (sum / 65536.0 - 2.0) * 3f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::model::Lambert;

    #[test]
    fn strips_see_the_material_with_the_noise_that_is_said() {
        let grey = Lambert { albedo: [0.5; 3] };
        let samples = measure_on_strips(&grey, 7);
        assert!(samples.len() > 100_000, "{}", samples.len());
        let within = |range: std::ops::Range<f32>| {
            let errors: Vec<f64> = samples
                .iter()
                .filter(|s| range.contains(&s.theta_i_deg))
                .map(|s| f64::from(s.rgb[1]) * PI / 0.5 - 1.0)
                .collect();
            let n = errors.len() as f64;
            (
                errors.iter().sum::<f64>() / n,
                (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
            )
        };
        let (mean, rms) = within(0.0..30.0);
        assert!(
            mean.abs() < 0.02 && (0.025..0.05).contains(&rms),
            "{mean} {rms}"
        );
        assert!(within(80.0..86.0).1 > 2.0 * rms);
        assert_eq!(measure_on_strips(&grey, 7), samples);
    }

    #[test]
    fn light_and_view_keep_their_angle() {
        let grey = Lambert { albedo: [0.5; 3] };
        let sample = measure_on_strips(&grey, 1)[100];
        let around = spread(sample.frame as usize % LIGHTS, LIGHTS, 170.0);
        let at = |t: f32, p: f32| Direction::from_deg(t.into(), p.into()).to_vec3();
        let light = at(sample.theta_i_deg, sample.phi_i_deg);
        let view = at(sample.theta_v_deg, sample.phi_v_deg);
        let between = dot(light, view).arc_cosine().to_degrees();
        assert!((between - around.abs()).abs() < 1e-3);
    }
}
