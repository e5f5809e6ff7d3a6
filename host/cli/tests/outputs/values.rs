//! What is said of values: their scale, figures of them, queries and comparisons.

use crate::bench::{Bench, dense_of, note, samples};
use crate::common::{gonia_ok, text};
use gonia_brdf::Sample;
use gonia_brdf::model::Kurt;
use gonia_formats::baselines_toml::BaselineTable;
use gonia_formats::dense::{read_dense, write_dense};
use gonia_formats::rig_toml::write_rig;
use gonia_formats::samples::{write_noted_samples, write_samples};
use gonia_formats::{Summary, checksum};
use gonia_rig::{DenseFile, Reference, Rig, Scale};
use std::fs;

// long: a list of cases, one after the other
pub fn scales(bench: &mut Bench) {
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
pub fn figures(bench: &mut Bench) {
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

pub fn queries(bench: &mut Bench) {
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

pub fn comparisons(bench: &mut Bench) {
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

pub fn rigs(bench: &mut Bench) {
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
