//! Scale, figures and outputs: what is said of values goes with them, what is said of other values is
//! left out aloud, and an output that cannot be is refused before the work that makes it.
#![allow(clippy::unwrap_used)]

#[path = "../common/cases.rs"]
mod cases;
#[path = "../common/mod.rs"]
mod common;

mod bands;
mod bench;
mod exports;
mod paths;
mod values;

use crate::bench::{Bench, dense_of, fill_with_errors, samples};
use crate::cases::document;
use crate::common::{gonia, gonia_ok, text};
use crate::exports::imports;
use crate::paths::outputs;
use crate::values::{comparisons, figures, queries, rigs, scales};
use gonia_brdf::DenseBrdf;
use gonia_brdf::model::Kurt;
use gonia_formats::dense::{read_dense, write_dense};
use gonia_formats::samples::write_samples;
use gonia_rig::Scale;
use std::fs;
use std::process::{Command, Stdio};

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
    let fill = fill_with_errors(&samples, &dense, &errors);
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
