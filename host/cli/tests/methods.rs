//! `gonia fill --method` and `gonia chart`, run as a user does, on a small plan.
#![allow(clippy::unwrap_used)]

mod common;

use common::{gonia, gonia_ok, text};
use gonia_brdf::direction::local_direction;
use gonia_brdf::hemisphere::directions;
use gonia_brdf::model::{Brdf, Kurt};
use gonia_brdf::{DenseBrdf, Direction, Grid, Sample};
use gonia_formats::dense::{read_dense, write_dense};
use gonia_formats::samples::write_samples;
use gonia_rig::{DenseFile, Scale};
use std::path::Path;

const STEP: &str = "15";

/// Samples of a cloth, and its truth on the grid.
fn data(folder: &Path) {
    let cloth = Kurt::two_thread_fabric();
    let arms = directions(&[(0.0, 1), (25.0, 6), (50.0, 8), (72.0, 10)]);
    let mut samples = Vec::new();
    for (l, light) in arms.iter().enumerate() {
        for (v, view) in arms.iter().enumerate() {
            for point in [[-0.2, 0.1], [0.0, 0.0], [0.1, 0.2]] {
                let i = local_direction(*light, 1.1, point);
                let o = local_direction(*view, 1.8, point);
                let (di, dv) = (Direction::from_vec3(i), Direction::from_vec3(o));
                samples.push(
                    Sample::new(di, dv, cloth.eval(i, o).map(|x| x as f32))
                        .in_frame((l * arms.len() + v) as u32),
                );
            }
        }
    }
    write_samples(&folder.join("samples.npy"), &samples).unwrap();
    let file = DenseFile {
        brdf: DenseBrdf::tabulate(Grid::with_step_deg(15.0).unwrap(), &cloth),
        scale: Scale::Absolute,
        provenance: [].into(),
    };
    write_dense(&folder.join("truth.exr"), file).unwrap();
}

#[test]
fn a_grid_is_filled_by_the_method_named_and_the_file_says_which() {
    let dir = tempfile::tempdir().unwrap();
    data(dir.path());
    let (samples, dense) = (dir.path().join("samples.npy"), dir.path().join("d.exr"));
    let fill = |method| {
        let (samples, dense) = (text(&samples), text(&dense));
        let arguments = ["fill", samples, "-o", dense, "--step", STEP, "--method"];
        gonia(&[&arguments[..], &[method]].concat(), "")
    };
    let output = fill("paper,k=50");
    assert!(output.status.success());
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("rbf-linear,k=50"), "{said}");
    let file = read_dense(&dense).unwrap();
    assert_eq!(file.provenance["interpolation"], "rbf-linear,k=50");
    let n = file.brdf.grid().n_directions();
    assert_eq!(file.brdf.at(30, 50), file.brdf.at(50, 30));
    assert_eq!(n, 6 * 24);

    std::fs::remove_file(&dense).unwrap();
    let output = fill("krige");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("thin-plate")
    );
    assert!(!dense.exists());
}

#[test]
fn charts_are_drawn_against_the_truth_and_against_frames_held_out() {
    let dir = tempfile::tempdir().unwrap();
    data(dir.path());
    let (samples, truth) = (dir.path().join("samples.npy"), dir.path().join("truth.exr"));
    let (with, without) = (dir.path().join("with"), dir.path().join("without"));
    let common = ["--step", STEP, "--tests", "200"];
    let methods = ["--method", "nearest", "--method", "paper,k=50"];
    let blocks = ["--method", "blocks=30,nodes=64,tolerance=inf"];
    let base = ["chart", text(&samples), "--truth", text(&truth)];
    let out = ["--out", text(&with)];
    gonia_ok(&[&base[..], &out, &common, &methods, &blocks].concat(), "");
    for name in ["methods.svg", "images.svg", "methods.csv", "images.csv"] {
        let written = std::fs::read_to_string(with.join(name)).unwrap();
        assert!(!written.contains("NaN"), "{name}");
    }
    let csv = std::fs::read_to_string(with.join("methods.csv")).unwrap();
    let figure = |method: &str, column: usize| {
        let mut reader = csv::Reader::from_reader(csv.as_bytes());
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        let row = rows
            .iter()
            .find(|r| &r[0] == method && &r[8] == "all")
            .unwrap();
        row[column].parse::<f64>().unwrap()
    };
    let (nearest, paper) = (figure("nearest", 10), figure("rbf-linear,k=50", 10));
    // On so coarse a plan the paper's method overshoots below zero; the nearest value cannot.
    assert!(nearest < 1.0 && paper.is_finite(), "{nearest} {paper}");
    assert!(figure("rbf-linear,k=50", 5) > figure("nearest", 5), "cost");
    assert!(figure("rbf-linear,k=50", 15) > 0.0, "a sphere");

    let arguments = ["chart", text(&samples), "--only", "methods"];
    let out = ["--out", text(&without)];
    let said = gonia_ok(&[&arguments[..], &out, &common, &methods].concat(), "");
    assert!(said.contains("bins of frames left out"), "{said}");
    assert!(!without.join("images.csv").exists());
}

#[test]
fn a_chart_without_anything_to_compare_with_says_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    data(dir.path());
    let csv = dir.path().join("few.csv");
    std::fs::write(
        &csv,
        "theta_i,phi_i,theta_v,phi_v,r,g,b\n10,20,30,40,1,1,1\n",
    )
    .unwrap();
    let line = |arguments: &[&str]| {
        let output = gonia(arguments, "");
        assert_eq!(output.status.code(), Some(1));
        let said = String::from_utf8(output.stderr).unwrap();
        said.lines().last().unwrap().to_owned()
    };
    let out = dir.path().join("out");
    let said = line(&["chart", text(&csv), "--out", text(&out)]);
    assert!(
        said.contains("few.csv") && said.contains("--truth"),
        "{said}"
    );
    let (samples, truth) = (dir.path().join("samples.npy"), dir.path().join("truth.exr"));
    let arguments = [
        "chart",
        text(&samples),
        "--truth",
        text(&truth),
        "--out",
        text(&out),
    ];
    let said = line(&arguments);
    assert!(
        said.contains("truth.exr") && said.contains("--step 15"),
        "{said}"
    );
}
