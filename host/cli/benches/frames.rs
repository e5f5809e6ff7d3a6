//! Milliseconds a frame and stage on one core: decoding, registration, sampling, occlusion.
//!
//! `cargo bench -p gonia --bench frames [-- PX...]` prints a table, a row for each side of the frame in
//! pixels: CPU time of one thread, the median of several runs for each pose, then the mean over the
//! poses (in brackets the slowest pose). A second table has a row for each kind of EXR, of the largest
//! frame: from the file to its samples, by the rows that show the target and by all.

#![allow(clippy::expect_used)]

use gonia_brdf::model::Kurt;
use gonia_brdf::{Direction, Pose};
use gonia_formats::frame_exr::{read_frame, write_frame};
use gonia_imaging::{Registrar, SamplingGrid, find_occlusion};
use gonia_rig::{Frame, Rig};
use gonia_sim::scene::{Scene, SceneGeometry, Surface};
use std::sync::Arc;

mod clock;
mod kinds;
use clock::{mean, median_ms};

/// Poses over the plan's polar angles, one of them with the light's head in the way.
const POSES: [[f64; 4]; 7] = [
    [0.0, 0.0, 0.0, 0.0],
    [30.0, 140.0, 15.0, 60.0],
    [60.0, 20.0, 30.0, 200.0],
    [45.0, 100.0, 45.0, 100.0],
    [85.0, 300.0, 60.0, 18.0],
    [15.0, 240.0, 75.0, 45.0],
    [75.0, 165.0, 75.0, 345.0],
];

/// What the paper needs for an image, mostly to load it, milliseconds.
const PAPER_MS: f64 = 2500.0;

fn main() {
    let asked: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let sizes = if asked.is_empty() {
        vec![512, 1024, 2048, 4096]
    } else {
        asked
    };
    println!(
        "| px | Mpx | decode | register | sample | both | occlusion | paper's 2.5 s over all |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for px in sizes.iter().copied() {
        let rig = Rig::paper(px);
        let registrar = Registrar::new(&rig);
        let grid = SamplingGrid::new(&rig);
        let (mut register, mut sample, mut occlusion) = (Vec::new(), Vec::new(), Vec::new());
        for (shot, pose) in POSES.map(pose).into_iter().enumerate() {
            let which = [Surface::Material, Surface::Reference][shot % 2];
            let frame = render(px, which, pose, shot as u64);
            register.push(median_ms(|| {
                registrar.register(&frame, pose);
            }));
            let registration = registrar.register(&frame, pose);
            occlusion.push(median_ms(|| {
                find_occlusion(&frame, &registration, pose.light, &rig);
            }));
            let mask = find_occlusion(&frame, &registration, pose.light, &rig);
            sample.push(median_ms(|| {
                let values = grid.sample(&frame, &registration, mask.as_ref());
                assert_eq!(values.len(), grid.points_mm().len());
            }));
        }
        let decode = decode_ms(px);
        let both = mean(&register) + mean(&sample);
        println!(
            "| {px} | {:.1} | {decode:.1} | {:.1} ({:.1}) | {:.1} ({:.1}) | {both:.1} | {:.1} | {:.0} |",
            (px * px) as f64 / 1e6,
            mean(&register),
            dearest(&register),
            mean(&sample),
            dearest(&sample),
            mean(&occlusion),
            PAPER_MS / (decode + both),
        );
    }
    if let Some(px) = sizes.into_iter().max() {
        kinds::print(px);
    }
}

fn pose(angles: [f64; 4]) -> Pose {
    Pose {
        light: Direction::from_deg(angles[0], angles[1]),
        view: Direction::from_deg(angles[2], angles[3]),
    }
}

fn render(px: usize, which: Surface, pose: Pose, shot: u64) -> Frame {
    let scene = Scene::new(
        SceneGeometry::paper(px),
        Arc::new(Kurt::two_thread_fabric()),
        Arc::new(Kurt::white_reference_fabric()),
        1,
    );
    let rendered = scene.render(which, pose, shot);
    Frame {
        width: rendered.width,
        height: rendered.height,
        rgb: rendered.rgb,
    }
}

/// Reading an uncompressed half-float frame that the system holds in its cache.
fn decode_ms(px: usize) -> f64 {
    let noise = |i: usize| ((i * 2_654_435_761) % 1009) as f32 * 1e-3;
    let frame = Frame {
        width: px,
        height: px,
        rgb: (0..px * px).map(|i| [noise(i); 3]).collect(),
    };
    let file = std::env::temp_dir().join(format!("gonia-bench-{}.exr", std::process::id()));
    write_frame(&file, &frame).expect("the frame is written");
    let ms = median_ms(|| {
        read_frame(&file).expect("the frame is read");
    });
    std::fs::remove_file(&file).expect("the frame is removed");
    ms
}

fn dearest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}
