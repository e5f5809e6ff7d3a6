//! Pins by their data.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, AnyPin, Flex, Input, OutputType, Pull, Speed};
use embassy_stm32::pac::gpio::Gpio;
use embassy_stm32::pac::gpio::vals::{Idr, Ot, Pupdr};
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

/// Three inputs on one port, read at one moment.
pub struct Inputs {
    port: Gpio,
    masks: [u32; 3],
}

impl Inputs {
    /// Inputs with pull-ups: an open collector gives levels as well as a line receiver does. All are on the first one's
    /// port.
    pub fn pulled_up(wires: [Wire; 3]) -> Self {
        for wire in wires {
            core::mem::forget(switch(wire));
        }
        let [first, ..] = wires;
        Self {
            port: any(first.pin).block(),
            masks: wires.map(|wire| 1 << wire.pin.number),
        }
    }

    /// Whether each is high.
    #[inline]
    pub fn read(&self) -> [bool; 3] {
        let levels = self.port.idr().read().0;
        let [first, second, third] = self.masks;
        [
            levels & first != 0,
            levels & second != 0,
            levels & third != 0,
        ]
    }
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

    /// Whether an output drives its high level, or leaves it to a pull-up.
    pub fn drive_high(self, drives: bool) {
        let how = if drives {
            Ot::PUSH_PULL
        } else {
            Ot::OPEN_DRAIN
        };
        self.port.otyper().modify(|w| w.set_ot(self.number, how));
    }

    /// The level that is there.
    #[inline]
    pub fn is_high(self) -> bool {
        self.port.idr().read().idr(self.number) == Idr::HIGH
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

/// A line that is pulled low or left alone, with a pull-up; left alone now.
pub fn open_drain(wire: Wire) -> Line {
    let line = Line::of(wire.pin);
    line.set(Level::High);
    line.drive_high(false);
    let mut pin = Flex::new(any(wire.pin));
    pin.set_as_input_output(Speed::Low);
    core::mem::forget(pin);
    line.port
        .pupdr()
        .modify(|w| w.set_pupdr(line.number, Pupdr::PULL_UP));
    line
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
