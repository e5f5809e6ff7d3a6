//! Scale, figures and outputs: what is said of values goes with them, what is said of other values is
//! left out aloud, and an output that cannot be is refused before the work that makes it.
#![allow(clippy::unwrap_used)]

#[path = "common/cases.rs"]
mod cases;
mod common;

use cases::{Case, document};
use common::{gonia, gonia_ok, text};
use gonia_brdf::model::{Brdf, Kurt};
use gonia_brdf::{DenseBrdf, Direction, Elementary, Grid, Sample};
use gonia_formats::baselines_toml::BaselineTable;
use gonia_formats::dense::{read_dense, read_dense_channels, write_dense};
use gonia_formats::rig_toml::write_rig;
use gonia_formats::samples::{SampleNote, write_noted_samples, write_samples};
use gonia_formats::{Summary, checksum};
use gonia_rig::{Channels, DenseFile, Reference, Rig, Scale};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A folder, and the rows of the page that its cases make.
struct Bench {
    dir: tempfile::TempDir,
    cases: Vec<Case>,
}

impl Bench {
    fn new() -> Self {
        Self {
            dir: tempfile::tempdir().unwrap(),
            cases: Vec::new(),
        }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// Runs `gonia` in the folder's place and keeps what it says: an exit code, and words of it.
    fn case(&mut self, came_in: &str, arguments: &[&str], input: &str, code: i32, words: &[&str]) {
        let arguments: Vec<String> = arguments
            .iter()
            .map(|argument| match argument.strip_prefix('@') {
                Some(name) => text(&self.at(name)).to_owned(),
                None => (*argument).to_owned(),
            })
            .collect();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let rows = ["scale ", "factor ", "not measured ", "beyond "];
        let output = gonia(&arguments, input);
        let case = Case::new(came_in, &output, self.dir.path(), &rows);
        assert_eq!(case.code(), code, "{came_in}: {}", case.said());
        for word in words {
            assert!(
                case.said().contains(word),
                "{came_in}: {word}: {}",
                case.said()
            );
        }
        if words.is_empty() {
            assert_eq!(case.said(), "", "{came_in}");
        }
        self.cases.push(case);
    }
}

fn dense_of(model: &dyn Brdf, step_deg: f64, scale: Scale) -> DenseFile {
    DenseFile {
        brdf: DenseBrdf::tabulate(Grid::with_step_deg(step_deg).unwrap(), model),
        scale,
        provenance: [].into(),
    }
}

/// Samples of the demo's fabric, every 15°.
fn samples() -> Vec<Sample> {
    let fabric = Kurt::two_thread_fabric();
    let around = || {
        let rings = (0..5).flat_map(|ring| (0..12).map(move |k| (15.0 * f64::from(ring), k)));
        rings.map(|(theta, k)| Direction::from_deg(theta, 30.0 * f64::from(k)))
    };
    around()
        .flat_map(|light| around().map(move |view| (light, view)))
        .map(|(light, view)| {
            let f = fabric.eval(light.to_vec3(), view.to_vec3());
            Sample::new(light, view, f.map(|v| v as f32))
        })
        .collect()
}

fn note(scale: Scale) -> SampleNote {
    SampleNote {
        scale: Some(scale),
        provenance: [("made_by".to_owned(), "a test".to_owned())].into(),
    }
}

// long: a list of cases, one after the other
fn scales(bench: &mut Bench) {
    let samples = samples();
    let half = &samples[..samples.len() / 2];
    write_noted_samples(&bench.at("absolute.csv"), &samples, &note(Scale::Absolute)).unwrap();
    write_noted_samples(&bench.at("absolute.npy"), &samples, &note(Scale::Absolute)).unwrap();
    write_noted_samples(&bench.at("relative.npy"), &samples, &note(Scale::Relative)).unwrap();
    write_samples(&bench.at("silent.npy"), &samples).unwrap();
    write_noted_samples(&bench.at("stale.npy"), half, &note(Scale::Absolute)).unwrap();
    fs::copy(bench.at("silent.npy"), bench.at("stale.npy")).unwrap();
    let fill = |names: &[&'static str], more: &[&'static str]| {
        let fixed = ["-o", "@filled.exr", "--step", "15", "--preset", "preview"];
        [&["fill"], names, &fixed, more].concat()
    };
    let scale = |bench: &Bench| read_dense(&bench.at("filled.exr")).unwrap().scale;
    let as_said = ["scale absolute, as the files say"];
    let came_in = "samples with `# scale = absolute` above the header";
    bench.case(came_in, &fill(&["@absolute.csv"], &[]), "", 0, &as_said);
    assert_eq!(scale(bench), Scale::Absolute);
    let came_in = "samples.npy with its note, samples.npy.toml";
    bench.case(came_in, &fill(&["@absolute.npy"], &[]), "", 0, &as_said);
    let filled = read_dense(&bench.at("filled.exr")).unwrap();
    assert_eq!(filled.provenance["samples.made_by"], "a test");
    assert_eq!(scale(bench), Scale::Absolute);
    let came_in = "samples that do not say their scale";
    bench.case(
        came_in,
        &fill(&["@silent.npy"], &[]),
        "",
        0,
        &["scale relative: the files"],
    );
    assert_eq!(scale(bench), Scale::Relative);
    let came_in = "the same, with --scale absolute";
    let absolute = ["--scale", "absolute"];
    bench.case(
        came_in,
        &fill(&["@silent.npy"], &absolute),
        "",
        0,
        &["absolute, by --scale"],
    );
    assert_eq!(scale(bench), Scale::Absolute);
    fs::remove_file(bench.at("filled.exr")).unwrap();
    let said = ["says that its values are relative, and --scale says absolute"];
    let came_in = "relative samples with --scale absolute";
    bench.case(came_in, &fill(&["@relative.npy"], &absolute), "", 1, &said);
    let came_in = "absolute and relative samples together";
    let both = ["@absolute.csv", "@relative.npy"];
    bench.case(
        came_in,
        &fill(&both, &[]),
        "",
        1,
        &["relative.npy: is relative"],
    );
    let came_in = "absolute samples, and others that do not say their scale";
    let both = ["@absolute.csv", "@silent.npy"];
    bench.case(
        came_in,
        &fill(&both, &[]),
        "",
        1,
        &["does not say its scale"],
    );
    assert!(!bench.at("filled.exr").exists());
    let came_in = "a note that was written of other samples";
    let said = [
        "warning: stale.npy.toml: was written of other samples",
        "scale relative",
    ];
    bench.case(came_in, &fill(&["@stale.npy"], &[]), "", 0, &said);
    assert_eq!(scale(bench), Scale::Relative);
    let came_in = "a fit to samples that are not those of the dense BRDF";
    let brighter: Vec<Sample> = samples
        .iter()
        .map(|s| Sample {
            rgb: s.rgb.map(|v| 2.0 * v),
            ..*s
        })
        .collect();
    write_samples(&bench.at("brighter.npy"), &brighter).unwrap();
    let fit = |samples: &'static str| {
        let fixed = ["fit", "@filled.exr", "--model", "lambert", "--starts", "4"];
        [&fixed[..], &["--cells", "300", "--samples", samples]].concat()
    };
    bench.case(
        "a fit to the samples of the dense BRDF",
        &fit("@silent.npy"),
        "",
        0,
        &[],
    );
    let said = [
        "warning: brighter.npy: its values are ",
        "times those of the dense BRDF",
    ];
    bench.case(came_in, &fit("@brighter.npy"), "", 0, &said);
    let came_in = "a fit of a relative BRDF to absolute samples";
    let fit = [
        "fit",
        "@filled.exr",
        "--model",
        "lambert",
        "--samples",
        "@absolute.npy",
    ];
    bench.case(
        came_in,
        &fit,
        "",
        1,
        &["is absolute, and the dense BRDF is relative"],
    );
}

