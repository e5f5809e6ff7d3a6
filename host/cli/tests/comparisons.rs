//! Fits, renders, photographs, imports and rivals by the command line.
#![allow(clippy::unwrap_used)]

mod common;

use common::{gonia, gonia_ok, refused, text};
use gonia_brdf::direction::local_direction;
use gonia_brdf::model::{Brdf, Ggx, Kurt};
use gonia_brdf::{DenseBrdf, Direction, Grid, Sample};
use gonia_formats::baselines_toml::BaselineTable;
use gonia_formats::dense::{read_dense, write_dense};
use gonia_formats::fit_toml::FitNote;
use gonia_formats::frame_exr::{read_frame, write_frame};
use gonia_formats::samples::write_samples;
use gonia_rig::{DenseFile, Frame, Scale};
use std::collections::BTreeMap;
use std::path::Path;

fn write(path: &Path, step_deg: f64, model: &dyn Brdf, scale: Scale) {
    let brdf = DenseBrdf::tabulate(Grid::with_step_deg(step_deg).unwrap(), model);
    let provenance = BTreeMap::new();
    write_dense(
        path,
        DenseFile {
            brdf,
            scale,
            provenance,
        },
    )
    .unwrap();
}

#[test]
fn a_fit_prints_its_numbers_and_leaves_a_table_and_a_note() {
    let dir = tempfile::tempdir().unwrap();
    let (dense, fitted) = (dir.path().join("d.exr"), dir.path().join("k.exr"));
    write(&dense, 10.0, &Kurt::two_thread_fabric(), Scale::Relative);
    let arguments = ["fit", text(&dense), "--model", "kurt2", "-o", text(&fitted)];
    let fast = ["--cells", "1500", "--starts", "8"];
    let printed = gonia_ok(&[&arguments[..], &fast[..]].concat(), "");
    for word in ["azimuth1", "± ", "interior", "converged"] {
        assert!(printed.contains(word), "{word}: {printed}");
    }
    let note = FitNote::read(&dir.path().join("k.fit.toml")).unwrap();
    assert!(note.converged && note.residual_rms < 1e-4, "{note:?}");
    let mx = note.parameters.iter().find(|p| p.name == "mx1").unwrap();
    assert!((mx.value - 0.14).abs() < 1e-4);
    let file = read_dense(&fitted).unwrap();
    assert_eq!(file.scale, Scale::Relative);
    assert!(file.provenance["fit"].contains("kurt2"));
}

#[test]
fn a_fit_that_does_not_converge_says_so_and_marks_what_it_keeps() {
    let dir = tempfile::tempdir().unwrap();
    let (dense, fitted) = (dir.path().join("d.exr"), dir.path().join("s.exr"));
    write(&dense, 15.0, &Kurt::two_thread_fabric(), Scale::Absolute);
    let arguments = [
        "fit",
        text(&dense),
        "--model",
        "sadeghi",
        "-o",
        text(&fitted),
        "--cells",
        "200",
        "--starts",
        "1",
        "--iterations",
        "1",
    ];
    let said = refused(&arguments, "");
    assert!(
        said.contains("did not converge") && said.contains("best so far"),
        "{said}"
    );
    assert!(read_dense(&fitted).unwrap().provenance["fit"].contains("NOT CONVERGED"));
    assert!(
        !FitNote::read(&dir.path().join("s.fit.toml"))
            .unwrap()
            .converged
    );
}

#[test]
fn a_fit_is_written_as_a_material_and_a_relative_one_only_with_a_factor() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (dense, table, xml, json) = (path("d.exr"), path("p.exr"), path("p.xml"), path("p.json"));
    let lobe = Ggx {
        diffuse: [0.2, 0.1, 0.05],
        specular: [0.5; 3],
        f0: 0.04,
        alpha_x: 0.3,
        alpha_y: 0.2,
        azimuth_deg: 20.0,
    };
    write(&dense, 15.0, &lobe, Scale::Relative);
    let (dense, table) = (text(&dense), text(&table));
    let model = ["fit", dense, "--model", "principled", "-o", text(&xml)];
    let said = refused(&model, "");
    assert!(said.contains("--assume-scale") && !xml.exists(), "{said}");
    let more = ["-o", text(&json), "-o", table, "--assume-scale", "2"];
    let fast = ["--cells", "400", "--starts", "4"];
    gonia_ok(&[&model[..], &more, &fast].concat(), "");
    let written = std::fs::read_to_string(&xml).unwrap();
    assert!(written.contains("<bsdf type=\"principled\""), "{written}");
    assert!(
        std::fs::read_to_string(&json)
            .unwrap()
            .contains("\"delta_e00_sphere\"")
    );
    let file = read_dense(Path::new(table)).unwrap();
    assert_eq!(file.scale, Scale::Absolute);
    assert!(file.provenance["scale_assumed"].contains("by 2"));
    for (name, model, said) in [
        (
            "a.zmx",
            "principled",
            ".exr, .mtlx (MaterialX), .xml (Mitsuba), .gltf (glTF) or .json (JSON)",
        ),
        ("a.xml", "gltf", "fit --model principled"),
        ("a.mtlx", "kurt2", "fit --model principled, gltf or openpbr"),
        ("d.exr", "ggx", "is an input too"),
    ] {
        let out = path(name);
        let found = refused(&["fit", dense, "--model", model, "-o", text(&out)], "");
        assert!(
            found.contains(said) && found.lines().count() == 1,
            "{found}"
        );
    }
    let twice = ["fit", dense, "--model", "ggx", "-o", table, "-o", table];
    assert!(refused(&twice, "").contains("is given twice"));
}

