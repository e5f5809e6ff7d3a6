//! A capture folder that gonia did not make: frames drawn here, by the conventions alone, of a
//! material whose values are known.
#![allow(clippy::unwrap_used)]

mod common;

use common::{gonia_ok, text};
use gonia_brdf::Elementary;
use gonia_brdf::Sample;
use gonia_formats::samples::read_samples;
use gonia_rig::Scale;
use std::f64::consts::PI;
use std::path::Path;

const PX: usize = 300;
const FOCAL_PX: f64 = 470.0;

const RIG: &str = "\
[light]
distance_m = 1.1
[camera]
distance_m = 1.8
width_px = 300
height_px = 300
focal_px = 470.0
centre_px = [150.0, 150.0]
[target]
line_offset_mm = 335.0
line_width_mm = 4.0
material_half_mm = 320.0
[sampling]
disc_radius_mm = 277.0
grid_mm = 14.0
patch_mm = 14.0
";

/// θi, φi, θv, φv of each pose, degrees, and the material's albedo there, per channel.
const POSES: [([f64; 4], [f64; 3]); 3] = [
    ([30.0, 60.0, 0.0, 0.0], [0.3, 0.2, 0.1]),
    ([0.0, 0.0, 45.0, 90.0], [0.5, 0.4, 0.3]),
    ([60.0, 200.0, 60.0, 310.0], [0.05, 0.1, 0.6]),
];
const REFERENCE: [f64; 3] = [0.99, 0.98, 0.97];

fn vector(theta_deg: f64, phi_deg: f64) -> [f64; 3] {
    let (t, p) = (theta_deg.to_radians(), phi_deg.to_radians());
    [t.sine() * p.cosine(), t.sine() * p.sine(), t.cosine()]
}

/// Where the ray through a pixel meets the target, metres.
fn target_point(theta_deg: f64, phi_deg: f64, column: f64, row: f64) -> [f64; 2] {
    let d = vector(theta_deg, phi_deg);
    let (t, p) = (theta_deg.to_radians(), phi_deg.to_radians());
    let right = [-p.sine(), p.cosine(), 0.0];
    let up = [-t.cosine() * p.cosine(), -t.cosine() * p.sine(), t.sine()];
    let (x, y) = ((column - 150.0) / FOCAL_PX, (150.0 - row) / FOCAL_PX);
    let ray: Vec<f64> = (0..3).map(|k| x * right[k] + y * up[k] - d[k]).collect();
    let s = -1.8 * d[2] / ray[2];
    [1.8 * d[0] + s * ray[0], 1.8 * d[1] + s * ray[1]]
}

/// Irradiance of an uneven lamp.
fn irradiance(theta_deg: f64, phi_deg: f64, point: [f64; 2], uneven: f64) -> f64 {
    let d = vector(theta_deg, phi_deg).map(|c| 1.1 * c);
    let to_light = [d[0] - point[0], d[1] - point[1], d[2]];
    let r2: f64 = to_light.iter().map(|c| c * c).sum();
    let beam = 1.0 + uneven * (point[0] - 0.5 * point[1]);
    7.0 * beam * d[2] / r2.sqrt() * (1.1 * 1.1 / r2)
}

/// Draws a frame: 4 × 4 points a pixel.
fn draw(pose: [f64; 4], albedo: [f64; 3], uneven: f64) -> Vec<[f32; 3]> {
    let [theta_i, phi_i, theta_v, phi_v] = pose;
    let mut pixels = Vec::with_capacity(PX * PX);
    for row in 0..PX {
        for column in 0..PX {
            let mut sum = [0.0; 3];
            for k in 0..16 {
                let offset = |j: usize| (j as f64 + 0.5) / 4.0;
                let point = target_point(
                    theta_v,
                    phi_v,
                    column as f64 + offset(k % 4),
                    row as f64 + offset(k / 4),
                );
                let line = |x: f64| (x.abs() - 0.335).abs() <= 0.002;
                let rho = if point[0].abs() <= 0.32 && point[1].abs() <= 0.32 {
                    albedo
                } else if line(point[0]) || line(point[1]) {
                    [0.9; 3]
                } else {
                    [0.03; 3]
                };
                let e = irradiance(theta_i, phi_i, point, uneven);
                for c in 0..3 {
                    sum[c] += rho[c] / PI * e / 16.0;
                }
            }
            pixels.push(sum.map(|v| v as f32));
        }
    }
    pixels
}