// long: a list of cases, one after the other
fn figures(bench: &mut Bench) {
    let folder = bench.at("folder");
    fs::create_dir(&folder).unwrap();
    let at = |name: &str| folder.join(name);
    let fabric = dense_of(&Kurt::two_thread_fabric(), 30.0, Scale::Absolute);
    let white = dense_of(&Kurt::white_reference_fabric(), 30.0, Scale::Absolute);
    let report = |bench: &mut Bench, came_in: &str, words: &[&str]| {
        bench.case(came_in, &["report", "@folder"], "", 0, words);
        fs::read_to_string(bench.at("folder/report.html")).unwrap()
    };
    write_dense(&at("dense.exr"), fabric.clone()).unwrap();
    let truth = DenseFile {
        brdf: white.brdf.clone(),
        ..fabric.clone()
    };
    write_dense(&at("truth.exr"), truth).unwrap();
    let of = checksum::of_brdf(&fabric.brdf);
    let printed = gonia_ok(
        &[
            "compare",
            text(&at("dense.exr")),
            text(&at("truth.exr")),
            "--csv",
            text(&at("f.csv")),
        ],
        "",
    );
    assert!(!printed.contains("taken out"), "{printed}");
    let mut summary = Summary::new("a measurement", Scale::Absolute);
    summary.dense = Some(of.clone());
    summary.write(&at("summary.toml")).unwrap();
    BaselineTable {
        dense: Some(of),
        ..BaselineTable::default()
    }
    .write(&at("rivals.toml"))
    .unwrap();
    let [measured, fitted] = [at("dense.exr"), at("l.exr")];
    let fit = ["fit", text(&measured), "--model", "lambert"];
    let fast = ["--cells", "200", "--starts", "2"];
    gonia_ok(&[&fit[..], &["-o", text(&fitted)], &fast].concat(), "");
    let page = report(
        bench,
        "a report of a folder whose files belong together",
        &[],
    );
    for shown in [
        "a measurement",
        "Models fitted",
        "Other ways",
        "Figures of merit",
    ] {
        assert!(page.contains(shown), "{shown}");
    }
    write_dense(&at("dense.exr"), white).unwrap();
    fs::remove_file(at("truth.exr")).unwrap();
    let came_in = "the same folder with another dense.exr";
    let words = [
        "summary.toml: was made of another",
        "l.fit.toml: was made of",
        "rivals.toml: was",
    ];
    let page = report(bench, came_in, &words);
    for left_out in [
        "a measurement",
        "Models fitted",
        "Other ways",
        "Figures of merit",
    ] {
        assert!(!page.contains(left_out), "{left_out}");
    }
    assert!(page.contains("<h2>Left out</h2>"));
    for name in ["summary.toml", "rivals.toml", "l.fit.toml"] {
        fs::remove_file(at(name)).unwrap();
    }
    let errors = dense_of(&Kurt::two_thread_fabric(), 30.0, Scale::Absolute);
    write_dense(&at("error.exr"), errors).unwrap();
    let came_in = "error.exr that does not say of which dense.exr it is";
    let page = report(
        bench,
        came_in,
        &["error.exr: does not say of which dense.exr"],
    );
    assert!(!page.contains("Error bars"));
}