#[test]
fn models_sizes_and_files_that_cannot_be_are_refused_in_a_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    write(
        &path("d.exr"),
        30.0,
        &Kurt::two_thread_fabric(),
        Scale::Absolute,
    );
    let odd = Frame {
        width: 7,
        height: 5,
        rgb: vec![[0.5; 3]; 35],
    };
    write_frame(&path("odd.exr"), &odd).unwrap();
    std::fs::write(path("x.bin"), "short").unwrap();
    std::fs::write(path("x.dat"), "short").unwrap();
    std::fs::write(path("x.binary"), "short").unwrap();
    std::fs::write(path("x.txt"), "short").unwrap();
    let (dense, out) = (path("d.exr"), path("out.png"));
    let (dense, out) = (text(&dense), text(&out));
    let unknown = gonia(&["fit", dense, "--model", "phong"], "");
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("kurt1 to kurt4"));
    let (odd, bin, dat) = (path("odd.exr"), path("x.bin"), path("x.dat"));
    let (txt, samples, merl) = (path("x.txt"), path("s.npy"), path("x.binary"));
    let cases: [(&[&str], &str); 11] = [
        (&["fit", text(&odd), "--model", "ggx"], "7 × 5 pixels"),
        (
            &["fit", dense, "--model", "ggx", "--cells", "3"],
            "--cells 3",
        ),
        (
            &["render", dense, "-o", out, "--light", "moon"],
            "--light moon",
        ),
        (&["render", dense, "-o", out, "--px", "0"], "--px 0"),
        (
            &["render", dense, "-o", out, "--light", text(&odd)],
            "twice as wide as high",
        ),
        (
            &["photo", dense, text(&odd), "-o", out, "--box", "0,0,90,90"],
            "7 × 5 pixels",
        ),
        (&["import", text(&bin), "-o", out], "holds 5 bytes"),
        (&["import", text(&merl), "-o", out], "holds 5 bytes"),
        (&["import", text(&txt), "-o", out], "neither .bin"),
        (&["import", text(&dat), "-o", out], "name it .npy or .csv"),
        (
            &["import", text(&dat), "-o", text(&samples)],
            "holds 5 bytes",
        ),
    ];
    for (arguments, word) in cases {
        let said = refused(arguments, "");
        assert!(said.contains(word), "{arguments:?}: {said}");
        assert!(!path("out.png").exists());
    }
}

#[test]
fn a_table_of_many_processes_is_read_as_any_other_and_becomes_openexr() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (dense, zarr, back) = (path("d.exr"), path("d.zarr"), path("b.exr"));
    write(&dense, 15.0, &Kurt::two_thread_fabric(), Scale::Absolute);
    gonia_ok(&["export", text(&dense), "-o", text(&zarr)], "");
    let directions = "theta_i,phi_i,theta_v,phi_v\n31,47,55,201\n";
    let asked = |file: &Path| gonia_ok(&["query", text(file)], directions);
    assert_eq!(asked(&zarr), asked(&dense));
    gonia_ok(&["import", text(&zarr), "-o", text(&back)], "");
    let (there, here) = (read_dense(&back).unwrap(), read_dense(&dense).unwrap());
    assert_eq!(there.brdf.planes(), here.brdf.planes());
    assert_eq!(
        (there.scale, there.provenance),
        (here.scale, here.provenance)
    );
    for (more, word) in [
        (["--step", "4"], "leave --step out"),
        (["--scale", "relative"], "leave --scale out"),
    ] {
        let import = ["import", text(&zarr), "-o", text(&back)];
        let said = refused(&[&import[..], &more[..]].concat(), "");
        assert!(said.contains(word), "{said}");
    }
    // It is written in one piece by an export only.
    let other = path("o.zarr");
    let said = refused(&["import", text(&zarr), "-o", text(&other)], "");
    assert!(said.contains("name it .exr"), "{said}");
    assert!(!said.contains(".exr or"), "{said}");
}

