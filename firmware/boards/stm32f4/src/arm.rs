//! Everything that one arm's controller is wired to.

use embassy_stm32::gpio::{Input, Output};
use embassy_time::Delay;
use gonia_firmware::hardware::{EncoderLost, Hardware, NotSaved};
use gonia_firmware::pins::StepDir;
use gonia_firmware::store::Store;
use gonia_protocol::settings::Axis;

use crate::encoder::Encoder;
use crate::sectors::FlashSectors;

/// A driver's pins.
pub type Driver = StepDir<Output<'static>, Output<'static>, Delay>;

/// Pins, encoders and memory. Pairs are θ and φ.
pub struct ArmPins {
    /// Step and direction.
    pub drivers: [Driver; 2],
    /// The shafts.
    pub encoders: [Encoder; 2],
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
    fn step(&mut self, axis: Axis, forward: bool, _due_us: u64) {
        // The pins of this chip cannot fail.
        let _ = self.drivers[axis.index()].step(forward);
    }

    fn encoder_counts(&mut self, axis: Axis) -> Result<u32, EncoderLost> {
        self.encoders[axis.index()].counts()
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
