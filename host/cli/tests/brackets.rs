//! Raw exposures of a simulated sensor in a capture folder, through the program.
#![allow(clippy::unwrap_used)]

mod common;

use common::{gonia, gonia_ok, text};
use gonia_brdf::Elementary;
use gonia_brdf::model::Kurt;
use gonia_brdf::{Brdf, Direction, Pose};
use gonia_formats::frame_exr::read_frame;
use gonia_formats::raw_frame::write_raw;
use gonia_formats::rig_toml::write_rig;
use gonia_formats::samples::read_samples;
use gonia_rig::{Bayer, Frame, RawFrame, Reference, Rig, Sensor};
use gonia_sim::scene::{RawSensor, Scene, SceneGeometry, Surface};
use std::path::Path;
use std::sync::Arc;

const PX: usize = 400;
const ALBEDO: [f64; 3] = [0.9, 0.85, 0.8];
/// Counts a second of a radiance of one.
const COUNTS: f32 = 60_000.0;
const POSES: [[f64; 4]; 2] = [[30.0, 60.0, 15.0, 180.0], [60.0, 90.0, 45.0, 250.0]];

fn scene() -> Scene {
    let mut scene = Scene::new(
        SceneGeometry::paper(PX),
        Arc::new(Kurt::two_thread_fabric()),
        Arc::new(Kurt::new(ALBEDO, &[])),
        3,
    );
    scene.noise = None;
    scene
}

/// A capture folder of brackets of both poses and roles; `pattern` as for a Bayer sensor, else RGB.
fn write_folder(folder: &Path, pattern: Option<Bayer>, times: &[f64]) {
    let mut rig = Rig::paper(PX);
    rig.reference = Some(Reference::lambertian(ALBEDO));
    rig.sensor = Some(Sensor {
        black_counts: 64.0,
        saturation_counts: 3900.0,
        gain_e_per_count: 2.5,
        read_noise_e: 4.0,
        bayer: pattern,
    });
    write_rig(&folder.join("rig.toml"), &rig).unwrap();
    let device = RawSensor {
        black_counts: 64.0,
        white_counts: 4095.0,
        gain_e_per_count: 2.5,
        read_noise_e: 4.0,
    };
    let mut csv =
        "frame,role,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg,file,exposure_s\n".to_owned();
    let mut seed = 0;
    for (number, angles) in POSES.iter().enumerate() {
        for (role, surface) in [
            ("material", Surface::Material),
            ("reference", Surface::Reference),
        ] {
            let frame = scene().render(surface, pose(*angles), 0);
            let site = |(i, rgb): (usize, &[f32; 3])| match pattern {
                Some(pattern) => vec![rgb[pattern.colors()[i / PX % 2][i % PX % 2]]],
                None => rgb.to_vec(),
            };
            let rates: Vec<f32> = frame
                .rgb
                .iter()
                .enumerate()
                .flat_map(site)
                .map(|v| v * COUNTS)
                .collect();
            for time in times {
                seed += 1;
                let file = format!("{role}{number}-{time}.png");
                let raw = RawFrame {
                    width: PX,
                    height: PX,
                    channels: rates.len() / (PX * PX),
                    counts: device.expose(&rates, *time, seed),
                };
                write_raw(&folder.join(&file), &raw).unwrap();
                let [a, b, c, d] = angles;
                csv += &format!("{number},{role},{a},{b},{c},{d},{file},{time}\n");
            }
        }
    }
    std::fs::write(folder.join("frames.csv"), csv).unwrap();
}

fn pose(angles: [f64; 4]) -> Pose {
    Pose {
        light: Direction::from_deg(angles[0], angles[1]),
        view: Direction::from_deg(angles[2], angles[3]),
    }
}

#[test]
fn brackets_of_rgb_and_bayer_sensors_become_absolute_samples() {
    for pattern in [None, Some(Bayer::Rggb)] {
        let dir = tempfile::tempdir().unwrap();
        write_folder(dir.path(), pattern, &[0.05, 0.2, 0.8, 3.2]);
        let printed = gonia_ok(&["process", text(dir.path())], "");
        assert!(
            printed.contains("absolute") && printed.contains("0 saturated"),
            "{printed}"
        );
        let samples = read_samples(&dir.path().join("samples.npy"))
            .unwrap()
            .samples;
        assert_eq!(samples.len(), POSES.len() * 1225);
        let material = Kurt::two_thread_fabric();
        for frame in 0..POSES.len() as u32 {
            let here = samples.iter().filter(|s| s.frame == frame);
            let mut logs = Vec::new();
            for s in here {
                let at = |t: f32, p: f32| Direction::from_deg(t.into(), p.into()).to_vec3();
                let f = material.eval(
                    at(s.theta_i_deg, s.phi_i_deg),
                    at(s.theta_v_deg, s.phi_v_deg),
                );
                logs.extend((0..3).map(|c| (f64::from(s.rgb[c]) / f[c]).natural_log()));
            }
            let n = logs.len() as f64;
            let bias = logs.iter().sum::<f64>() / n;
            let rms = (logs.iter().map(|l| l * l).sum::<f64>() / n).sqrt();
            assert!(bias.abs() < 0.002, "{pattern:?} {frame}: bias {bias}");
            // At θi = 60° twelve pixels of the weakest channel hold some 2000 electrons each: 0.8 %,
            // and the reference's a third of that.
            assert!(rms < 0.01, "{pattern:?} {frame}: {rms}");
        }
        // What hid the reference is kept for other materials, here nothing.
        let masks = std::fs::read_to_string(dir.path().join("masks.csv")).unwrap();
        assert_eq!(masks.lines().count(), 1 + POSES.len());
    }
}