#[test]
fn error_bars_belong_to_the_brdf_that_was_written_with_them() {
    let bench = Bench::new();
    let frames = (0..40).flat_map(|frame| {
        let mut samples = samples();
        for sample in &mut samples {
            sample.phi_v_deg = (sample.phi_v_deg + 9.0 * frame as f32) % 360.0;
            sample.frame = frame;
        }
        samples.into_iter().step_by(41)
    });
    write_samples(&bench.at("s.npy"), &frames.collect::<Vec<_>>()).unwrap();
    let [samples, dense, errors] = ["s.npy", "dense.exr", "error.exr"].map(|n| bench.at(n));
    let fill = [
        "fill",
        text(&samples),
        "-o",
        text(&dense),
        "--error",
        text(&errors),
    ];
    gonia_ok(
        &[&fill[..], &["--step", "15", "--preset", "preview"]].concat(),
        "",
    );
    let report = |expected: bool| {
        let output = gonia(&["report", text(bench.dir.path())], "");
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(said.contains("error.exr"), !expected, "{said}");
        let page = fs::read_to_string(bench.at("report.html")).unwrap();
        assert_eq!(page.contains("Error bars"), expected);
    };
    report(true);
    let mut other = read_dense(&dense).unwrap();
    let doubled = other
        .brdf
        .planes()
        .clone()
        .map(|p| p.iter().map(|v| 2.0 * v).collect());
    other.brdf = DenseBrdf::new(other.brdf.grid(), doubled).unwrap();
    write_dense(&dense, other).unwrap();
    report(false);
}

