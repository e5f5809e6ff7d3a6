//! Whatever is wrong with an input: one line that names it, exit code 1, nothing left behind.
#![allow(clippy::unwrap_used)]

mod common;

use common::{gonia, refused, text};
use gonia_formats::frame_exr::write_frame;
use gonia_formats::rig_toml::write_rig;
use gonia_rig::{Frame, Rig};
use std::fs;
use std::path::Path;

fn frame(value: f32) -> Frame {
    Frame {
        width: 64,
        height: 64,
        rgb: vec![[value; 3]; 64 * 64],
    }
}

/// A capture folder of one blank frame, sound but for what a test breaks.
fn folder(dir: &Path) {
    write_rig(&dir.join("rig.toml"), &Rig::paper(64)).unwrap();
    write_frame(&dir.join("0.exr"), &frame(0.5)).unwrap();
    fs::write(
        dir.join("frames.csv"),
        "frame,role,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg,file\n0,material,0,0,30,0,0.exr\n",
    )
    .unwrap();
}

#[test]
fn broken_capture_folders_are_refused_with_the_place_and_leave_no_samples() {
    type Break = fn(&Path);
    let cases: [(Break, &[&str]); 9] = [
        (
            |d| fs::remove_file(d.join("rig.toml")).unwrap(),
            &["rig.toml"],
        ),
        (
            |d| {
                let rig = fs::read_to_string(d.join("rig.toml")).unwrap();
                fs::write(d.join("rig.toml"), rig.replace("focal_px", "focal")).unwrap();
            },
            &["rig.toml", "focal"],
        ),
        (
            |d| fs::remove_file(d.join("frames.csv")).unwrap(),
            &["frames.csv"],
        ),
        (
            |d| fs::remove_file(d.join("0.exr")).unwrap(),
            &["frames.csv", "frame 0", "0.exr"],
        ),
        (
            |d| fs::write(d.join("frames.csv"), "frame,role\n0,material\n").unwrap(),
            &["frames.csv", "theta_i_deg"],
        ),
        (
            |d| {
                let mut bad = frame(0.5);
                bad.rgb[70][1] = f32::NAN;
                write_frame(&d.join("0.exr"), &bad).unwrap();
            },
            &["0.exr", "channel G", "(6, 1)"],
        ),
        (
            |d| {
                let bytes = fs::read(d.join("0.exr")).unwrap();
                fs::write(d.join("0.exr"), &bytes[..bytes.len() / 2]).unwrap();
            },
            &["0.exr"],
        ),
        (
            |d| fs::write(d.join("0.exr"), "not an image").unwrap(),
            &["0.exr"],
        ),
        (
            |d| {
                let rig = fs::read_to_string(d.join("rig.toml")).unwrap();
                fs::write(
                    d.join("rig.toml"),
                    rig.replace("width_px = 64", "width_px = 65"),
                )
                .unwrap();
            },
            &["0.exr", "64", "65"],
        ),
    ];
    for (k, (break_it, words)) in cases.iter().enumerate() {
        let dir = tempfile::tempdir().unwrap();
        folder(dir.path());
        break_it(dir.path());
        let said = refused(&["process", text(dir.path())], "");
        for word in *words {
            assert!(said.contains(word), "case {k}: {said}");
        }
        assert!(!dir.path().join("samples.npy").exists());
    }
}

#[test]
fn a_folder_that_does_not_show_the_target_gives_no_rig() {
    let dir = tempfile::tempdir().unwrap();
    let (dir, found) = (dir.path(), dir.path().join("found.toml"));
    folder(dir);
    let calibrate = |words: &[&str]| {
        let said = refused(&["calibrate", text(dir), "-o", text(&found)], "");
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
        assert!(!found.exists());
    };
    calibrate(&["needs 6 frames", "there are 1"]);
    let mut rows = fs::read_to_string(dir.join("frames.csv")).unwrap();
    for i in 1..8 {
        rows += &format!("{i},material,0,0,{},{},0.exr\n", 8 * i, 40 * i);
    }
    fs::write(dir.join("frames.csv"), rows).unwrap();
    calibrate(&["none of the 8 frames", "fiducial lines"]);
}

#[test]
fn a_frame_of_something_else_gives_no_samples() {
    let dir = tempfile::tempdir().unwrap();
    folder(dir.path());
    let said = refused(&["process", text(dir.path())], "");
    assert!(said.contains("does not show the target"), "{said}");
    assert!(!dir.path().join("samples.npy").exists());
}

#[test]
fn samples_that_cannot_be_used_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (samples, dense) = (dir.path().join("s.csv"), dir.path().join("d.exr"));
    let header = "theta_i,phi_i,theta_v,phi_v,r,g,b\n";
    let row = "10,0,20,30,1,1,1\n";
    let cases = [
        (String::new(), "s.csv"),
        (format!("{header}10,0,20,x,1,1,1\n"), "line 2"),
        (format!("{header}10,0,95,0,1,1,1\n"), "line 2"),
        (format!("{header}10,0,20,0,NaN,1,1\n"), "line 2"),
        ("a,b\n1,2\n".into(), "theta_i"),
        (format!("{header}{row}"), "measure more"),
    ];
    for (content, word) in cases {
        fs::write(&samples, &content).unwrap();
        let said = refused(&["fill", text(&samples), "-o", text(&dense)], "");
        assert!(said.contains(word), "{content:?}: {said}");
        assert!(!dense.exists());
    }
    let said = refused(&["fill", "none.npy", "-o", text(&dense)], "");
    assert!(said.contains("none.npy"), "{said}");
    fs::write(&samples, header).unwrap();
    let said = refused(
        &["fill", text(&samples), "-o", text(&dense), "--step", "7"],
        "",
    );
    assert!(said.contains("--step"), "{said}");
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "x").unwrap();
    // A folder below a file can never be made, not even by root.
    let below = file.join("demo");
    let said = refused(&["demo", "--quick", "--out", text(&below)], "");
    assert!(
        said.contains("demo") && said.contains("cannot be written"),
        "{said}"
    );
    folder(dir.path());
    let output = below.join("s.npy");
    let said = refused(&["process", text(dir.path()), "-o", text(&output)], "");
    assert!(said.contains("cannot be written"), "{said}");
}

#[test]
fn questions_that_make_no_sense_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let dense = dir.path().join("d.exr");
    fs::write(&dense, "no EXR").unwrap();
    assert!(refused(&["query", text(&dense)], "").contains("d.exr"));
    assert!(refused(&["compare", text(&dense), text(&dense)], "").contains("d.exr"));
    assert!(refused(&["report", text(dir.path())], "").contains("dense.exr"));
    let rig = dir.path().join("rig.toml");
    write_rig(&rig, &Rig::paper(64)).unwrap();
    for (arguments, word) in [
        (["--symmetry=auto", "--dwell=1"], "--symmetry auto"),
        (["--symmetry=half-turn", "--plane=3"], "has no plane"),
        (["--symmetry=bilateral", "--plane=inf"], "--plane inf"),
    ] {
        let said = refused(&[&["plan", text(&rig)], &arguments[..]].concat(), "");
        assert!(said.contains(word), "{said}");
    }
    let said = refused(&["plan", text(&rig), "--dwell=-5"], "");
    assert!(said.contains("--dwell -5"), "{said}");
}

#[test]
fn wrong_usage_ends_with_code_2() {
    for arguments in [&["fill"][..], &["nonsense"], &["demo", "--frame-px", "x"]] {
        assert_eq!(gonia(arguments, "").status.code(), Some(2), "{arguments:?}");
    }
}
