//! A kernel of one's own in the default method, compared with the usual one.

use gonia_brdf::Elementary;
use gonia_brdf::hemisphere::{paper_lights, paper_views};
use gonia_brdf::interpolate::Kernel;
use gonia_brdf::model::Kurt;
use gonia_brdf::{Brdf, Sample};
use gonia_pipeline::{FillOptions, Options, Side, Table, compare, fill, silent};
use gonia_rig::{Scale, Stratum};
use std::error::Error;

// ANCHOR: kernel
/// Matérn 5/2: (1 + s + s²/3) e^{−s}, s = √5 distance / range. Smoother than gonia's Matérn 3/2.
struct Matern52;

impl Kernel for Matern52 {
    fn name(&self) -> &str {
        "Matern 5/2"
    }

    fn correlation(&self, s: f32) -> f32 {
        (1.0 + s + s * s / 3.0) * (-s).exponential()
    }

    fn scale(&self) -> f32 {
        5f32.sqrt()
    }
}
// ANCHOR_END: kernel

// ANCHOR: main
fn main() -> Result<(), Box<dyn Error>> {
    let fabric = Kurt::two_thread_fabric();
    let usual = FillOptions::with_step_deg(10.0);
    let own = FillOptions {
        kernel: &Matern52,
        ..usual
    };
    for (name, options) in [("Matérn 3/2", usual), ("Matérn 5/2", own)] {
        let filled = fill(samples_of(&fabric), Scale::Absolute, &options, &silent)?;
        let dense = filled.into_rgb()?;
        let table = Table::from(&dense);
        let figures = compare(table, Side::Model(&fabric), &Options::default())?;
        let interior = figures.stratum(Stratum::Interior).map(|row| row.log_rms);
        println!(
            "{name}: log RMS {:.4} (both θ ≤ 75°)",
            interior.unwrap_or(f64::NAN)
        );
    }
    Ok(())
}
// ANCHOR_END: main

/// One sample a pose, of every second pose of the paper's plan.
fn samples_of(material: &dyn Brdf) -> Vec<Sample> {
    let (lights, views) = (paper_lights(), paper_views());
    let poses = lights
        .iter()
        .flat_map(|l| views.iter().map(move |v| (*l, *v)));
    let samples = poses.enumerate().step_by(2).map(|(frame, (light, view))| {
        let f = material.eval(light.to_vec3(), view.to_vec3());
        Sample::new(light, view, f.map(|v| v as f32)).in_frame(frame as u32)
    });
    samples.collect()
}

#[test]
fn a_kernel_of_ones_own_interpolates() {
    main().unwrap();
}