fn queries(bench: &mut Bench) {
    let file = dense_of(&Kurt::two_thread_fabric(), 30.0, Scale::Relative);
    write_dense(&bench.at("d.exr"), file).unwrap();
    let header = "theta_i,phi_i,theta_v,phi_v\n";
    let query = ["query", "@d.exr"];
    bench.case(
        "query within the grid",
        &query,
        &format!("{header}30,0,60,0\n"),
        0,
        &[],
    );
    bench.case(
        "query of a German spreadsheet with other names",
        &query,
        "Theta_in [°];Phi_in [°];Theta_out [°];Phi_out [°]\r\n30,5;0;59,5;10\r\n",
        0,
        &[],
    );
    bench.case(
        "query of directions without a header",
        &query,
        "30,0,60,0\n",
        1,
        &["there is no column", "the file has no header"],
    );
    let rows = format!("{header}30,0,60,0\n30,0,88,0\n90,0,90,0\n");
    let said = [
        "warning: standard input: 2 of 3 directions lie beyond",
        "line 3: theta_v = 88",
    ];
    bench.case(
        "query of 88° and 90° (grid to 60°)",
        &query,
        &rows,
        0,
        &said,
    );
    for (row, word) in [
        ("91,0,0,0", "theta_i = 91 is not a polar angle"),
        ("30,0,-20,0", "the azimuth plus 180 degrees"),
        ("nan,0,0,0", "theta_i is NaN"),
        ("x,0,0,0", "theta_i \"x\" is not a number"),
    ] {
        let came_in = format!("query of `{row}`");
        bench.case(&came_in, &query, &format!("{header}{row}\n"), 1, &[word]);
    }
}

fn imports(bench: &mut Bench) {
    // UTIA: 3 × 288² floats.
    let value = |k: usize| if k % 1000 == 7 { -0.01f32 } else { 0.2 };
    let bytes: Vec<u8> = (0..3 * 288 * 288)
        .flat_map(|k| value(k).to_le_bytes())
        .collect();
    fs::write(bench.at("m.bin"), bytes).unwrap();
    let import = |name: &'static str, more: &[&'static str]| {
        let fixed = ["-o", "@m.exr", "--step", "30"];
        [&["import", name], &fixed[..], more].concat()
    };
    let said = [
        "scale relative: a UTIA .bin does not say it",
        "249 of the file's 248,832",
    ];
    bench.case("a UTIA .bin", &import("@m.bin", &[]), "", 0, &said);
    assert_eq!(
        read_dense(&bench.at("m.exr")).unwrap().scale,
        Scale::Relative
    );
    let absolute = import("@m.bin", &["--scale", "absolute"]);
    bench.case(
        "the same, with --scale absolute",
        &absolute,
        "",
        0,
        &["absolute, by --scale"],
    );
    assert_eq!(
        read_dense(&bench.at("m.exr")).unwrap().scale,
        Scale::Absolute
    );
    // MERL: a third of it was not measured, where θd is large.
    let mut bytes = [90i32, 90, 180]
        .map(i32::to_le_bytes)
        .as_flattened()
        .to_vec();
    for k in 0..3 * 90 * 90 * 180 {
        let value: f64 = if k / 180 % 90 >= 60 { -1.0 } else { 300.0 };
        bytes.extend(value.to_le_bytes());
    }
    fs::write(bench.at("m.binary"), &bytes).unwrap();
    let said = [
        "scale absolute, as the format is",
        "486,000 of the file's 1,458,000 values",
    ];
    bench.case(
        "a MERL .binary with holes (−1)",
        &import("@m.binary", &[]),
        "",
        0,
        &said,
    );
    let file = read_dense(&bench.at("m.exr")).unwrap();
    let [red, ..] = file.brdf.planes();
    assert!(red.iter().all(|v| (v - 0.2).abs() < 1e-6), "no hole is 0");
    assert!(file.provenance["not_measured"].contains("cells of the grid"));
    let relative = import("@m.binary", &["--scale", "relative"]);
    bench.case(
        "the same, with --scale relative",
        &relative,
        "",
        1,
        &["MERL .binary are absolute"],
    );
    fs::write(bench.at("cut.binary"), &bytes[..5000]).unwrap();
    bench.case(
        "a MERL .binary cut short",
        &import("@cut.binary", &[]),
        "",
        1,
        &["5000 bytes"],
    );
}

