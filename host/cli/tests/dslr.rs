//! The recipe for a DSLR (docs/src/guides/dslr.sh), with stand-ins for gphoto2, dcraw and netpbm.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use gonia_acquire::camera::{Camera, CommandCamera, Pulse};
use gonia_brdf::{Direction, Pose};
use gonia_formats::raw_frame::write_raw;
use gonia_rig::{FrameRow, RawFrame, Rig, Role, Sensor};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

const PX: usize = 32;

/// A program of that name that does this.
fn stand_in(folder: &Path, name: &str, script: &str) {
    let path = folder.join(name);
    std::fs::write(&path, format!("#!/bin/sh\nset -eu\n{script}\n")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn a_bracket_of_a_dslr_becomes_a_frame_and_a_camera_that_fails_gives_none() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    // Its exposures: 1000 counts a second above black.
    for (name, counts) in [("1_10", 164), ("2", 2064)] {
        let raw = RawFrame {
            width: PX,
            height: PX,
            channels: 1,
            counts: vec![counts; PX * PX],
        };
        write_raw(Path::new(&at(&format!("{name}.png"))), &raw).unwrap();
    }
    // gphoto2 --quiet --set-config shutterspeed=S --capture-image-and-download --force-overwrite --filename FILE
    let take = format!(
        "test \"$1 $2 $4 $5 $6\" = '--quiet --set-config --capture-image-and-download --force-overwrite --filename'\n\
         speed=${{3#shutterspeed=}}\ncp \"{}/$(echo \"$speed\" | tr / _).png\" \"$7\"",
        folder.path().display()
    );
    stand_in(folder.path(), "gphoto2", &take);
    stand_in(
        folder.path(),
        "dcraw",
        "test \"$1 $2 $3 $4 $5\" = '-c -D -4 -t 0'\ncat \"$6\"",
    );
    stand_in(folder.path(), "pnmtopng", "cat \"$1\"");
    let mut rig = Rig::paper(PX);
    rig.sensor = Some(Sensor {
        black_counts: 64.0,
        saturation_counts: 4000.0,
        gain_e_per_count: 2.5,
        read_noise_e: 4.0,
        bayer: None,
    });
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/src/guides/dslr.sh");
    let path = format!(
        "PATH={}:{}",
        folder.path().display(),
        std::env::var("PATH").unwrap()
    );
    let up = Direction::from_deg(0.0, 0.0);
    let row = FrameRow {
        frame: 0,
        role: Role::Material,
        pose: Pose {
            light: up,
            view: up,
        },
        file: String::new(),
    };
    let fetch = |speeds: [&str; 2]| {
        let run = ["env", &path, "sh", script, "{file}", speeds[0], speeds[1]];
        let run = run.map(str::to_owned).to_vec();
        let pulses = [Pulse::new(0.1, 0), Pulse::new(2.0, 200_000)];
        CommandCamera::new(&rig, run, 20.0).fetch(&row, &pulses)
    };
    let frame = fetch(["1/10", "2"]).unwrap();
    assert!(frame.rgb.iter().all(|p| (p[0] - 1000.0).abs() < 0.1));
    // The second exposure fails: nothing is left of the first.
    let error = fetch(["1/10", "1/4000"]).unwrap_err().to_string();
    assert!(error.contains("ended with"), "{error}");
}
