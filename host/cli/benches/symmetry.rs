//! What a known symmetry spares: error and time against the number of poses, with all poses of a plan and with those
//! that `gonia plan --symmetry` leaves, filled with the symmetry and without.
//!
//! `cargo bench -p gonia --bench symmetry [-- MATERIAL...] [--out DIR]` prints a table (CPU seconds of the fill, log
//! RMS by stratum), and draws it as `symmetry.svg`.

#![allow(clippy::expect_used)]

mod drawing;
mod measured;

use cpu_time::ProcessTime;
use drawing::{Line, draw};
use gonia_brdf::direction::{Vec3, normalize};
use gonia_brdf::model::{Ggx, Material};
use gonia_brdf::{Brdf, Elementary, Pose, SymmetryKind};
use gonia_pipeline::{FillOptions, fill, silent};
use gonia_plan::symmetry::is_needed;
use gonia_rig::{Scale, Stratum};
use measured::{compared, even, measure};
use std::sync::Arc;

/// About so many poses have the plans without a symmetry.
const POSES: [usize; 3] = [500, 1000, 2000];

/// A material, its symmetry, and the azimuth of its plane, degrees.
struct Case {
    name: &'static str,
    brdf: Arc<dyn Brdf>,
    symmetry: SymmetryKind,
    plane_deg: f64,
}

/// A lobe about a half vector that leans to azimuth 40°, over a base: alike on both sides of that plane alone.
struct Leaning;

impl Brdf for Leaning {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let h = normalize([0, 1, 2].map(|k| light[k] + view[k]));
        let (lean, azimuth) = (12f64.to_radians(), 40f64.to_radians());
        let axis = [
            lean.sine() * azimuth.cosine(),
            lean.sine() * azimuth.sine(),
            lean.cosine(),
        ];
        let cosine = (0..3).map(|k| h[k] * axis[k]).sum::<f64>();
        [0.05, 0.04, 0.03].map(|base| base + 0.3 * (60.0 * (cosine - 1.0)).exponential())
    }
}

/// Alike in all azimuths.
fn gloss() -> Ggx {
    Ggx {
        diffuse: [0.1, 0.2, 0.3],
        specular: [1.0; 3],
        f0: 0.04,
        alpha_x: 0.2,
        alpha_y: 0.2,
        azimuth_deg: 0.0,
    }
}

fn cases() -> [Case; 3] {
    let weave = Material::named("fabric").expect("a material").brdf;
    [
        Case {
            name: "weave",
            brdf: weave,
            symmetry: SymmetryKind::HalfTurnBilateral,
            plane_deg: 23.0,
        },
        Case {
            name: "isotropic gloss",
            brdf: Arc::new(gloss()),
            symmetry: SymmetryKind::Isotropic,
            plane_deg: 0.0,
        },
        Case {
            name: "leaning pile",
            brdf: Arc::new(Leaning),
            symmetry: SymmetryKind::Bilateral,
            plane_deg: 40.0,
        },
    ]
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments
        .iter()
        .position(|a| a == "--out")
        .map_or(".", |k| arguments[k + 1].as_str());
    println!(
        "| material | poses of | filled with | poses | CPU-s | interior | grazing | symmetry |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut cases = Vec::from(cases());
    let is_case = |name: &String| cases.iter().any(|case| case.name == name);
    let only: Vec<String> = arguments.iter().filter(|a| is_case(a)).cloned().collect();
    cases.retain(|case| only.is_empty() || only.iter().any(|name| name == case.name));
    let mut lines = Vec::new();
    for case in &cases {
        let spared = format!("--symmetry {}", case.symmetry.name());
        let ways = [
            ("the whole plan", "none", SymmetryKind::None),
            ("the whole plan", spared.as_str(), case.symmetry),
            (spared.as_str(), spared.as_str(), case.symmetry),
        ];
        let series = ways.map(|(plan, filled, symmetry)| {
            let points = POSES.map(|n| {
                let needed = |pose: &Pose| is_needed(pose, case.symmetry, case.plane_deg);
                let mut poses = even(n).listed();
                if plan == spared {
                    poses.retain(needed);
                }
                let (interior, row) = row(case, &poses, symmetry);
                println!(
                    "| {} | {plan} | {filled} | {} | {row} |",
                    case.name,
                    poses.len()
                );
                (poses.len() as f64, interior)
            });
            (format!("{plan}, {filled}"), points.to_vec())
        });
        lines.push(Line {
            name: case.name,
            x: "poses",
            series: series.to_vec(),
            log: true,
        });
    }
    let file = format!("{out}/symmetry.svg");
    std::fs::write(file, draw(&[], &lines)).expect("a folder to write to");
}

/// The error of the interior, and the row's last columns.
fn row(case: &Case, poses: &[Pose], symmetry: SymmetryKind) -> (f64, String) {
    let options = FillOptions {
        symmetry: Some(symmetry),
        ..FillOptions::with_step_deg(4.0)
    };
    let samples = measure(&*case.brdf, poses);
    let start = ProcessTime::now();
    let filled = fill(samples, Scale::Absolute, &options, &silent).expect("enough samples");
    let cpu_s = start.elapsed().as_secs_f64();
    let found = filled.account.symmetry.clone();
    let dense = filled.into_rgb().expect("colours").brdf;
    let figures = compared(&dense, &*case.brdf);
    let rms = |s| figures.stratum(s).map_or(f64::NAN, |f| f.log_rms);
    let interior = rms(Stratum::Interior);
    let row = format!(
        "{cpu_s:.1} | {interior:.4} | {:.4} | {found}",
        rms(Stratum::Grazing)
    );
    (interior, row)
}