fn comparisons(bench: &mut Bench) {
    let fabric = Kurt::two_thread_fabric();
    write_dense(&bench.at("a.exr"), dense_of(&fabric, 30.0, Scale::Relative)).unwrap();
    write_dense(&bench.at("b.exr"), dense_of(&fabric, 30.0, Scale::Absolute)).unwrap();
    let came_in = "compare a relative BRDF with an absolute one";
    let said = [
        "factor 1.000000 taken out",
        "a.exr is relative",
        "b.exr absolute",
    ];
    bench.case(came_in, &["compare", "@a.exr", "@b.exr"], "", 0, &said);
    let came_in = "compare two absolute BRDFs";
    bench.case(came_in, &["compare", "@b.exr", "@b.exr"], "", 0, &[]);
}

/// The file of `dense` with a header that promises the grid of 1°.
fn promise_gigabytes(dense: &Path, path: &Path) {
    let mut bytes = fs::read(dense).unwrap();
    for name in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
        let at = bytes.windows(name.len()).position(|w| w == name.as_bytes());
        let at = at.unwrap() + name.len() + 4;
        let window = [0i32, 0, 31_319, 31_319].map(i32::to_le_bytes);
        bytes[at..at + 16].copy_from_slice(window.as_flattened());
    }
    fs::write(path, bytes).unwrap();
}

// long: a list of cases, one after the other
fn exports(bench: &mut Bench) {
    for (came_in, output, more, code, word) in [
        (
            "`export -o a.bsdf` of a relative BRDF",
            "@a.bsdf",
            &[][..],
            1,
            "give the factor that makes it so",
        ),
        (
            "the same with `--assume-scale 0`",
            "@a.bsdf",
            &["--assume-scale", "0"],
            1,
            "give a factor above 0",
        ),
        (
            "the same with `--assume-scale 2`, of a grid of 30 degrees",
            "@a.bsdf",
            &["--assume-scale", "2"],
            1,
            "or say that it is meant (--allow-coarse)",
        ),
        (
            "the same with `--allow-coarse`",
            "@a.bsdf",
            &["--assume-scale", "2", "--allow-coarse"],
            0,
            "is the table's last",
        ),
        (
            "`export -o a.zmx`",
            "@a.zmx",
            &[],
            1,
            "give --format rgl (RGL .bsdf, .bsdf)",
        ),
        (
            "`export -o a.xml --format klem`",
            "@a.xml",
            &["--format", "klem"],
            1,
            "there is no such format; give --format rgl",
        ),
        (
            "`export -o a.xml --error ERR.exr`",
            "@a.xml",
            &["--assume-scale", "2", "--error", "@a.exr"],
            1,
            "has no place for uncertainties",
        ),
        (
            "`export -o a.nc` of a relative BRDF",
            "@a.nc",
            &[],
            0,
            "nothing (60 degrees is the table's last)",
        ),
        (
            "`export -o a.nc --format zarr` over a file",
            "@a.nc",
            &["--format", "zarr"],
            1,
            "remove it or choose another name",
        ),
        (
            "`export --resolution 4`",
            "@a.bsdf",
            &["--resolution", "4"],
            1,
            "give 8 to 128",
        ),
    ] {
        let arguments = [&["export", "@a.exr", "-o", output], more].concat();
        bench.case(came_in, &arguments, "", code, &[word]);
    }
    for (came_in, arguments, code, word) in [
        (
            "`export SAMPLES -o a.bsdf`",
            &["export", "@silent.npy", "-o", "@b.bsdf"][..],
            1,
            "does not hold samples; name it .json (BiRD)",
        ),
        (
            "`export SAMPLES -o a.json --error ERR.exr`",
            &[
                "export",
                "@silent.npy",
                "-o",
                "@b.json",
                "--error",
                "@a.exr",
            ],
            1,
            "--error: goes with a dense BRDF",
        ),
        (
            "`export DENSE.exr --dense DENSE.exr`",
            &["export", "@a.exr", "-o", "@b.json", "--dense", "@a.exr"],
            1,
            "goes with samples, and",
        ),
        (
            "`export SAMPLES -o a.json` of relative samples",
            &["export", "@silent.npy", "-o", "@b.json"],
            1,
            "give the factor that makes it so",
        ),
        (
            "the same with `--assume-scale 2`",
            &[
                "export",
                "@silent.npy",
                "-o",
                "@b.json",
                "--assume-scale",
                "2",
            ],
            0,
            "says nothing of their rig",
        ),
    ] {
        bench.case(came_in, arguments, "", code, &[word]);
    }
}