/// Writes an EXR with nothing of gonia's.
fn write_exr(path: &Path, pixels: &[[f32; 3]]) {
    exr::prelude::write_rgb_file(path, PX, PX, |x, y| {
        let [r, g, b] = pixels[y * PX + x];
        (r, g, b)
    })
    .unwrap();
}

fn write_folder(folder: &Path, rig: &str, with_reference: bool, uneven: f64) {
    std::fs::create_dir_all(folder.join("shots")).unwrap();
    std::fs::write(folder.join("rig.toml"), rig).unwrap();
    let mut csv = String::from("file,frame,role,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg\n");
    for (k, (pose, albedo)) in POSES.iter().enumerate() {
        let mut shot = |role: &str, frame: usize, albedo| {
            let name = format!("shots/{role}{k}.exr");
            write_exr(&folder.join(&name), &draw(*pose, albedo, uneven));
            let [a, b, c, d] = pose;
            csv += &format!("{name},{frame},{role},{a},{b},{c},{d}\n");
        };
        shot("material", 10 + k, *albedo);
        if with_reference {
            shot("reference", 20 + k, REFERENCE);
        }
    }
    std::fs::write(folder.join("frames.csv"), csv).unwrap();
}

fn of_frame(samples: &[Sample], frame: u32) -> Vec<&Sample> {
    samples.iter().filter(|s| s.frame == frame).collect()
}

#[test]
fn a_known_reference_gives_absolute_values_under_an_uneven_lamp() {
    let folder = tempfile::tempdir().unwrap();
    let rig = format!("{RIG}[reference]\nreflectance = [0.99, 0.98, 0.97]\n");
    write_folder(folder.path(), &rig, true, 0.4);
    let printed = gonia_ok(&["process", text(folder.path())], "");
    assert!(printed.contains("absolute"), "{printed}");
    let read = read_samples(&folder.path().join("samples.npy")).unwrap();
    assert_eq!((read.scale, read.remarks), (Some(Scale::Absolute), vec![]));
    let samples = read.samples;
    for (k, (pose, albedo)) in POSES.iter().enumerate() {
        let here = of_frame(&samples, 10 + k as u32);
        assert!(here.len() >= 1200, "{} of 1225 points", here.len());
        for sample in &here {
            for c in 0..3 {
                let expected = albedo[c] / PI;
                let off = f64::from(sample.rgb[c]) / expected - 1.0;
                assert!(off.abs() < 0.005, "pose {k}, channel {c}: {off}");
            }
        }
        // The point nearest to the arms' own direction sees it within a grid step's parallax.
        let nearest = here
            .iter()
            .map(|s| {
                (f64::from(s.theta_v_deg) - pose[2]).abs()
                    + (f64::from(s.theta_i_deg) - pose[0]).abs()
            })
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 0.1, "{nearest}");
    }
}

#[test]
fn without_a_reference_values_follow_the_ideal_light_and_say_so() {
    let folder = tempfile::tempdir().unwrap();
    write_folder(folder.path(), RIG, false, 0.0);
    let output = folder.path().join("out.csv");
    let printed = gonia_ok(&["process", text(folder.path()), "-o", text(&output)], "");
    assert!(printed.contains("relative"), "{printed}");
    let read = read_samples(&output).unwrap();
    assert_eq!((read.scale, read.remarks), (Some(Scale::Relative), vec![]));
    let samples = read.samples;
    for (k, (_, albedo)) in POSES.iter().enumerate() {
        let here = of_frame(&samples, 10 + k as u32);
        assert!(here.len() >= 1200, "{} of 1225 points", here.len());
        for sample in here {
            // The lamp's irradiance at the centre is 7: relative values are 7 times the BRDF.
            let off = f64::from(sample.rgb[2]) / (7.0 * albedo[2] / PI) - 1.0;
            assert!(off.abs() < 0.01, "pose {k}: {off}");
        }
    }
}

#[test]
fn an_unknown_reference_at_three_poses_is_not_enough_for_equation_3() {
    let folder = tempfile::tempdir().unwrap();
    write_folder(folder.path(), RIG, true, 0.4);
    let output = common::gonia(&["process", text(folder.path())], "");
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(
        errors.contains("measure the reference over the whole plan"),
        "{errors}"
    );
    assert!(!folder.path().join("samples.npy").exists());
}
