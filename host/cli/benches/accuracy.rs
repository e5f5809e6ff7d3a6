//! How true samples are, against the simulator's truth, and what accuracy costs.
//!
//! `cargo bench -p gonia --bench accuracy [-- map|cost|hough] [--out DIR]` prints tables and writes
//! `accuracy.csv` and `accuracy.svg` (error by θi, θv and distance from the disc's centre) and
//! `accuracy_cost.csv` and `accuracy_cost.svg` (time against scatter over patch and resolution).

#![allow(clippy::expect_used)]

use gonia_brdf::Elementary;
use gonia_brdf::direction::{angle_between, local_direction};
use gonia_brdf::model::Kurt;
use gonia_brdf::{Direction, Pose};
use gonia_imaging::{IdealLight, Registrar, Registration, RegistrationState, SamplingGrid};
use gonia_rig::{CameraModel, CameraShift, Frame, Rig};
use gonia_sim::scene::{Noise, Scene, SceneGeometry, Surface, true_brdf};
use std::path::{Path, PathBuf};
use std::sync::Arc;

mod clock;
mod drawing;
use clock::{mean, median_ms};
use drawing::{Heat, Line, draw};

const THETA_I: [f64; 7] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0];
const THETA_V: [f64; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];
/// Standard error of a median over that of a mean, for normal noise and many values.
const MEDIAN: f64 = 1.2533;
/// Width of a ring about the disc's centre, mm.
const RING_MM: f64 = 31.0;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments
        .windows(2)
        .find(|pair| pair[0] == "--out")
        .map_or_else(std::env::temp_dir, |pair| PathBuf::from(&pair[1]));
    let only = |name: &str| {
        let named = ["map", "cost", "hough"]
            .iter()
            .any(|n| arguments.iter().any(|a| a == n));
        !named || arguments.iter().any(|a| a == name)
    };
    if only("map") {
        map(&out);
    }
    if only("cost") {
        cost(&out);
    }
    if only("hough") {
        hough();
    }
    println!("written to {}", out.display());
}

fn scene(px: usize) -> Scene {
    let mut scene = Scene::new(
        SceneGeometry::paper(px),
        Arc::new(Kurt::two_thread_fabric()),
        Arc::new(Kurt::white_reference_fabric()),
        1,
    );
    // An ideal light is what values are compared under.
    (scene.beam, scene.occluder) = (None, None);
    scene
}

fn pose(theta_i: f64, phi_i: f64, theta_v: f64, phi_v: f64) -> Pose {
    Pose {
        light: Direction::from_deg(theta_i, phi_i),
        view: Direction::from_deg(theta_v, phi_v),
    }
}

fn render(scene: &Scene, pose: Pose, shot: u64) -> Frame {
    let rendered = scene.render(Surface::Material, pose, shot);
    Frame {
        width: rendered.width,
        height: rendered.height,
        rgb: rendered.rgb,
    }
}

/// Errors of one sample.
struct SampleError {
    /// Distance from the disc's centre, mm.
    distance_mm: f64,
    /// ln(value / truth), green.
    log: f64,
    /// What noise makes of it at least: the standard error of a median over its pixels.
    limit: f64,
    direction_deg: f64,
}