// long: a list of cases, one after the other
fn outputs(bench: &mut Bench) {
    fs::create_dir(bench.at("there")).unwrap();
    fs::write(bench.at("file"), "x").unwrap();
    let fill = |output: &'static str| ["fill", "@silent.npy", "-o", output, "--step", "15"];
    for (output, word) in [
        (
            "@there",
            "there: is a folder; give the name of a file in it",
        ),
        ("@new/", "is a folder"),
        ("@filled.png", "name it .exr"),
        ("@filled.npy", "name it .exr"),
        ("@file/filled.exr", "choose a place inside a folder"),
    ] {
        let came_in = format!("`fill -o {}`", output.trim_start_matches('@'));
        bench.case(&came_in, &fill(output), "", 1, &[word]);
    }
    let twice = [
        "fill",
        "@silent.npy",
        "-o",
        "@x.exr",
        "--error",
        "@there/../x.exr",
        "--step",
        "15",
    ];
    bench.case(
        "`fill -o x.exr --error there/../x.exr`",
        &twice,
        "",
        1,
        &["x.exr: is the output too"],
    );
    let step = ["fill", "@silent.npy", "-o", "@x.exr", "--step", "45"];
    bench.case(
        "`fill --step 45`",
        &step,
        "",
        1,
        &["--step 45: a grid step of 45000"],
    );
    let fit = ["fit", "@a.exr", "--model", "lambert", "-o", "@a.exr"];
    bench.case(
        "`fit a.exr -o a.exr`",
        &fit,
        "",
        1,
        &["a.exr: is an input too"],
    );
    let render = ["render", "@a.exr", "-o", "@a.jpg"];
    bench.case(
        "`render -o a.jpg`",
        &render,
        "",
        1,
        &["a.jpg: ", "end the name in .png"],
    );
    let photo = ["photo", "@a.exr", "@p.png", "-o", "@p.png"];
    fs::write(bench.at("p.png"), "x").unwrap();
    bench.case(
        "`photo a.exr p.png -o p.png`",
        &photo,
        "",
        1,
        &["is an input too"],
    );
    let compare = ["compare", "@a.exr", "@b.exr", "--csv", "@there"];
    bench.case(
        "`compare --csv FOLDER`",
        &compare,
        "",
        1,
        &["there: is a folder"],
    );
    let came_in = "`compare --csv figures.exr`";
    let compare = ["compare", "@a.exr", "@b.exr", "--csv", "@figures.exr"];
    bench.case(came_in, &compare, "", 1, &["end the name in .csv"]);
    if cfg!(unix) {
        let came_in = "`compare --csv /dev/null`";
        let compare = ["compare", "@a.exr", "@b.exr", "--csv", "/dev/null"];
        bench.case(came_in, &compare, "", 1, &["is no ordinary file"]);
    }
    let process = ["process", "@nowhere", "-o", "@samples.txt"];
    bench.case(
        "`process -o samples.txt`",
        &process,
        "",
        1,
        &["name it .npy or .csv"],
    );
    exports(bench);
    promise_gigabytes(&bench.at("a.exr"), &bench.at("huge.exr"));
    let came_in = "a small EXR whose header promises 11.8 GB";
    let said = ["promises 31320 × 31320 pixels"];
    bench.case(came_in, &["compare", "@huge.exr", "@b.exr"], "", 1, &said);
}

