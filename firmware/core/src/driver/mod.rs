//! Motors' drivers that are set by wire: TMC2209 (one wire, UART) and TMC5160 (SPI).
//!
//! Currents and microsteps are settings; they are written at the start and whenever the driver has lost them, read
//! back, and watched from then on ([`DriverWatch`]). The bytes of both chips are in `tmc2209` and `tmc5160`, the
//! registers that they share in `registers`; what carries the bytes is the board's ([`crate::hardware::Hardware`]).
//!
//! Both chips are set alike: SpreadCycle and not StealthChop, because it regulates the current in every chopper
//! cycle. A slow stage with an encoder gains by it: the torque between two microsteps is what was set from the first
//! step on, without the tuning run that StealthChop needs after each start, and it does not sag when the arm is
//! pushed; the price, a sound of the motor, costs no accuracy. The driver interpolates to 256 microsteps between
//! two steps, so that single steps do not make the arm swing; it ends on the same microstep.

mod current;
pub mod registers;
pub mod tmc2209;
pub mod tmc5160;
mod watch;

use crate::hardware::DriverBytes;

pub use crate::hardware::DriverBus;
pub use current::{Currents, currents};
pub use watch::{DriverMotion, DriverWatch};

/// A driver that is set by wire, and what it is set to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverSetup {
    /// Which chip.
    pub bus: DriverBus,
    /// Address of a TMC2209 by its pins MS1 and MS2, 0 to 3.
    pub address: u8,
    /// Current while the motor turns, mA (RMS).
    pub run_ma: u32,
    /// Current at rest, mA (RMS).
    pub hold_ma: u32,
    /// Microsteps of a full step: a power of two, 1 to 256.
    pub microsteps: u32,
    /// Sense resistors, mΩ.
    pub sense_mohm: u32,
}

/// Something to say to a driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Say {
    /// The value of a register.
    Read(u8),
    /// Put this into a register.
    Write(u8, u32),
}

/// An answer that is not one: wrong length, wrong sender, wrong checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Garbled;

impl DriverSetup {
    /// Bytes that say it, and how many come back.
    pub(crate) fn request(&self, say: Say) -> (DriverBytes, usize) {
        match (self.bus, say) {
            (DriverBus::OneWire, Say::Read(register)) => {
                (tmc2209::read(self.address, register), tmc2209::ANSWER_LEN)
            }
            (DriverBus::OneWire, Say::Write(register, value)) => {
                (tmc2209::write(self.address, register, value), 0)
            }
            // What a datagram brings back belongs to the one before it.
            (DriverBus::Spi, Say::Read(register)) => {
                (tmc5160::read_twice(register), 2 * tmc5160::DATAGRAM_LEN)
            }
            (DriverBus::Spi, Say::Write(register, value)) => {
                (tmc5160::write(register, value), tmc5160::DATAGRAM_LEN)
            }
        }
    }

    /// The value that an answer holds; 0 for one to a write.
    pub(crate) fn value(&self, say: Say, answer: &[u8]) -> Result<u32, Garbled> {
        match (self.bus, say) {
            (DriverBus::OneWire, Say::Read(register)) => tmc2209::value(register, answer),
            (DriverBus::Spi, Say::Read(_)) => tmc5160::value(answer),
            (_, Say::Write(..)) => Ok(0),
        }
    }
}
