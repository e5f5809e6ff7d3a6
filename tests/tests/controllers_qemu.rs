//! The firmware as real ARM code in QEMU, over a Unix socket: the same client, the same core.
//!
//! Needs `GONIA_QEMU_ELF` (firmware/boards/qemu-mps2/target/thumbv7em-none-eabihf/release/
//! gonia-qemu-mps2) and `qemu-system-arm`; so it is ignored unless `cargo xtask test` asks
//! for it. QEMU does not keep real time: positions, counts and replies are asserted, never rates.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use gonia::link::{Controller, LinkError, StreamTransport, Transport};
use gonia_protocol::NODE_ANY;
use gonia_protocol::message::{Arm, Outcome, Refusal, State, Trigger};
use gonia_protocol::settings::{Axis, Key};

const MINUTE_US: u64 = 60_000_000;

/// A running emulator; it dies with this value.
struct Qemu(Child);

impl Drop for Qemu {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The image to run.
fn image() -> PathBuf {
    let elf = std::env::var_os("GONIA_QEMU_ELF")
        .map(PathBuf::from)
        .expect("GONIA_QEMU_ELF: build firmware/boards/qemu-mps2 and name its program");
    assert!(
        elf.is_file(),
        "GONIA_QEMU_ELF: {} is no file",
        elf.display()
    );
    elf
}

fn start(elf: &Path, folder: &Path) -> (Qemu, StreamTransport) {
    let socket = folder.join("wire.sock");
    let child = Command::new("qemu-system-arm")
        .args([
            "-M",
            "mps2-an386",
            "-display",
            "none",
            "-monitor",
            "none",
            "-serial",
        ])
        .arg(format!("unix:{},server=on,wait=off", socket.display()))
        .arg("-serial")
        .arg(format!("file:{}", folder.join("defmt.bin").display()))
        .arg("-kernel")
        .arg(elf)
        .spawn()
        .unwrap();
    let qemu = Qemu(child);
    let began = Instant::now();
    loop {
        match StreamTransport::open_unix(&socket) {
            Ok(transport) => return (qemu, transport),
            Err(error) => assert!(began.elapsed() < Duration::from_secs(20), "{error}"),
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
#[ignore = "needs qemu-system-arm and the board's program; cargo xtask test runs it"]
fn arm_code_homes_reaches_poses_and_latches_a_train() {
    let elf = image();
    let folder = tempfile::tempdir().unwrap();
    let (_qemu, mut transport) = start(&elf, folder.path());
    // Noise first: the other end must find the frames that follow.
    transport.send(&[0xFF, 1, 2, 3, 0, 0, 9]).unwrap();
    let mut arm = Controller::connect(Box::new(transport), NODE_ANY).unwrap();
    assert_eq!(arm.name(), "light arm");
    assert_eq!(arm.identity().board.as_str(), "qemu-mps2");
    assert_eq!(arm.identity().firmware, gonia_firmware::VERSION);

    let refused = arm.move_to([0, 0]);
    let not_homed = matches!(
        refused,
        Err(LinkError::Refused {
            refusal: Refusal::NotHomed,
            ..
        })
    );
    assert!(not_homed);
    arm.set_setting(Axis::Phi, Key::HomeFastSpeed, 12_000_000)
        .unwrap();
    assert_eq!(
        arm.setting(Axis::Phi, Key::HomeFastSpeed).unwrap(),
        12_000_000
    );

    let homing = arm.home().unwrap();
    assert_eq!(
        arm.wait(homing, 2 * MINUTE_US).unwrap().outcome,
        Outcome::Done
    );
    assert!(arm.status().unwrap().homed);

    for target in [
        [0, -185_000_000],
        [15_000_000, -170_000_000],
        [12_500_000, -175_250_000],
    ] {
        let ticket = arm.move_to(target).unwrap();
        let end = arm.wait(ticket, 2 * MINUTE_US).unwrap();
        assert_eq!(end.outcome, Outcome::Done, "{target:?}");
        for (encoder, target) in end.encoder_udeg.into_iter().zip(target) {
            assert!(encoder.abs_diff(target) <= 6000, "{encoder} {target}");
        }
    }

    let train = Arm {
        trigger: Trigger::Source,
        exposures_us: [1000, 4000, 16_000].into_iter().collect(),
        gap_us: 500,
    };
    arm.arm(train).unwrap();
    let fired = arm.fire().unwrap();
    assert_eq!(arm.wait(fired, MINUTE_US).unwrap().outcome, Outcome::Done);
    for pulse in 0..3 {
        let latch = arm.latch(pulse).unwrap();
        assert!(latch.within);
        assert!(latch.encoder_udeg[0].abs_diff(12_500_000) <= 30_000);
    }

    arm.emergency_stop().unwrap();
    assert_eq!(arm.status().unwrap().state, State::EStop);
    arm.clear_fault().unwrap();
    assert_eq!(arm.status().unwrap().state, State::Unhomed);
    assert!(
        arm.status().unwrap().frames_bad >= 1,
        "the noise was counted"
    );
    let log = std::fs::metadata(folder.path().join("defmt.bin")).unwrap();
    assert!(log.len() > 0, "the log says nothing");
}
