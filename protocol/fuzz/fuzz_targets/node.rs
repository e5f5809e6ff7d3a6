//! A whole controller: the fuzzer writes packets, noise, sensor readings and time. Nothing panics,
//! and no step is given before homing.
#![no_main]

use gonia_firmware::controller::ArmController;
use gonia_firmware::driver::DriverBus;
use gonia_firmware::hardware::{
    DriverAnswer, DriverBytes, EncoderKind, EncoderLost, EncoderSetup, EncoderWord, Hardware,
    NotSaved,
};
use gonia_firmware::node::{ControllerNode, identity};
use gonia_firmware::steps::{End, Period, StepProgress};
use gonia_protocol::NODE_LIGHT;
use gonia_protocol::message::{ControllerState, Hello, Message, Move, ResetReason, Setting};
use gonia_protocol::packet::encode;
use gonia_protocol::settings::Axis;
use libfuzzer_sys::fuzz_target;

#[derive(Default)]
struct Pins {
    sensors: u8,
    steps: u64,
}

impl Hardware for Pins {
    fn queue_step(&mut self, _: Axis, period: Period) {
        self.steps += u64::from(period.end() == End::Step);
    }
    fn progress(&mut self, _: Axis) -> StepProgress {
        StepProgress {
            given: self.steps as i32,
            waiting: usize::from(self.sensors >> 1),
            is_playing: self.sensors & 0x80 != 0,
        }
    }
    fn halt(&mut self, _: Axis) {}
    fn has_encoder(&self, _: Axis, _: EncoderKind) -> bool {
        true
    }
    fn encoder_word(&mut self, _: Axis, _: EncoderSetup) -> Result<EncoderWord, EncoderLost> {
        match self.sensors & 7 {
            0 | 4 => Err(EncoderLost::Silent),
            1 => Ok(u32::MAX.into()),
            2 => Err(EncoderLost::Invalid),
            5 if self.sensors & 8 != 0 => Err(EncoderLost::Edge),
            5 => Err(EncoderLost::Index),
            _ => Ok(EncoderWord {
                counts: u32::from(self.sensors) << 10,
                warns: self.sensors & 8 != 0,
                index: (self.sensors & 16 != 0).then_some(u32::from(self.sensors)),
            }),
        }
    }
    fn has_driver_bus(&self, _: DriverBus) -> bool {
        true
    }
    fn ask_driver(&mut self, _: Axis, _: DriverBus, _: DriverBytes, _: usize) -> bool {
        self.sensors & 16 == 0
    }
    fn driver_answer(&mut self, _: Axis, _: DriverBus) -> DriverAnswer {
        match self.sensors & 96 {
            0 => DriverAnswer::Waiting,
            32 => DriverAnswer::Silent,
            // Any bytes, of any length.
            _ => DriverAnswer::Bytes([self.sensors; 10][..usize::from(self.sensors % 11)].iter().copied().collect()),
        }
    }
    fn home_switch_closed(&mut self, _: Axis) -> bool {
        self.sensors & 4 != 0
    }
    fn alarm_closed(&mut self, _: Axis) -> bool {
        self.sensors & 8 != 0
    }
    fn switch_drivers(&mut self, _: bool) {}
    fn release_brakes(&mut self, _: bool) {}
    fn interlock_closed(&mut self) -> bool {
        self.sensors & 0x38 != 0x38
    }
    fn hold_interlock_open(&mut self, _: bool) {}
    fn begin_pulse(&mut self, now_us: u64, _: u32) -> u64 {
        now_us
    }
    fn end_pulse(&mut self) {}
    fn save_settings(&mut self, _: &[u8]) -> Result<(), NotSaved> {
        if self.sensors & 0x40 == 0 {
            Ok(())
        } else {
            Err(NotSaved)
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let identity = identity("fuzz", 0, ResetReason::Unknown, "");
    let mut pins = Pins::default();
    let mut node = ControllerNode::new(NODE_LIGHT, identity, ArmController::new(0, None));
    let (mut now_us, mut request) = (0u64, 0u16);
    let mut may_move = false;
    for chunk in bytes.chunks(6) {
        let [deed, rest @ ..] = chunk else { continue };
        let mut word = [0; 4];
        for (to, from) in word.iter_mut().zip(rest) {
            *to = *from;
        }
        let value = i32::from_le_bytes(word);
        let message = match deed % 16 {
            0 => Message::Hello(Hello {
                session: value as u32,
            }),
            1 => Message::Home,
            2 => Message::Move(Move {
                target_udeg: [value % 100_000_000, value],
            }),
            3 => Message::Fire,
            4 => Message::Stop,
            5 => Message::EStop,
            6 => Message::ClearFault,
            7 => Message::SaveSettings,
            8 => Message::SetSetting(Setting {
                axis: Axis::Theta,
                key: deed / 16 + word[0] % 16,
                value,
            }),
            9 => {
                pins.sensors = word[0];
                continue;
            }
            10 => {
                for byte in rest {
                    node.receive(*byte, now_us, &mut pins);
                }
                continue;
            }
            11 => Message::Heartbeat,
            _ => {
                let until_us = now_us + u64::from(word[0]) * 1_000;
                while node.wake_us() <= until_us {
                    now_us = now_us.max(node.wake_us());
                    node.poll(now_us, &mut pins);
                    while node.take_packet().is_some() {}
                }
                now_us = until_us;
                continue;
            }
        };
        may_move |= matches!(message, Message::Home);
        request = request.wrapping_add(1).max(1);
        let packet = encode(NODE_LIGHT, request, &message).expect("short");
        for &byte in &packet {
            node.receive(byte, now_us, &mut pins);
        }
        while node.take_packet().is_some() {}
    }
    assert!(may_move || pins.steps == 0, "steps before homing");
    assert!(may_move || node.controller().state() != ControllerState::Idle);
});
