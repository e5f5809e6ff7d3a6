//! Pins by their data.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, AnyPin, Flex, Input, OutputType, Pull, Speed};
use embassy_stm32::pac::gpio::Gpio;
use gonia_pins::signals::{Signal, function};
use gonia_pins::{Level, Output, Pin, Wire};

fn any(pin: Pin) -> Peri<'static, AnyPin> {
    // SAFETY: the chip has the pin, and a board uses each once (`gonia_pins::check`, in the build).
    unsafe { AnyPin::steal(16 * pin.port_index() + pin.number) }
}

/// A contact to ground.
pub fn switch(wire: Wire) -> Input<'static> {
    Input::new(any(wire.pin), Pull::Up)
}

/// A plain output, at this level from now on.
pub fn output(wire: Wire, level: Level) -> Line {
    let line = Line::of(wire.pin);
    line.set(level);
    let mut pin = Flex::new(any(wire.pin));
    pin.set_as_output(Speed::Medium);
    // A dropped pin goes back to an input.
    core::mem::forget(pin);
    line
}

/// Gives a pin to what makes or takes a signal. One that does not carry it stays an input: the build has checked
/// that there is none.
pub fn give(wire: Wire, signal: Signal, how: AfType) {
    if let Some(function) = function(wire.pin, signal) {
        let mut pin = Flex::new(any(wire.pin));
        pin.set_as_af_unchecked(function, how);
        core::mem::forget(pin);
    }
}

/// How an output of a timer or an SPI is driven.
pub const DRIVEN: AfType = AfType::output(OutputType::PushPull, Speed::VeryHigh);

/// A plain output by its registers, for interrupts and handlers of faults.
#[derive(Clone, Copy)]
pub struct Line {
    port: Gpio,
    number: usize,
}

impl Line {
    /// The line of a pin, whatever it is used for now.
    pub fn of(pin: Pin) -> Self {
        Self {
            port: any(pin).block(),
            number: usize::from(pin.number),
        }
    }

    /// Its level from now on.
    #[inline]
    pub fn set(self, level: Level) {
        self.port.bsrr().write(|w| match level {
            Level::High => w.set_bs(self.number, true),
            Level::Low => w.set_br(self.number, true),
        });
    }
}

/// Switches an output on or off.
pub fn switch_output(output: Output, on: bool) {
    let level = if on { output.on } else { off(output) };
    Line::of(output.wire.pin).set(level);
}

/// The level of an output that is off.
pub fn off(output: Output) -> Level {
    match output.on {
        Level::High => Level::Low,
        Level::Low => Level::High,
    }
}
