//! Everything that one arm's controller is wired to.

use embassy_stm32::gpio::Input;
use gonia_firmware::driver::DriverBus;
use gonia_firmware::hardware::{
    DriverAnswer, DriverBytes, EncoderKind, EncoderLost, EncoderSetup, EncoderWord, Hardware,
    NotSaved,
};
use gonia_firmware::spi_encoder::SpiEncoder;
use gonia_firmware::steps::{Period, StepProgress};
use gonia_firmware::store::Store;
use gonia_protocol::settings::Axis;

use crate::drivers::Drivers;
use crate::encoder::EncoderSpi;
use crate::sectors::FlashSectors;
use crate::{alive, now_us, pulses, quadrature, steps};

/// Pins, encoders and memory; steps are with their timers. Pairs are θ and φ.
pub struct ArmPins {
    /// The shafts.
    pub encoders: [SpiEncoder<EncoderSpi>; 2],
    /// To ground when closed.
    pub home_switches: [Input<'static>; 2],
    /// To ground when closed, where the board has them.
    pub alarms: Option<[Input<'static>; 2]>,
    /// By which drivers are set, where the board has wires for that.
    pub drivers: Option<Drivers>,
    /// To ground while the chain is closed, so that a cut wire stops the arm.
    pub interlock: Input<'static>,
    /// Settings.
    pub store: Store,
    /// Where they are kept.
    pub sectors: FlashSectors,
}

/// A relay's contact follows its coil within 5 to 10 ms; twice that is enough.
const RELAY_US: u64 = 20_000;

impl ArmPins {
    /// Waits until the relay has had its time, or the chain is closed. Nothing moves meanwhile.
    pub fn await_chain(&self) {
        let until_us = now_us() + RELAY_US;
        while self.interlock.is_high() && now_us() < until_us {
            alive::keep();
        }
    }
}

impl Hardware for ArmPins {
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
        kind != EncoderKind::Quadrature || quadrature::has_pins(axis)
    }

    fn encoder_word(
        &mut self,
        axis: Axis,
        setup: EncoderSetup,
    ) -> Result<EncoderWord, EncoderLost> {
        if setup.kind == EncoderKind::Quadrature {
            return quadrature::word(axis, setup.turn);
        }
        quadrature::leave(axis);
        self.encoders[axis.index()].word(now_us(), setup)
    }

    fn has_driver_bus(&self, _: DriverBus) -> bool {
        self.drivers.is_some()
    }

    fn ask_driver(
        &mut self,
        axis: Axis,
        bus: DriverBus,
        request: DriverBytes,
        answer_len: usize,
    ) -> bool {
        let drivers = self.drivers.as_mut();
        drivers.is_none_or(|drivers| drivers.ask(axis, bus, request, answer_len))
    }

    fn driver_answer(&mut self, axis: Axis, bus: DriverBus) -> DriverAnswer {
        let drivers = self.drivers.as_mut();
        drivers.map_or(DriverAnswer::Silent, |drivers| drivers.answer(axis, bus))
    }

    fn home_switch_closed(&mut self, axis: Axis) -> bool {
        self.home_switches[axis.index()].is_low()
    }

    fn alarm_closed(&mut self, axis: Axis) -> bool {
        let alarms = self.alarms.as_ref();
        alarms.is_some_and(|alarms| alarms[axis.index()].is_low())
    }

    fn switch_drivers(&mut self, on: bool) {
        alive::switch_drivers(on);
    }

    fn release_brakes(&mut self, released: bool) {
        alive::release_brakes(released);
    }

    fn interlock_closed(&mut self) -> bool {
        self.interlock.is_low()
    }

    fn hold_interlock_open(&mut self, open: bool) {
        alive::hold_open(open);
        if !open {
            self.await_chain();
        }
    }

    fn begin_pulse(&mut self, _: u64, length_us: u32) -> u64 {
        pulses::begin(length_us)
    }

    fn end_pulse(&mut self) {
        pulses::end();
    }

    fn save_settings(&mut self, bytes: &[u8]) -> Result<(), NotSaved> {
        self.store.save(&mut self.sectors, bytes)
    }
}
