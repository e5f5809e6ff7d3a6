//! The firmware as real ARM code in QEMU, over a Unix socket, and the simulator beside it: the same
//! host, the same commands, the same core; so the same answers, positions and counts.
//!
//! Needs `GONIA_QEMU_ELF` (firmware/boards/qemu-mps2/target/thumbv7em-none-eabihf/release/
//! gonia-qemu-mps2) and `qemu-system-arm`; so it is ignored unless `cargo xtask test` asks
//! for it. QEMU does not keep real time: positions, counts and replies are asserted, never rates.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use gonia_acquire::link::{LinkError, RemoteController, StreamTransport, Transport};
use gonia_protocol::NODE_LIGHT;
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    ControllerState, RequestOutcome, RequestRefusal, TriggerRequest, TriggerRole,
};
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::arm::SimulatedArm;
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::rig::SimRig;
use gonia_tests::random::uniform;

const MINUTE_US: u64 = 60_000_000;
const N_POSES: usize = 50;
/// After these poses: a trigger train; the host falls silent; an emergency stop.
const TRAIN_AFTER: usize = 20;
const SILENT_AFTER: usize = 35;
const STOP_AFTER: usize = 42;
/// Where an arm stops that is told to stop in mid-move is a matter of time, and so is which of the steps
/// around a target is reached from there, and by how much of a count its next home differs from the
/// last. So two readings may differ by a step, a count of the zero and a count of the reading, µdeg.
const STEP_UDEG: u32 = 2_500 + 2 * 1_374;
/// Of so many bytes one is bent: on the way there, some 2500 bytes, so that some surely are; and on the
/// way back, where a lost event costs the host two seconds.
const ONE_IN_THERE: u32 = 250;
const ONE_IN_BACK: u32 = 1500;

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
        .args(["-M", "mps2-an386", "-display", "none", "-monitor", "none"])
        .arg("-serial")
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

/// A wire that flips a bit of a byte now and then, both ways.
struct Bent<T> {
    wire: T,
    bytes: usize,
}

impl<T> Bent<T> {
    fn bend(&mut self, bytes: &mut [u8], one_in: u32) {
        for byte in bytes {
            self.bytes += 1;
            if uniform(1, self.bytes) * f64::from(one_in) < 1.0 {
                *byte ^= 1 << (uniform(2, self.bytes) * 8.0) as u32;
            }
        }
    }
}

impl<T: Transport> Transport for Bent<T> {
    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let mut bytes = bytes.to_vec();
        self.bend(&mut bytes, ONE_IN_THERE);
        self.wire.send(&bytes)
    }

    fn receive(&mut self, out: &mut Vec<u8>, timeout_us: u64) -> std::io::Result<()> {
        let before = out.len();
        self.wire.receive(out, timeout_us)?;
        self.bend(&mut out[before..], ONE_IN_BACK);
        Ok(())
    }

    fn now_us(&self) -> u64 {
        self.wire.now_us()
    }
}

/// What the host got to know, without times.
struct Seen {
    /// Where each move ended, by encoder.
    ends: Vec<(RequestOutcome, [i32; 2])>,
    /// What each pulse latched.
    latches: Vec<([i32; 2], bool)>,
    /// Before the arm is stopped in mid-move: where its steps say it is, µdeg, corrections, and steps
    /// missed.
    counts: [(i32, u32, u32); 2],
    settings_crc: u32,
    log: Vec<Option<FaultCode>>,
}

fn home(arm: &mut RemoteController) {
    let homing = arm.home().unwrap();
    let end = arm.wait(homing, 2 * MINUTE_US).unwrap();
    assert_eq!(end.outcome, RequestOutcome::Done);
    assert!(arm.status().unwrap().homed);
}

/// Poses within 8° of home, up and down, near and far.
fn target(i: usize) -> [i32; 2] {
    let i = i as i32;
    [
        (i * 1_370_000).rem_euclid(8_000_000) - 1_000_000,
        (i * 2_930_000).rem_euclid(9_000_000) - 184_000_000,
    ]
}

