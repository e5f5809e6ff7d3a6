//! Everything that one arm's controller is wired to.

use embassy_stm32::gpio::{Input, Output};
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::Spi;
use embassy_stm32::spi::mode::Master;
use gonia_firmware::hardware::{EncoderLost, Hardware, NotSaved};
use gonia_firmware::ssi::SsiEncoder;
use gonia_firmware::steps::{Period, StepProgress};
use gonia_firmware::store::Store;
use gonia_protocol::settings::Axis;

use crate::sectors::FlashSectors;
use crate::{now_us, steps};

/// Pins, encoders and memory; the drivers are with the step timers. Pairs are θ and φ.
pub struct ArmPins {
    /// The shafts.
    pub encoders: [SsiEncoder<Spi<'static, Blocking, Master>>; 2],
    /// To ground when closed.
    pub home_switches: [Input<'static>; 2],
    /// To ground while the chain is closed, so that a cut wire stops the arm.
    pub interlock: Input<'static>,
    /// High: a relay opens the chain.
    pub interlock_relay: Output<'static>,
    /// To the camera and to the other arm.
    pub trigger: Output<'static>,
    /// Settings.
    pub store: Store,
    /// Where they are kept.
    pub sectors: FlashSectors,
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

    fn encoder_counts(&mut self, axis: Axis) -> Result<u32, EncoderLost> {
        self.encoders[axis.index()].counts(now_us())
    }

    fn home_switch_closed(&mut self, axis: Axis) -> bool {
        self.home_switches[axis.index()].is_low()
    }

    fn interlock_closed(&mut self) -> bool {
        self.interlock.is_low()
    }

    fn hold_interlock_open(&mut self, open: bool) {
        self.interlock_relay.set_level(open.into());
    }

    fn set_trigger(&mut self, on: bool) {
        self.trigger.set_level(on.into());
    }

    fn save_settings(&mut self, bytes: &[u8]) -> Result<(), NotSaved> {
        self.store.save(&mut self.sectors, bytes)
    }
}