/// Registers with a reading off by 0.02° and samples; errors against the truth.
fn errors(scene: &Scene, rig: &Rig, truth: Pose, shot: u64) -> Vec<SampleError> {
    let frame = render(scene, truth, shot);
    let reading = pose(
        truth.light.theta_deg(),
        truth.light.phi_deg(),
        truth.view.theta_deg() + 0.02,
        truth.view.phi_deg() - 0.02,
    );
    let found = Registrar::new(rig).register(&frame, reading);
    let grid = SamplingGrid::new(rig);
    let light = IdealLight::new(rig, truth.light);
    let back = CameraModel::new(rig)
        .predict(truth.view, CameraShift::default())
        .inverse()
        .expect("a camera above the target");
    let centre = true_brdf(scene.material.as_ref(), &scene.geometry, truth, [0.0; 2]);
    let typical = (centre.iter().sum::<f64>() / 3.0).min(std::f64::consts::FRAC_1_PI)
        * truth.light.theta.cosine();
    let Noise { shot, read } = scene.noise.unwrap_or(Noise {
        shot: 0.0,
        read: 0.0,
    });
    let values = grid.sample(&frame, &found, None);
    let mut out = Vec::new();
    for (at, value) in grid.points_mm().iter().zip(values) {
        let Ok(value) = value else { continue };
        let place = [0, 1].map(|i| at[i] + f64::from(value.offset_mm[i]));
        let f = true_brdf(scene.material.as_ref(), &scene.geometry, truth, place)[1];
        let radiance = f * light.irradiance(place);
        let pixel =
            ((shot * shot * typical * radiance) + (read * typical).powi(2)).sqrt() / radiance;
        out.push(SampleError {
            distance_mm: at[0].hypotenuse(at[1]),
            log: (f64::from(value.rgb[1]) / radiance).natural_log(),
            limit: MEDIAN * pixel / f64::from(value.pixels.max(1)).sqrt(),
            direction_deg: direction_error(
                &found,
                rig,
                truth,
                back.apply(found.project(place)),
                place,
            ),
        });
    }
    out
}

/// Angle between where light and camera are believed to be, seen from where a sample is believed to
/// be, and where they are, seen from where it is.
fn direction_error(
    found: &Registration,
    rig: &Rig,
    truth: Pose,
    there: [f64; 2],
    place: [f64; 2],
) -> f64 {
    let metres = |p: [f64; 2]| p.map(|c| c * 1e-3);
    let angle = |believed: Direction, true_one: Direction, distance: f64| {
        angle_between(
            local_direction(believed, distance, metres(place)),
            local_direction(true_one, distance, metres(there)),
        )
    };
    angle(truth.light, truth.light, rig.light.distance_m)
        .max(angle(found.view, truth.view, rig.camera.distance_m))
        .to_degrees()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for v in values {
        sum += v * v;
        n += 1.0;
    }
    (sum / f64::max(n, 1.0)).sqrt()
}