fn rigs(bench: &mut Bench) {
    for (rho, code, word) in [
        (0.99, 0, None),
        (
            1.02,
            0,
            Some("warning: rig.toml, key reference.reflectance: 1.02 is more"),
        ),
        (1.2, 1, Some("at most 1.1")),
        (98.0, 1, Some("may be a percentage")),
    ] {
        let rig = Rig {
            reference: Some(Reference::lambertian([0.99, rho, 0.99])),
            ..Rig::paper(240)
        };
        write_rig(&bench.at("rig.toml"), &rig).unwrap();
        let plan = ["plan", "@rig.toml", "--views", "0:1", "--lights", "30:4"];
        let came_in = format!("a reference's reflectance of {rho}");
        bench.case(&came_in, &plan, "", code, &Vec::from_iter(word));
    }
}

#[test]
fn what_is_said_of_values_goes_with_them_and_outputs_are_checked_first() {
    let mut bench = Bench::new();
    scales(&mut bench);
    figures(&mut bench);
    queries(&mut bench);
    imports(&mut bench);
    comparisons(&mut bench);
    outputs(&mut bench);
    rigs(&mut bench);
    document("outputs", &bench.cases);
}

/// A spectrum that rises with the wavelength, more so with the polar angle of the view; nanometres, degrees.
fn spectrum(theta_v: f64, wavelength: f64) -> f64 {
    0.1 + 0.3 * (wavelength - 400.0) / 300.0 * (0.5 + 0.5 * theta_v.to_radians().sine())
}

/// A table of samples all over two hemispheres with these columns of values.
fn table_of(names: &str, values: &dyn Fn(f64) -> Vec<f64>) -> String {
    let mut table = format!("{names},theta_i,phi_i,theta_v,phi_v\n");
    for sample in samples() {
        let (theta_i, theta_v) = (sample.theta_i_deg, sample.theta_v_deg);
        // Light and view exchanged have one value.
        let values = values(0.5 * f64::from(theta_i + theta_v));
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        let (phi_i, phi_v) = (sample.phi_i_deg, sample.phi_v_deg);
        table += &format!("{},{theta_i},{phi_i},{theta_v},{phi_v}\n", values.join(","));
    }
    table
}