#[test]
fn renders_and_photographs_are_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    write(
        &path("d.exr"),
        10.0,
        &Kurt::two_thread_fabric(),
        Scale::Absolute,
    );
    let white = Frame {
        width: 32,
        height: 16,
        rgb: vec![[1.0; 3]; 32 * 16],
    };
    write_frame(&path("room.exr"), &white).unwrap();
    let (dense, room) = (path("d.exr"), path("room.exr"));
    let (png, linear) = (path("r.png"), path("r.exr"));
    gonia_ok(
        &[
            "render",
            text(&dense),
            "-o",
            text(&png),
            "--linear",
            text(&linear),
            "--light",
            text(&room),
            "--px",
            "48",
            "--lights",
            "64",
        ],
        "",
    );
    let drawn = read_frame(&linear).unwrap();
    let middle = drawn.rgb[24 * 48 + 24];
    // Lit evenly from all sides a surface shows its albedo, which for this fabric is below a half.
    assert!(
        (0.1..0.6).contains(&middle[0]) && middle[2] < middle[0],
        "{middle:?}"
    );
    assert_eq!(drawn.rgb[0], [0.0; 3]);

    let beside = path("beside.png");
    let printed = gonia_ok(
        &[
            "photo",
            text(&dense),
            text(&linear),
            "-o",
            text(&beside),
            "--box",
            "8,8,40,40",
        ],
        "",
    );
    assert!(printed.contains("correlation") && printed.contains("ΔE00"));
    assert!(std::fs::metadata(&beside).unwrap().len() > 500);
}

/// A small session straight from a material: some lights and views, a few points a frame.
fn session(model: &dyn Brdf) -> Vec<Sample> {
    let rings = [(0.0, 1), (20.0, 6), (40.0, 9), (60.0, 12), (75.0, 14)];
    let arms = gonia_brdf::hemisphere::directions(&rings);
    let mut samples = Vec::new();
    for (i, light) in arms.iter().enumerate() {
        for (v, view) in arms.iter().enumerate() {
            for point in [
                [0.0, 0.0],
                [0.2, 0.05],
                [-0.1, 0.2],
                [-0.15, -0.2],
                [0.1, -0.1],
            ] {
                let l = local_direction(*light, 1.1, point);
                let e = local_direction(*view, 1.8, point);
                let (ld, ed) = (Direction::from_vec3(l), Direction::from_vec3(e));
                samples.push(
                    Sample::new(ld, ed, model.eval(l, e).map(|f| f as f32))
                        .in_frame((i * arms.len() + v) as u32),
                );
            }
        }
    }
    samples
}

#[test]
fn baselines_are_made_compared_and_shown_in_the_report() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let model = Kurt::white_reference_fabric();
    write_samples(&path("samples.npy"), &session(&model)).unwrap();
    write(&path("dense.exr"), 5.0, &model, Scale::Relative);
    write(&path("truth.exr"), 5.0, &model, Scale::Absolute);
    for (step, word) in [
        ("12", "a multiple of the measurement's 5 degrees"),
        ("30", "at most 20"),
    ] {
        let said = refused(&["rivals", text(dir.path()), "--step", step], "");
        assert!(said.contains(word), "{said}");
    }
    let made = |more: &[&str]| {
        let arguments = [
            "rivals",
            text(dir.path()),
            "--cells",
            "1000",
            "--starts",
            "4",
        ];
        gonia_ok(&[&arguments[..], more].concat(), "");
        BaselineTable::read(&path("rivals.toml")).unwrap()
    };
    // The paper's method takes a second for a thousand cells.
    let found = made(&["--step", "20"]);
    for row in &found.rows[1..] {
        let table = read_dense(&path(&format!("{}.exr", row.name))).unwrap();
        assert_eq!(table.brdf.grid().step_deg(), 20.0, "{}", row.name);
    }
    assert!(found.rows.iter().any(|row| row.name == "sparse-paper"));
    let found = made(&["--step", "15", "--without-paper"]);
    let names = ["dense", "sparse", "strips", "kurt2", "sadeghi"];
    let rows: Vec<&str> = found.rows.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(rows, names);
    let error = |name: &str| {
        let row = found.rows.iter().find(|row| row.name == name).unwrap();
        let figures = row.against_truth.as_ref().unwrap();
        figures
            .strata
            .iter()
            .find(|s| s.stratum.name() == "interior")
            .unwrap()
            .log_rms
    };
    // The material is a Kurt model, so that is exact; noise and few samples cost something.
    assert!(error("kurt2") < 1e-3 && error("dense") < 1e-6);
    assert!(error("sparse") < 0.2 && error("strips") > error("kurt2"));
    let figures = path("figures");
    gonia_ok(
        &["report", text(dir.path()), "--figures", text(&figures)],
        "",
    );
    let drawn = std::fs::read_to_string(figures.join("fig8.svg")).unwrap();
    assert!(drawn.contains(">sadeghi<"));
    assert!(figures.join("fig2.png").exists() && figures.join("fig9d.svg").exists());
    let page = std::fs::read_to_string(path("report.html")).unwrap();
    assert!(page.contains("Other ways to the same data") && page.contains("image/svg+xml"));
    assert!(page.contains("Models fitted"));
}