fn map(out: &Path) {
    let px = 1024;
    let (scene, rig) = (scene(px), Rig::paper(px));
    let mut csv = "theta_i_deg,theta_v_deg,distance_mm,samples,bias_percent,rms_percent,over_limit,direction_max_deg\n".to_owned();
    let mut sheets: [Vec<f64>; 4] = Default::default();
    let mut rings: Vec<Vec<SampleError>> = (0..9).map(|_| Vec::new()).collect();
    let mut all = Vec::new();
    for (i, theta_i) in THETA_I.into_iter().enumerate() {
        for (v, theta_v) in THETA_V.into_iter().enumerate() {
            // Azimuths that no symmetry of the fabric or of the grid singles out.
            let azimuth = |k: u64| 40.0 + 47.0 * (i + v) as f64 + 113.0 * k as f64;
            let found: Vec<SampleError> = (0..3)
                .flat_map(|k| {
                    let truth = pose(theta_i, azimuth(k), theta_v, azimuth(k) + 160.0);
                    errors(&scene, &rig, truth, 100 * i as u64 + 10 * v as u64 + k)
                })
                .collect();
            let of_rings = |ring: usize| {
                found
                    .iter()
                    .filter(move |e| (e.distance_mm / RING_MM) as usize == ring)
            };
            for ring in 0..9 {
                csv += &line_of(
                    &[theta_i, theta_v, (ring as f64 + 0.5) * RING_MM],
                    of_rings(ring),
                );
            }
            csv += &line_of(&[theta_i, theta_v, -1.0], found.iter());
            let summary = Summary::of(found.iter());
            sheets[0].push(100.0 * summary.rms);
            sheets[1].push(100.0 * summary.bias);
            sheets[2].push(summary.over_limit);
            sheets[3].push(summary.direction_max_deg);
            for error in found {
                rings[(error.distance_mm / RING_MM) as usize].push(error);
            }
        }
    }
    println!(
        "| distance from the centre, mm | samples | bias, % | scatter, RMS, % | scatter over the limit | direction, largest error, ° |"
    );
    println!("|---|---|---|---|---|---|");
    let mut lines: [Vec<(f64, f64)>; 2] = Default::default();
    for (ring, errors) in rings.iter().enumerate() {
        let s = Summary::of(errors.iter());
        let distance = (ring as f64 + 0.5) * RING_MM;
        println!("| {distance:.0} {}", s.cells());
        lines[0].push((distance, 100.0 * s.rms));
        lines[1].push((distance, 100.0 * s.bias));
    }
    all.extend(rings.into_iter().flatten());
    let s = Summary::of(all.iter());
    println!("| all {}", s.cells());
    let heat = |name, values: &[f64], signed| Heat {
        name,
        columns: &THETA_V,
        rows: &THETA_I,
        values: values.to_vec(),
        signed,
    };
    let heats = [
        heat("scatter, RMS, %", &sheets[0], false),
        heat("bias, mean, %", &sheets[1], true),
        heat("scatter over the median's limit", &sheets[2], false),
        heat("direction, largest error, degrees", &sheets[3], false),
    ];
    let [scatter, bias] = lines;
    let line = Line {
        name: "by distance from the disc's centre, %",
        x: "mm",
        series: vec![("scatter".into(), scatter), ("bias".into(), bias)],
        log: false,
    };
    write(&out.join("accuracy.csv"), &csv);
    write(&out.join("accuracy.svg"), &draw(&heats, &[line]));
}

struct Summary {
    samples: usize,
    bias: f64,
    rms: f64,
    over_limit: f64,
    direction_max_deg: f64,
}

impl Summary {
    /// The end of a table's row.
    fn cells(&self) -> String {
        format!(
            "| {} | {:+.3} | {:.3} | {:.2} | {:.4} |",
            self.samples,
            100.0 * self.bias,
            100.0 * self.rms,
            self.over_limit,
            self.direction_max_deg
        )
    }

    fn of<'a>(errors: impl Iterator<Item = &'a SampleError> + Clone) -> Self {
        let n = errors.clone().count();
        Self {
            samples: n,
            bias: errors.clone().map(|e| e.log).sum::<f64>() / n.max(1) as f64,
            rms: rms(errors.clone().map(|e| e.log)),
            over_limit: rms(errors.clone().map(|e| e.log / e.limit)),
            direction_max_deg: errors.map(|e| e.direction_deg).fold(0.0, f64::max),
        }
    }
}

fn line_of<'a>(key: &[f64; 3], errors: impl Iterator<Item = &'a SampleError> + Clone) -> String {
    let s = Summary::of(errors);
    let distance = if key[2] < 0.0 {
        "all".to_owned()
    } else {
        key[2].to_string()
    };
    format!(
        "{},{},{distance},{},{:.4},{:.4},{:.3},{:.5}\n",
        key[0],
        key[1],
        s.samples,
        100.0 * s.bias,
        100.0 * s.rms,
        s.over_limit,
        s.direction_max_deg
    )
}

/// Poses of the chart of costs.
const POSES: [[f64; 4]; 5] = [
    [30.0, 140.0, 0.0, 0.0],
    [15.0, 20.0, 30.0, 200.0],
    [45.0, 100.0, 45.0, 280.0],
    [60.0, 300.0, 60.0, 18.0],
    [30.0, 240.0, 75.0, 45.0],
];

