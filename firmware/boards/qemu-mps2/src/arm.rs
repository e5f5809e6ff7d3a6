//! The arm: real step timers in front of the simulator's motors, its encoders and switches behind.

use gonia_firmware::driver::DriverBus;
use gonia_firmware::hardware::{
    DriverAnswer, DriverBytes, EncoderKind, EncoderLost, EncoderSetup, EncoderWord, Hardware,
    NotSaved,
};
use gonia_firmware::steps::{Period, StepProgress};
use gonia_protocol::settings::Axis;
use gonia_sim::arm::SimulatedArm;

use crate::steps;

/// The simulated arm, with the board's timers for its own.
pub struct EmulatedArm(pub SimulatedArm);

impl EmulatedArm {
    /// The time at which the firmware looks at its pins: steps given by then have moved the motors.
    pub fn set_now(&mut self, now_us: u64) {
        while let Some(given) = steps::take_given() {
            self.0.axis(given.axis).step(given.up, given.at_us);
        }
        self.0.set_now(now_us);
    }
}

impl Hardware for EmulatedArm {
    fn queue_step(&mut self, axis: Axis, period: Period) {
        steps::queue(axis, period);
    }

    fn progress(&mut self, axis: Axis) -> StepProgress {
        steps::progress(axis)
    }

    fn halt(&mut self, axis: Axis) {
        steps::halt(axis);
    }

    fn has_encoder(&self, axis: Axis, kind: EncoderKind) -> bool {
        self.0.has_encoder(axis, kind)
    }

    fn encoder_word(
        &mut self,
        axis: Axis,
        setup: EncoderSetup,
    ) -> Result<EncoderWord, EncoderLost> {
        self.0.encoder_word(axis, setup)
    }

    fn has_driver_bus(&self, bus: DriverBus) -> bool {
        self.0.has_driver_bus(bus)
    }

    fn ask_driver(
        &mut self,
        axis: Axis,
        bus: DriverBus,
        request: DriverBytes,
        answer_len: usize,
    ) -> bool {
        self.0.ask_driver(axis, bus, request, answer_len)
    }

    fn driver_answer(&mut self, axis: Axis, bus: DriverBus) -> DriverAnswer {
        self.0.driver_answer(axis, bus)
    }

    fn home_switch_closed(&mut self, axis: Axis) -> bool {
        self.0.home_switch_closed(axis)
    }

    fn alarm_closed(&mut self, axis: Axis) -> bool {
        self.0.alarm_closed(axis)
    }

    fn switch_drivers(&mut self, on: bool) {
        self.0.switch_drivers(on);
    }

    fn release_brakes(&mut self, released: bool) {
        self.0.release_brakes(released);
    }

    fn interlock_closed(&mut self) -> bool {
        self.0.interlock_closed()
    }

    fn hold_interlock_open(&mut self, open: bool) {
        self.0.hold_interlock_open(open);
    }

    fn begin_pulse(&mut self, now_us: u64, length_us: u32) -> u64 {
        self.0.begin_pulse(now_us, length_us)
    }

    fn end_pulse(&mut self) {
        self.0.end_pulse();
    }

    fn save_settings(&mut self, bytes: &[u8]) -> Result<(), NotSaved> {
        self.0.save_settings(bytes)
    }
}
