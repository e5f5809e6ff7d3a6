//! Milliseconds a frame and stage on one core: rendering, registration, occlusion, sampling.
//!
//! `cargo bench -p gonia --bench frames`

use gonia::dataset::{Frame, Rig};
use gonia::vision::occlusion::find_occlusion;
use gonia::vision::{Registrar, SamplingGrid};
use gonia_brdf::model::Kurt;
use gonia_brdf::{Direction, Pose};
use gonia_sim::scene::{Scene, SceneGeometry, Surface};
use std::sync::Arc;
use std::time::Instant;

/// Poses over the plan's elevations, one of them with the light's head in the way.
const POSES: [[f64; 4]; 7] = [
    [0.0, 0.0, 0.0, 0.0],
    [30.0, 140.0, 15.0, 60.0],
    [60.0, 20.0, 30.0, 200.0],
    [45.0, 100.0, 45.0, 100.0],
    [85.0, 300.0, 60.0, 18.0],
    [15.0, 240.0, 75.0, 45.0],
    [75.0, 165.0, 75.0, 345.0],
];

fn main() {
    println!("   px   render  register  occlusion  sample   (CPU ms per frame, mean)");
    for px in [400, 512, 1024, 2048] {
        let scene = Scene::new(
            SceneGeometry::paper(px),
            Arc::new(Kurt::two_thread_fabric()),
            Arc::new(Kurt::white_reference_fabric()),
            1,
        );
        let rig = Rig::paper(px);
        let registrar = Registrar::new(&rig);
        let grid = SamplingGrid::new(&rig);
        let rounds = if px <= 512 { 16 } else { 2 };
        let mut times: [Vec<f64>; 4] = Default::default();
        for (shot, angles) in (0..rounds).flat_map(|r| POSES.iter().map(move |p| (r, p))) {
            let pose = Pose {
                light: Direction::from_deg(angles[0], angles[1]),
                view: Direction::from_deg(angles[2], angles[3]),
            };
            let which = [Surface::Material, Surface::Reference][shot as usize % 2];
            let mut lap = laps();
            let rendered = scene.render(which, pose, shot);
            times[0].push(lap());
            let frame = Frame {
                width: rendered.width,
                height: rendered.height,
                rgb: rendered.rgb,
            };
            lap();
            let registration = registrar.register(&frame, pose);
            times[1].push(lap());
            let mask = find_occlusion(&frame, &registration, pose.light, &rig);
            times[2].push(lap());
            let values = grid.sample(&frame, &registration, mask.as_ref());
            times[3].push(lap());
            assert_eq!(values.len(), grid.points_mm().len());
        }
        let [render, register, occlusion, sample] = times.map(mean);
        println!("{px:5} {render:8.2} {register:9.2} {occlusion:10.2} {sample:7.2}");
    }
}

/// Milliseconds of this thread's time since the last call.
fn laps() -> impl FnMut() -> f64 {
    let clock = Instant::now();
    let mut last = thread_ms(&clock);
    move || {
        let now = thread_ms(&clock);
        let spent = now - last;
        last = now;
        spent
    }
}

/// CPU time of this thread where the system tells it (Linux), so that a busy machine does not
/// blur the figures; elsewhere the wall clock's.
fn thread_ms(clock: &Instant) -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or(clock.elapsed().as_secs_f64() * 1e3, |ns| ns * 1e-6)
}

fn mean(values: Vec<f64>) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
