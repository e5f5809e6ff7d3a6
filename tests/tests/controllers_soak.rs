//! Every command exactly once: the real host's link and the real firmware core over a wire that
//! bends one byte in a hundred. What is *done* is counted where it is done: at the board's memory,
//! which each command of a pair writes once.

#![allow(clippy::unwrap_used)]

use std::sync::{Arc, Mutex};

use gonia_acquire::link::{RemoteController, Transport};
use gonia_firmware::controller::ArmController;
use gonia_firmware::driver::DriverBus;
use gonia_firmware::hardware::{
    DriverAnswer, DriverBytes, EncoderKind, EncoderLost, EncoderSetup, EncoderWord, Hardware,
    NotSaved,
};
use gonia_firmware::node::{ControllerNode, identity};
use gonia_firmware::settings::ControllerSettings;
use gonia_firmware::steps::{Period, StepProgress};
use gonia_protocol::NODE_LIGHT;
use gonia_protocol::message::ResetReason;
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::fault::WireFaults;
use gonia_sim::wire::Wire;

/// A quarter of a hundredth each: one byte in a hundred suffers something.
const FAULTS: WireFaults = WireFaults {
    flip: 0.0025,
    drop: 0.0025,
    repeat: 0.0025,
    delay: 0.0025,
    delay_us: 20_000,
};
/// The values that the commands set go round from here.
const LOWEST: i32 = 1_000;
const VALUES: u32 = 29_000;

/// A board at rest whose memory remembers what was written to it.
#[derive(Default)]
struct Board {
    saved: Vec<i32>,
}

impl Hardware for Board {
    fn queue_step(&mut self, _: Axis, _: Period) {}
    fn progress(&mut self, _: Axis) -> StepProgress {
        StepProgress::default()
    }
    fn halt(&mut self, _: Axis) {}
    fn has_encoder(&self, _: Axis, _: EncoderKind) -> bool {
        true
    }
    fn encoder_word(&mut self, _: Axis, _: EncoderSetup) -> Result<EncoderWord, EncoderLost> {
        Ok(1000.into())
    }
    fn has_driver_bus(&self, _: DriverBus) -> bool {
        false
    }
    fn ask_driver(&mut self, _: Axis, _: DriverBus, _: DriverBytes, _: usize) -> bool {
        false
    }
    fn driver_answer(&mut self, _: Axis, _: DriverBus) -> DriverAnswer {
        DriverAnswer::Waiting
    }
    fn home_switch_closed(&mut self, _: Axis) -> bool {
        false
    }
    fn alarm_closed(&mut self, _: Axis) -> bool {
        false
    }
    fn switch_drivers(&mut self, _: bool) {}
    fn release_brakes(&mut self, _: bool) {}
    fn interlock_closed(&mut self) -> bool {
        true
    }
    fn hold_interlock_open(&mut self, _: bool) {}
    fn begin_pulse(&mut self, now_us: u64, _: u32) -> u64 {
        now_us
    }
    fn end_pulse(&mut self) {}
    fn save_settings(&mut self, bytes: &[u8]) -> Result<(), NotSaved> {
        let settings = ControllerSettings::from_bytes(bytes).map_err(|_| NotSaved)?;
        self.saved.push(settings.get(Axis::Theta, Key::Telemetry));
        Ok(())
    }
}

/// Both ends of the line and what is under way, in virtual time.
struct Line {
    now_us: u64,
    node: ControllerNode,
    board: Board,
    to_device: Wire,
    to_host: Wire,
}

impl Line {
    fn new(seed: u64) -> Self {
        let identity = identity("soak", 1, ResetReason::PowerOn, "");
        Self {
            now_us: 0,
            node: ControllerNode::new(NODE_LIGHT, identity, ArmController::new(0, None)),
            board: Board::default(),
            to_device: Wire::new(FAULTS, 2 * seed),
            to_host: Wire::new(FAULTS, 2 * seed + 1),
        }
    }

    fn advance(&mut self, limit_us: u64) {
        let next_us = self.node.wake_us().min(self.to_device.next_us());
        self.now_us = self.now_us.max(next_us.min(limit_us));
        if self.node.wake_us() <= self.now_us {
            self.node.poll(self.now_us, &mut self.board);
        }
        while let Some(byte) = self.to_device.take(self.now_us) {
            self.node.receive(byte, self.now_us, &mut self.board);
        }
        while let Some(packet) = self.node.take_packet() {
            self.to_host.send(self.now_us, &packet);
        }
    }
}

struct HostEnd(Arc<Mutex<Line>>);

impl Transport for HostEnd {
    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let mut line = self.0.lock().unwrap();
        let now_us = line.now_us;
        line.to_device.send(now_us, bytes);
        Ok(())
    }

    fn receive(&mut self, out: &mut Vec<u8>, timeout_us: u64) -> std::io::Result<()> {
        let mut line = self.0.lock().unwrap();
        let deadline_us = line.now_us + timeout_us;
        loop {
            let now_us = line.now_us;
            while let Some(byte) = line.to_host.take(now_us) {
                out.push(byte);
            }
            if !out.is_empty() || line.now_us >= deadline_us {
                return Ok(());
            }
            let limit_us = deadline_us.min(line.to_host.next_us());
            line.advance(limit_us);
        }
    }

    fn now_us(&self) -> u64 {
        self.0.lock().unwrap().now_us
    }
}

/// Pairs of commands: set a value never set just before, and save it.
fn soak(seed: u64, commands: u32) {
    let line = Arc::new(Mutex::new(Line::new(seed)));
    let mut arm =
        RemoteController::connect(Box::new(HostEnd(Arc::clone(&line))), NODE_LIGHT).unwrap();
    let value = |i: u32| LOWEST + (i % VALUES) as i32;
    for i in 0..commands / 2 {
        arm.set_setting(Axis::Theta, Key::Telemetry, value(i))
            .unwrap();
        arm.save_settings().unwrap();
    }
    let status = arm.status().unwrap();
    let (_, repeats) = arm.losses();
    let line = line.lock().unwrap();
    let done = &line.board.saved;
    println!(
        "{commands} commands: {} saves done of {}, {repeats} requests repeated; packets at the \
         device: {} good, {} bent; {:.1} h virtual",
        done.len(),
        commands / 2,
        status.packets_good,
        status.packets_bad,
        line.now_us as f64 / 3.6e9
    );
    // None lost, none twice, none before its turn, and each with the value set just before.
    assert_eq!(done.len() as u32, commands / 2);
    for (i, &saved) in (0..).zip(done) {
        assert_eq!(saved, value(i), "command {i}");
    }
    assert!(
        repeats > commands / 20,
        "the wire was not bad enough: {repeats}"
    );
    assert!(status.packets_bad > commands / 20);
    // What arrived whole more than once was answered and not done again.
    assert!(status.packets_good > commands + 1);
}

#[test]
fn every_command_is_done_exactly_once_over_a_wire_that_bends_a_byte_in_a_hundred() {
    soak(1, 20_000);
}

/// `cargo xtask figures soak` writes its counters into the book.
#[test]
#[ignore = "a million commands take minutes; prints the counters"]
fn a_million_commands_are_each_done_exactly_once() {
    soak(2, 1_000_000);
}