// long: one table goes through every command
#[test]
fn bands_are_filled_asked_compared_and_drawn_as_what_they_are() {
    let bench = Bench::new();
    // In falling order, and with one of four digits, which letters would sort wrongly.
    let wavelengths: Vec<f64> = (0..31).rev().map(|k| 400.0 + 20.0 * f64::from(k)).collect();
    let names: Vec<String> = wavelengths.iter().map(|w| format!("{w}nm")).collect();
    let of = |theta: f64| wavelengths.iter().map(|w| spectrum(theta, *w)).collect();
    fs::write(bench.at("s.csv"), table_of(&names.join(","), &of)).unwrap();
    let (samples, dense, error) = (bench.at("s.csv"), bench.at("d.exr"), bench.at("e.exr"));
    let step = ["--step", "15"];
    let fill = [
        "fill",
        text(&samples),
        "-o",
        text(&dense),
        "--error",
        text(&error),
    ];
    let said = gonia_ok(&[&fill[..], &step].concat(), "");
    assert!(said.contains("31 bands from 400nm to 1000nm"), "{said}");
    let asked = "theta_i,phi_i,theta_v,phi_v\n30,60,45,200\n";
    for file in [&dense, &samples] {
        let printed = gonia_ok(&["query", text(file)], asked);
        let (header, row) = printed.trim().split_once('\n').unwrap();
        let header: Vec<&str> = header.split(',').skip(4).collect();
        let values: Vec<f64> = row.split(',').skip(4).map(|v| v.parse().unwrap()).collect();
        assert_eq!((header.len(), values.len()), (31, 31));
        for (k, (name, value)) in header.iter().zip(values).enumerate() {
            let wavelength = 400.0 + 20.0 * k as f64;
            assert_eq!(*name, format!("{wavelength}nm"));
            let truth = spectrum(37.5, wavelength);
            assert!((value / truth - 1.0).abs() < 0.02, "{name} {value} {truth}");
        }
    }
    assert_eq!(read_dense_channels(&error).unwrap().planes.len(), 31);
    let compared = gonia_ok(&["compare", text(&dense), text(&dense)], "");
    assert!(
        compared.contains("bands      |ln| RMS 0.0000"),
        "{compared}"
    );
    let picture = bench.at("p.png");
    let drawn = ["render", text(&dense), "-o", text(&picture), "--px", "32"];
    gonia_ok(&drawn, "");
    let folder = bench.at("bands");
    fs::create_dir(&folder).unwrap();
    fs::copy(&dense, folder.join("dense.exr")).unwrap();
    fs::copy(&error, folder.join("error.exr")).unwrap();
    gonia_ok(&["report", text(&folder)], "");
    let report = fs::read_to_string(folder.join("report.html")).unwrap();
    for said in [
        "Measured were 31 bands from 400nm to 1000nm",
        "share of the value, at 560nm",
    ] {
        assert!(report.contains(said), "{said}");
    }
    let fit = ["fit", text(&dense), "--model", "lambert", "--starts", "1"];
    let fitted = gonia_ok(
        &[&fit[..], &["-o", text(&folder.join("l.exr"))]].concat(),
        "",
    );
    assert!(fitted.contains("lambert"), "{fitted}");
    gonia_ok(&["report", text(&folder)], "");
    let report = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(report.contains("lambert"));
    let output = gonia(&[&fill[..4], &["--method", "nearest"], &step].concat(), "");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let last = said.lines().last().unwrap_or_default();
    let words = "--method with the channels 31 bands from 400nm to 1000nm: only the default";
    assert!(last.contains(words), "{said}");
    // Files of other channels are not one set, and not compared.
    let grey = bench.at("y.csv");
    fs::write(&grey, table_of("Y", &|theta| vec![spectrum(theta, 550.0)])).unwrap();
    let one = bench.at("y.exr");
    let both = ["fill", text(&samples), text(&grey), "-o", text(&one)];
    let output = gonia(&[&both[..], &step].concat(), "");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("y.csv: has the channels Y, but"), "{said}");
    assert!(!one.exists());
    gonia_ok(
        &[&["fill", text(&grey), "-o", text(&one)], &step[..]].concat(),
        "",
    );
    assert_eq!(
        read_dense_channels(&one).unwrap().channels,
        Channels::Single
    );
    let output = gonia(&["compare", text(&one), text(&dense)], "");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("y.exr: has the channels Y, and"), "{said}");
}

#[test]
fn nobody_reading_is_no_failure_and_a_full_disk_is_one() {
    let bench = Bench::new();
    let dense = bench.at("d.exr");
    write_dense(
        &dense,
        dense_of(&Kurt::two_thread_fabric(), 30.0, Scale::Relative),
    )
    .unwrap();
    let csv = bench.at("f.csv");
    let d = text(&dense);
    let run = |arguments: &[&str], input: &str, stdout: Stdio, stderr: Stdio| {
        use std::io::Write;
        let mut child = Command::new(env!("CARGO_BIN_EXE_gonia"))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(stdout)
            .stderr(stderr)
            .spawn()
            .unwrap();
        // Nobody reads either of them.
        drop((child.stdout.take(), child.stderr.take()));
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        child.wait().unwrap().code()
    };
    let rows = format!(
        "theta_i,phi_i,theta_v,phi_v\n{}",
        "30,0,60,0\n".repeat(20_000)
    );
    for arguments in [&["compare", d, d, "--csv", text(&csv)][..], &["query", d]] {
        let input = if arguments[0] == "query" { &rows } else { "" };
        assert_eq!(
            run(arguments, input, Stdio::piped(), Stdio::piped()),
            Some(0)
        );
    }
    // The work was done all the same.
    assert!(fs::read_to_string(&csv).unwrap().contains("interior"));
    // With nobody to tell, a failure is still one, by its exit code.
    let missing = bench.at("none.exr");
    let refused = ["compare", d, text(&missing)];
    assert_eq!(run(&refused, "", Stdio::piped(), Stdio::piped()), Some(1));
    #[cfg(target_os = "linux")]
    for arguments in [&["compare", d, d][..], &["query", d]] {
        let full = || {
            Stdio::from(
                fs::OpenOptions::new()
                    .write(true)
                    .open("/dev/full")
                    .unwrap(),
            )
        };
        assert_eq!(run(arguments, &rows, full(), Stdio::piped()), Some(1));
    }
}