fn cost(out: &Path) {
    println!(
        "| px | patch, mm | register and sample, ms | scatter, % | bias, % | scatter without noise, % |"
    );
    println!("|---|---|---|---|---|---|");
    let mut csv = "px,patch_mm,register_ms,sample_ms,rms_percent,clean_rms_percent\n".to_owned();
    let mut series = Vec::new();
    for px in [256, 512, 1024, 2048] {
        let noisy = scene(px);
        let mut clean = noisy.clone();
        clean.noise = None;
        let mut points = Vec::new();
        for patch in [3.5, 7.0, 10.0, 14.0, 20.0, 28.0] {
            let mut rig = Rig::paper(px);
            rig.sampling.patch_mm = patch;
            let (registrar, grid) = (Registrar::new(&rig), SamplingGrid::new(&rig));
            let (mut register, mut sample) = (Vec::new(), Vec::new());
            let (mut noise_errors, mut clean_errors) = (Vec::new(), Vec::new());
            for (shot, [a, b, c, d]) in POSES.into_iter().enumerate() {
                let at = pose(a, b, c, d);
                let frame = render(&noisy, at, shot as u64);
                let found = registrar.register(&frame, at);
                register.push(median_ms(|| registrar.register(&frame, at)));
                sample.push(median_ms(|| grid.sample(&frame, &found, None)));
                noise_errors.extend(errors(&noisy, &rig, at, shot as u64));
                clean_errors.extend(errors(&clean, &rig, at, shot as u64));
            }
            let (n, c) = (
                Summary::of(noise_errors.iter()),
                Summary::of(clean_errors.iter()),
            );
            let [register, sample] = [mean(&register), mean(&sample)];
            println!(
                "| {px} | {patch} | {:.1} | {:.3} | {:+.3} | {:.3} |",
                register + sample,
                100.0 * n.rms,
                100.0 * n.bias,
                100.0 * c.rms
            );
            csv += &format!(
                "{px},{patch},{register:.2},{sample:.2},{:.4},{:.4}\n",
                100.0 * n.rms,
                100.0 * c.rms
            );
            points.push((register + sample, 100.0 * n.rms));
        }
        series.push((format!("{px} px"), points));
    }
    let line = Line {
        name: "scatter in % over ms a frame; patches of 3.5, 7, 10, 14, 20, 28 mm",
        x: "ms",
        series,
        log: true,
    };
    write(&out.join("accuracy_cost.csv"), &csv);
    write(&out.join("accuracy_cost.svg"), &draw(&[], &[line]));
}

/// Hough is asked only when the lines are not where a trusted camera sees them: how often it leads
/// to them, and for how long it is at it.
fn hough() {
    println!(
        "| bin, half widths of a line | 512 px: ms | locked of 60 | 2048 px: ms | locked of 60 |"
    );
    println!("|---|---|---|---|---|");
    for resolution in [0.25, 0.5, 1.0, 2.0, 4.0] {
        let mut cells = Vec::new();
        for px in [512, 2048] {
            let (scene, rig) = (scene(px), Rig::paper(px));
            let registrar = Registrar::new(&rig).with_hough_resolution(resolution);
            let (mut locked, mut times) = (0, Vec::new());
            for [a, b, c, d] in POSES {
                let truth = pose(a, b, c, d);
                let frame = render(&scene, truth, 1);
                for k in 0..12 {
                    let off = 0.15 * f64::from(k + 1);
                    let turn = f64::from(k) * 2.4;
                    let reading = pose(a, b, c + off * turn.cosine(), d + off * turn.sine());
                    let found = registrar.register(&frame, reading);
                    locked += usize::from(found.state == RegistrationState::Locked);
                    if k == 4 {
                        times.push(median_ms(|| registrar.register(&frame, reading)));
                    }
                }
            }
            cells.push(format!("{:.1} | {locked}", mean(&times)));
        }
        println!("| {resolution} | {} | {} |", cells[0], cells[1]);
    }
}

fn write(path: &Path, text: &str) {
    std::fs::write(path, text).expect("the file is written");
}
