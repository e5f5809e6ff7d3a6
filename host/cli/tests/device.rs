//! `gonia device` against `gonia sim-device`, as a person at the bench uses it, in real time.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use common::{gonia_ok, refused};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

/// The simulated controllers; they end with this value.
struct SimDevice(Child);

impl Drop for SimDevice {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts both arms; the ports of the light arm and of the camera arm.
fn start() -> (SimDevice, [String; 2]) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_gonia"))
        .args(["sim-device", "--pty"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let device = SimDevice(child);
    let ports = ["light arm", "camera arm"].map(|name| {
        let line = lines.next().unwrap().unwrap();
        line.strip_prefix(name).unwrap().trim().to_owned()
    });
    (device, ports)
}

/// The value in a printed row.
fn row<'a>(printed: &'a str, name: &str) -> &'a str {
    let line = printed.lines().find(|line| line.starts_with(name));
    line.unwrap_or_else(|| panic!("no {name} in {printed}"))[name.len()..].trim()
}

#[test]
fn a_person_at_the_bench_homes_moves_sets_and_calibrates_an_arm() {
    let (_device, [light, camera]) = start();
    let ok = |arguments: &[&str], input: &str| {
        gonia_ok(&[&["device", light.as_str()], arguments].concat(), input)
    };
    let bad = |arguments: &[&str], input: &str| {
        refused(&[&["device", light.as_str()], arguments].concat(), input)
    };

    // Who it is. The camera arm is at the other port.
    let identity = ok(&["identify"], "");
    assert_eq!(row(&identity, "controller"), "light arm");
    assert!(row(&identity, "theta encoder").starts_with("not calibrated"));
    let other = gonia_ok(&["device", &camera, "identify"], "");
    assert_eq!(row(&other, "controller"), "camera arm");
    let nobody = refused(&["device", "/dev/null/nobody", "identify"], "");
    assert!(nobody.contains("/dev/null/nobody"), "{nobody}");

    // Nothing moves before homing.
    assert_eq!(row(&ok(&["status"], ""), "homed"), "no");
    assert!(bad(&["move", "0", "0"], "").contains("home"));

    // Settings: faster homing, within the limits.
    ok(&["set", "phi", "home_fast_speed", "15000000"], "");
    assert_eq!(
        row(&ok(&["settings"], ""), "home_fast_speed"),
        "10000000, 15000000 µdeg/s"
    );
    assert!(bad(&["set", "phi", "home_fast_speed", "-1"], "").contains("must lie in"));
    assert!(bad(&["set", "phi", "home_fast_sped", "1"], "").contains("no such setting"));
    ok(&["save"], "");

    let homing = ok(&["home"], "");
    assert!(homing.lines().last().unwrap().ends_with("idle"), "{homing}");
    assert_eq!(row(&ok(&["status"], ""), "homed"), "yes");

    let moved = ok(&["move", "3", "-184"], "");
    let last = moved.lines().last().unwrap();
    let angles: Vec<f64> = last
        .split_whitespace()
        .filter_map(|w| w.parse().ok())
        .collect();
    assert!(
        (angles[1] - 3.0).abs() < 0.0061 && (angles[2] + 184.0).abs() < 0.0061,
        "{last}"
    );
    assert!(bad(&["move", "91", "0"], "").contains("limit"));
    assert!(bad(&["move", "nan", "0"], "").contains("must lie in"));

    // A reference that agrees with the stands.
    let readings = "0\n3\n6\n9\n12\n15\n";
    let stands = [
        "calibrate",
        "theta",
        "--from",
        "0",
        "--to",
        "15",
        "--stands",
        "6",
    ];
    let fitted = ok(&stands, readings);
    assert!(
        row(&fitted, "encoder, RMS after").ends_with("deg"),
        "{fitted}"
    );
    assert_eq!(row(&ok(&["identify"], ""), "theta encoder"), "calibrated");
    let few = [
        "calibrate",
        "theta",
        "--from",
        "0",
        "--to",
        "15",
        "--stands",
        "3",
    ];
    assert!(bad(&few, "").contains("6 stands"));
    assert!(bad(&stands, "0\nthree\n").contains("no number"));
}
