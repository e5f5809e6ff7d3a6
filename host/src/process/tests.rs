//! The whole chain from frames to samples against the simulator's truth.

use super::*;
use crate::dataset::FileError;
use crate::dataset::rig::Reference;
use crate::vision::simulated::{pose, render, rig, scene};
use gonia_brdf::Brdf;
use gonia_brdf::model::Kurt;
use gonia_sim::scene::{Scene, Surface};
use std::sync::Arc;

/// A source that renders its frames, at shaft angles a little off the reading.
struct Rendered {
    scene: Scene,
    rows: Vec<FrameRow>,
    error_deg: f64,
}

impl Rendered {
    fn new(scene: Scene) -> Self {
        Self {
            scene,
            rows: Vec::new(),
            error_deg: 0.01,
        }
    }

    fn add(&mut self, role: Role, angles: [f64; 4]) {
        let frame = self.rows.len() as u32;
        self.rows.push(FrameRow {
            frame,
            role,
            pose: pose(angles),
            file: format!("frames/{frame:06}.exr"),
        });
    }

    fn run(&self) -> Result<Processed, ProcessError> {
        process(&rig(&self.scene.geometry), self, &|_, _, _| ())
    }
}

impl FrameSource for Rendered {
    fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        let which = match row.role {
            Role::Material => Surface::Material,
            Role::Reference => Surface::Reference,
        };
        // ±1 or 0 times the error, different for each shaft and frame.
        let wobble =
            |k: u32| (f64::from((row.frame * 7 + k * 5) % 3) - 1.0) * self.error_deg.to_radians();
        let mut at = row.pose;
        at.light.theta += wobble(0);
        at.light.phi += wobble(1);
        at.view.theta += wobble(2);
        at.view.phi += wobble(3);
        Ok(render(&self.scene, which, at, u64::from(row.frame)))
    }
}

const POSES: [[f64; 4]; 6] = [
    [0.0, 0.0, 30.0, 300.0],
    [30.0, 60.0, 15.0, 180.0],
    [45.0, 200.0, 60.0, 20.0],
    [60.0, 90.0, 45.0, 250.0],
    [75.0, 15.0, 75.0, 120.0],
    [15.0, 120.0, 75.0, 300.0],
];

/// Mean and standard deviation of ln(value / truth) per frame, green channel.
fn errors(processed: &Processed, truth: &dyn Brdf) -> Vec<(u32, usize, f64, f64)> {
    let mut frames: Vec<u32> = processed.samples.iter().map(|s| s.frame).collect();
    frames.dedup();
    frames
        .into_iter()
        .map(|frame| {
            let logs: Vec<f64> = processed
                .samples
                .iter()
                .filter(|s| s.frame == frame)
                .map(|s| {
                    let at = |t: f32, p: f32| Direction::from_deg(t.into(), p.into()).to_vec3();
                    let f = truth.eval(
                        at(s.theta_i_deg, s.phi_i_deg),
                        at(s.theta_v_deg, s.phi_v_deg),
                    );
                    (f64::from(s.rgb[1]) / f[1]).ln()
                })
                .collect();
            let n = logs.len() as f64;
            let mean = logs.iter().sum::<f64>() / n;
            let sd = (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / n).sqrt();
            (frame, logs.len(), mean, sd)
        })
        .collect()
}

#[test]
fn explore() {
    for px in [400, 1024] {
        for error_deg in [0.0, 0.01] {
            let albedo = [0.9, 0.85, 0.8];
            let mut scene = scene(px);
            scene.reference = Arc::new(Kurt::new(albedo, &[]));
            let mut source = Rendered::new(scene.clone());
            source.error_deg = error_deg;
            for angles in POSES {
                source.add(Role::Reference, angles);
                source.add(Role::Material, angles);
            }
            let mut rig = rig(&scene.geometry);
            rig.reference = Some(Reference {
                reflectance: albedo,
            });
            let done = process(&rig, &source, &|_, _, _| ()).unwrap();
            println!(
                "{px} {error_deg} {:?} {:?} {:?}",
                done.compensation, done.left_out, done.offsets
            );
            for e in errors(&done, scene.material.as_ref()) {
                println!(
                    "  known {e:?} {:?}",
                    source.rows[e.0 as usize].pose.view.theta_deg()
                );
            }
            source.rows.retain(|r| r.role == Role::Material);
            source.scene.beam = None;
            let done = source.run().unwrap();
            println!(
                "{px} {:?} {:?} {:?}",
                done.compensation, done.left_out, done.offsets
            );
            for e in errors(&done, scene.material.as_ref()) {
                println!("  geo {e:?}");
            }
        }
    }
}
