//! A dense BRDF from numbers of one's own: directions in degrees, a value a channel.

use gonia_brdf::{Direction, Sample};
use gonia_pipeline::{FillOptions, fill, silent};
use gonia_rig::Scale;
use std::error::Error;

// ANCHOR: main
fn main() -> Result<(), Box<dyn Error>> {
    // θi, φi, θv, φv, value: here of a glossy lobe, every 15°. A row of a file would do as well.
    let mut samples = Vec::new();
    for (theta_i, phi_i) in around() {
        for (theta_v, phi_v) in around() {
            let f = glossy(theta_i, phi_i, theta_v, phi_v);
            let at = |theta: f32, phi: f32| Direction::from_deg(theta.into(), phi.into());
            // One channel is three alike.
            samples.push(Sample::new(at(theta_i, phi_i), at(theta_v, phi_v), [f; 3]));
        }
    }
    let options = FillOptions::with_step_deg(10.0);
    let filled = fill(samples, Scale::Absolute, &options, &silent)?;
    let (light, view) = (
        Direction::from_deg(40.0, 10.0),
        Direction::from_deg(35.0, 200.0),
    );
    let (found, truth) = (
        filled.dense.lookup(light, view)[0],
        glossy(40.0, 10.0, 35.0, 200.0),
    );
    println!(
        "f = {found:.4} 1/sr, true {truth:.4}; {}",
        filled.account.settings
    );
    Ok(())
}
// ANCHOR_END: main

fn around() -> impl Iterator<Item = (f32, f32)> {
    (0..6).flat_map(|ring| (0..12).map(move |k| (15.0 * ring as f32, 30.0 * k as f32)))
}

/// A diffuse part and a lobe about the mirror direction, 1/sr.
fn glossy(theta_i: f32, phi_i: f32, theta_v: f32, phi_v: f32) -> f32 {
    let vector = |theta: f32, phi: f32| Direction::from_deg(theta.into(), phi.into()).to_vec3();
    let (l, v) = (vector(theta_i, phi_i), vector(theta_v, phi_v));
    let h = [0, 1, 2].map(|k| l[k] + v[k]);
    let cos = h[2] / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
    (0.1 + 0.5 * cos.powi(20)) as f32
}

#[test]
fn numbers_become_a_brdf() {
    main().unwrap();
}