#[test]
fn saturated_patches_are_left_out_and_counted_and_merged_frames_can_be_looked_at() {
    let dir = tempfile::tempdir().unwrap();
    // Too long for the brighter half of the reference.
    write_folder(dir.path(), None, &[0.24, 0.8]);
    let printed = gonia_ok(&["process", text(dir.path())], "");
    let samples = read_samples(&dir.path().join("samples.npy"))
        .unwrap()
        .samples;
    assert!(samples.len() < POSES.len() * 1225, "{printed}");
    assert!(!printed.contains(" 0 saturated"), "{printed}");

    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (merged, variance, seen) = (file("m.exr"), file("v.exr"), file("s.png"));
    let folder = text(dir.path());
    let printed = gonia_ok(
        &[
            "rectify",
            folder,
            "1",
            "--as-taken",
            "-o",
            &merged,
            "--single",
            "--variance",
            &variance,
        ],
        "",
    );
    assert!(printed.contains("0.24 s and 0.8 s differ"), "{printed}");
    let (merged, variance) = (
        read_frame(Path::new(&merged)).unwrap(),
        read_frame(Path::new(&variance)).unwrap(),
    );
    let truth = scene().render(Surface::Material, pose(POSES[1]), 0);
    assert_scores(&merged, &variance, &truth.rgb);
    let printed = gonia_ok(
        &[
            "rectify",
            folder,
            "0",
            "--reference",
            "-o",
            &seen,
            "--px-per-mm",
            "0.5",
        ],
        "",
    );
    assert!(printed.contains("by 4 lines"), "{printed}");
    let bytes = std::fs::read(&seen).unwrap();
    assert!(bytes.starts_with(b"\x89PNG"));

    for (arguments, said) in [
        (vec!["9", "-o", &seen], "there is no material frame 9"),
        (vec!["0", "-o", "seen.gif"], "end the name in .exr or .png"),
        (
            vec!["0", "-o", &seen, "--px-per-mm", "1000"],
            "--px-per-mm 1000",
        ),
    ] {
        let output = gonia(&[&["rectify", folder], arguments.as_slice()].concat(), "");
        assert_eq!(output.status.code(), Some(1));
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(errors.contains(said), "{errors}");
    }
}

/// Values lie about the truth as their variance says.
fn assert_scores(merged: &Frame, variance: &Frame, truth: &[[f32; 3]]) {
    let (mut squares, mut n) = (0.0, 0.0);
    for ((value, variance), truth) in merged.rgb.iter().zip(&variance.rgb).zip(truth) {
        for c in 0..3 {
            // Where there is no light its noise makes half of the variances a little too large.
            if value[c].is_finite() && truth[c] > 0.01 {
                squares += f64::from((value[c] - COUNTS * truth[c]).powi(2) / variance[c]);
                n += 1.0;
            }
        }
    }
    assert!(n > 100_000.0, "{n}");
    assert!((squares / n - 1.0f64).abs() < 0.05, "{}", squares / n);
}

#[test]
fn exposures_that_disagree_and_sensors_that_are_not_described_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    write_folder(dir.path(), None, &[0.05, 0.2]);
    let refused = || {
        let output = gonia(&["process", text(dir.path())], "");
        assert_eq!(output.status.code(), Some(1));
        assert!(!dir.path().join("samples.npy").exists());
        String::from_utf8(output.stderr).unwrap()
    };
    let list = dir.path().join("frames.csv");
    let sound = std::fs::read_to_string(&list).unwrap();
    std::fs::write(&list, sound.replace(",0.2\n", ",0.25\n")).unwrap();
    let said = refused();
    assert!(
        said.contains("the exposures of 0.05 s and 0.25 s disagree by -20"),
        "{said}"
    );
    std::fs::write(&list, sound).unwrap();
    let rig = dir.path().join("rig.toml");
    let text = std::fs::read_to_string(&rig).unwrap();
    let (before, after) = text.split_once("[sensor]").unwrap();
    let after = &after[after.find("[sampling]").unwrap()..];
    std::fs::write(&rig, format!("{before}{after}")).unwrap();
    let said = refused();
    assert!(said.contains("rig.toml has no [sensor]"), "{said}");
}
