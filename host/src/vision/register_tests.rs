//! Registration against the simulator's truth.

use super::camera::CameraShift;
use super::simulated::{pose, render, rig, scene};
use super::*;
use gonia_brdf::{Direction, Pose};
use gonia_sim::scene::{Scene, Surface};

const CORNERS: [[f64; 2]; 4] = [
    [-335.0, -335.0],
    [335.0, -335.0],
    [335.0, 335.0],
    [-335.0, 335.0],
];

/// Elevations and azimuths of the plan's rings, some of them parallel to the rows.
const VIEWS: [(f64, f64); 10] = [
    (0.0, 0.0),
    (15.0, 60.0),
    (30.0, 0.0),
    (45.0, 200.0),
    (45.0, 45.0),
    (60.0, 90.0),
    (60.0, 18.0),
    (75.0, 0.0),
    (75.0, 45.0),
    (75.0, 285.0),
];

/// Registers and returns the squared distances of the corners from the truth, pixels².
fn corner_errors(
    scene: &Scene,
    which: Surface,
    truth: Pose,
    reading: Pose,
) -> (Registration, Vec<f64>) {
    let rig = rig(&scene.geometry);
    let frame = render(scene, which, truth, 1);
    let found = Registrar::new(&rig).register(&frame, reading);
    let map = CameraModel::new(&rig.camera).predict(truth.view, CameraShift::default());
    let errors = CORNERS
        .iter()
        .map(|c| {
            let (a, b) = (found.pixel_from_target.apply(*c), map.apply(*c));
            (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
        })
        .collect();
    (found, errors)
}

#[test]
fn explore() {
    for px in [400, 1024] {
        let scene = scene(px);
        for which in [Surface::Material, Surface::Reference] {
            let mut all = vec![];
            for (tv, pv) in VIEWS {
                for light in [(30.0, 140.0), (85.0, 150.0)] {
                    let truth = pose([light.0, light.1, tv, pv]);
                    let reading = Pose {
                        light: truth.light,
                        view: Direction::from_deg(tv + 0.02, pv - 0.02),
                    };
                    let t = std::time::Instant::now();
                    let (found, errors) = corner_errors(&scene, which, truth, reading);
                    let ms = t.elapsed().as_secs_f64() * 1e3;
                    let rms = (errors.iter().sum::<f64>() / 4.0).sqrt();
                    println!(
                        "{px} {which:?} {tv} {pv} light {light:?}: rms {rms:.4} px scatter {:.4} blur {:.3} offset {:?} {:?} {ms:.1} ms",
                        found.residual_px, found.blur_px, found.pose_offset, found.state
                    );
                    all.extend(errors);
                }
            }
            println!(
                "== {px} {which:?} RMS {:.4}",
                (all.iter().sum::<f64>() / all.len() as f64).sqrt()
            );
        }
    }
}