/// Hello was said. Homing, poses, a fault, a train, an emergency stop, homing, poses.
fn session(arm: &mut RemoteController) -> Seen {
    let refused = arm.move_to([0, 0]);
    let not_homed = matches!(
        refused,
        Err(LinkError::Refused {
            refusal: RequestRefusal::NotHomed,
            ..
        })
    );
    assert!(not_homed);
    let faster = [
        (Key::Acceleration, 60_000_000),
        (Key::SettlingTime, 40_000),
        (Key::HomeSlowSpeed, 1_000_000),
        (Key::HomeBackoff, 300_000),
    ];
    for (key, value) in faster {
        for axis in Axis::BOTH {
            arm.set_setting(axis, key, value).unwrap();
            assert_eq!(arm.setting(axis, key).unwrap(), value);
        }
    }
    arm.save_settings().unwrap();
    home(arm);

    let mut ends = Vec::new();
    let (mut latches, mut counts) = (Vec::new(), Default::default());
    for i in 0..N_POSES {
        let ticket = arm.move_to(target(i)).unwrap();
        let end = arm.wait(ticket, 2 * MINUTE_US).unwrap();
        for (encoder, target) in end.encoder_udeg.into_iter().zip(target(i)) {
            assert!(encoder.abs_diff(target) <= 6000, "{i}: {encoder} {target}");
        }
        ends.push((end.outcome, end.encoder_udeg));
        match i {
            TRAIN_AFTER => latches = train(arm),
            SILENT_AFTER => {
                let axes = arm.status().unwrap().axes;
                counts = axes.map(|a| (a.commanded_udeg, a.corrections, a.missed_steps));
                silence(arm);
            }
            STOP_AFTER => {
                arm.emergency_stop().unwrap();
                assert_eq!(arm.status().unwrap().state, ControllerState::EStop);
                arm.clear_fault().unwrap();
                assert_eq!(arm.status().unwrap().state, ControllerState::Unhomed);
                home(arm);
            }
            _ => {}
        }
    }
    Seen {
        ends,
        latches,
        counts,
        settings_crc: arm.status().unwrap().config_crc,
        log: arm.log().unwrap().into_iter().map(|e| e.fault).collect(),
    }
}

/// The host falls silent in mid-move: the arm stops by itself, latches, and is cleared.
fn silence(arm: &mut RemoteController) {
    arm.set_setting(Axis::Theta, Key::HostWatchdog, 200_000)
        .unwrap();
    arm.move_to([0, -100_000_000]).unwrap();
    arm.rest(1_500_000).unwrap();
    let status = arm.status().unwrap();
    assert_eq!(
        status.state,
        ControllerState::Fault(FaultCode::HOST_WATCHDOG)
    );
    assert!(status.homed, "it slowed down: no step was lost");
    arm.clear_fault().unwrap();
    arm.set_setting(Axis::Theta, Key::HostWatchdog, 2_000_000)
        .unwrap();
}

fn train(arm: &mut RemoteController) -> Vec<([i32; 2], bool)> {
    let pulses = [1000, 4000, 16_000];
    let train = TriggerRequest {
        trigger: TriggerRole::Source,
        exposures_us: pulses.into_iter().collect(),
        gap_us: 500,
    };
    arm.request_trigger(train).unwrap();
    let fired = arm.fire().unwrap();
    assert_eq!(
        arm.wait(fired, MINUTE_US).unwrap().outcome,
        RequestOutcome::Done
    );
    let latch = |pulse| {
        let latch = arm.latch(pulse).unwrap();
        (latch.encoder_udeg, latch.within)
    };
    (0..pulses.len() as u8).map(latch).collect()
}

#[test]
#[ignore = "needs qemu-system-arm and the board's program; cargo xtask test runs it"]
fn arm_code_ends_where_the_simulator_does_over_a_wire_that_bends_bytes() {
    let elf = image();
    let folder = tempfile::tempdir().unwrap();
    let (_qemu, transport) = start(&elf, folder.path());
    let bent = Bent {
        wire: transport,
        bytes: 0,
    };
    let mut arm = RemoteController::connect(Box::new(bent), NODE_LIGHT).unwrap();
    assert_eq!(arm.identity().board.as_str(), "qemu-mps2");
    assert_eq!(arm.identity().firmware, gonia_firmware::VERSION);
    let in_qemu = session(&mut arm);
    let status = arm.status().unwrap();
    let (good, bad) = (status.packets_good, status.packets_bad);
    let (lost, repeated) = arm.losses();
    println!(
        "QEMU: {N_POSES} poses; packets {good} good, {bad} bent; {repeated} requests repeated, {lost} events lost"
    );
    assert!(bad > 0 && repeated > 0, "the wire bent nothing");

    let arms = [
        SimulatedArm::quiet_arm_near_home(),
        SimulatedArm::default_arm(2),
    ];
    let rig = SimRig::with_arms(1, FaultPlan::default(), arms);
    let port = Box::new(rig.port(Arm::Light));
    let mut arm = RemoteController::connect(port, NODE_LIGHT).unwrap();
    let simulated = session(&mut arm);
    let after = SILENT_AFTER + 1;
    assert_eq!(in_qemu.ends[..after], simulated.ends[..after]);
    for (here, there) in in_qemu.ends[after..].iter().zip(&simulated.ends[after..]) {
        assert_eq!(here.0, there.0);
        for (here, there) in here.1.into_iter().zip(there.1) {
            assert!(here.abs_diff(there) <= STEP_UDEG, "{here} {there}");
        }
    }
    assert_eq!(in_qemu.latches, simulated.latches);
    assert_eq!(in_qemu.counts, simulated.counts);
    assert_eq!(in_qemu.settings_crc, simulated.settings_crc);
    assert_eq!(in_qemu.log, simulated.log);

    let log = std::fs::metadata(folder.path().join("defmt.bin")).unwrap();
    assert!(log.len() > 0, "the log says nothing");
}
