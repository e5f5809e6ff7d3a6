//! The quick demo, and the single commands on its files.
#![allow(clippy::unwrap_used)]

mod common;

use common::{gonia_ok, text};
use gonia_brdf::direction::local_direction;
use gonia_brdf::{Direction, Grid};
use gonia_formats::Summary;
use gonia_formats::plan_csv::read_plan_csv;
use gonia_formats::samples::read_samples;
use gonia_imaging::SamplingGrid;
use gonia_rig::{Rig, Scale, Stratum};
use std::collections::HashSet;
use std::path::Path;

// long: one demo, and every command that its files serve.
#[test]
fn the_quick_demo_measures_the_fabric_and_its_files_serve_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let file = |name: &str| out.join(name).to_str().unwrap().to_owned();
    let table = gonia_ok(&["demo", "--quick", "--out", text(&out)], "");
    for word in ["pointing", "direction error", "bins filled", "interior"] {
        assert!(table.contains(word), "{word} is missing from\n{table}");
    }

    let summary = Summary::read(&out.join("summary.toml")).unwrap();
    let pointing = summary.pointing.as_ref().unwrap();
    assert!(pointing.max_deg <= 0.03 && pointing.max_deg > 0.0);
    let planned = summary.poses.unwrap().planned;
    assert_eq!(summary.poses.unwrap().reached, 2 * planned);
    // Nearly every frame shows its target; what hides behind the light is refused or left out.
    let frames = summary.frames.as_ref().unwrap();
    assert!(frames.kept as f64 > 0.99 * (2 * planned) as f64);
    let expected = bins_of_plan(&out);
    let filled = summary.bins.as_ref().unwrap().filled as f64;
    assert!(
        (0.97..=1.005).contains(&(filled / expected)),
        "{filled} bins filled, {expected} by the plan's geometry"
    );

    // Measured runs had an interior log-RMS of 0.066 and 0.078 (which frames cross-validation leaves out decides
    // between two nearly equal coordinates) and a sphere's ΔE of 0.63 and 0.76; the bounds leave
    // half as much again.
    let figures = summary.figures.as_ref().unwrap();
    assert_eq!(summary.scale, Scale::Relative);
    assert!((figures.factor.unwrap() - 1.0).abs() < 0.01);
    let interior = figures.stratum(Stratum::Interior).unwrap();
    assert!(interior.log_rms < 0.12, "{}", interior.log_rms);
    assert!(interior.log_mean.abs() < 0.01, "{}", interior.log_mean);
    assert!(figures.sphere_delta_e < 1.0, "{}", figures.sphere_delta_e);
    assert!(figures.strata.iter().all(|s| s.reciprocity_a < 1e-6));

    // The same frames from their files: half-float rounding is all that differs.
    let again = file("again.npy");
    let printed = gonia_ok(&["process", text(&out), "-o", &again], "");
    assert!(printed.contains("eq. (3)"), "{printed}");
    let a = read_samples(&out.join("samples.npy")).unwrap().samples;
    let b = read_samples(Path::new(&again)).unwrap().samples;
    assert!((a.len() as f64 / b.len() as f64 - 1.0).abs() < 1e-3);
    let mean = |samples: &[gonia_brdf::Sample]| {
        samples.iter().map(|s| f64::from(s.rgb[1])).sum::<f64>() / samples.len() as f64
    };
    assert!((mean(&a) / mean(&b) - 1.0).abs() < 1e-3);

    let dense = file("dense2.exr");
    let printed = gonia_ok(&["fill", &again, "-o", &dense, "--step", "4"], "");
    assert!(
        printed.contains("bins filled")
            && printed.contains("half/difference") | printed.contains("sum/difference")
    );
    let printed = gonia_ok(&["compare", &dense, &file("truth.exr")], "");
    assert!(printed.contains("interior") && printed.contains("retro"));

    let printed = gonia_ok(
        &["query", &dense],
        "theta_i,phi_i,theta_v,phi_v\n30,45,60,225\n60,225,30,45\n",
    );
    let rows: Vec<Vec<f64>> = printed
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 2);
    assert!(rows[0][4] > 0.0);
    assert!((rows[0][4] / rows[1][4] - 1.0).abs() < 1e-5, "reciprocity");

    std::fs::remove_file(out.join("report.html")).unwrap();
    gonia_ok(&["report", text(&out)], "");
    let html = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(html.contains("<html") && html.contains("data:image/png;base64"));
}

/// Bins that the plan's points fall into if nothing is hidden.
fn bins_of_plan(out: &Path) -> f64 {
    let rig = Rig::paper(240);
    let grid = Grid::with_step_deg(4.0).unwrap();
    let points = SamplingGrid::new(&rig);
    let mut cells = HashSet::new();
    for pose in read_plan_csv(&out.join("plan.csv")).unwrap() {
        for point in points.points_mm() {
            let at = point.map(|x| x * 1e-3);
            let node = |arm, distance| {
                let d = Direction::from_vec3(local_direction(arm, distance, at));
                grid.nearest(d.theta_deg(), d.phi_deg())
            };
            let light = node(pose.light, rig.light.distance_m);
            let view = node(pose.view, rig.camera.distance_m);
            if let (Some(light), Some(view)) = (light, view) {
                cells.insert(grid.cell(light, view));
            }
        }
    }
    cells.len() as f64
}
