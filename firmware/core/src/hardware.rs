//! What a board must offer.

use gonia_protocol::settings::Axis;
use heapless::Vec;

use crate::steps::{Period, StepProgress};

/// Why there is no position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderLost {
    /// The encoder did not answer, or its answer failed its own check.
    Silent,
    /// It answered that its position is not valid: its error bit.
    Invalid,
    /// Quadrature: both waves changed between two samples.
    Edge,
    /// Quadrature: the index came at another count than before, or did not come.
    Index,
}

/// What an encoder says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderWord {
    /// Its position, counts of a turn.
    pub counts: u32,
    /// Its warning bit: it is near its limits (dirt, distance, temperature), and the position holds.
    pub warns: bool,
    /// Of a quadrature ring, which knows no angle before its index has come: the count at which it came. `None`
    /// before that, and for rings that are absolute.
    pub index: Option<u32>,
}

impl From<u32> for EncoderWord {
    /// A position without a warning.
    fn from(counts: u32) -> Self {
        Self {
            counts,
            warns: false,
            index: None,
        }
    }
}

/// Which wire leads to a motor's driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriverBus {
    /// A TMC2209's: one wire for both directions, open drain, 8N1 by [`crate::single_wire`].
    OneWire,
    /// A TMC5160's: SPI mode 3, a select line for each driver.
    Spi,
}

/// Bytes to or from a motor's driver: two datagrams of a TMC5160 at most.
pub type DriverBytes = Vec<u8, 10>;

/// What has come of an exchange with a motor's driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DriverAnswer {
    /// It is under way.
    Waiting,
    /// As many bytes as were awaited.
    Bytes(DriverBytes),
    /// Fewer, or none.
    Silent,
}

/// What an encoder speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderKind {
    /// SSI: see [`crate::ssi`].
    Ssi,
    /// BiSS-C with its CRC: see [`crate::biss`].
    BissC,
    /// Two square waves and an index: see [`crate::quadrature`].
    Quadrature,
}

/// How an encoder is to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderSetup {
    /// What it speaks.
    pub kind: EncoderKind,
    /// Counts of one turn: a power of two, or of a quadrature ring a whole number of periods.
    pub turn: u32,
}

/// The settings are not in the board's memory; what was there before still is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotSaved;

/// Pins, encoders and memory of one arm.
pub trait Hardware {
    /// Queues a period for the step timer of an axis. One that finds no room is lost: the caller has
    /// asked [`Self::progress`] before.
    fn queue_step(&mut self, axis: Axis, period: Period);

    /// How far the step timer of an axis is.
    fn progress(&mut self, axis: Axis) -> StepProgress;

    /// No step of this axis after this; whatever waits is dropped.
    fn halt(&mut self, axis: Axis);

    /// Whether the board has pins for an encoder of this kind.
    fn has_encoder(&self, axis: Axis, kind: EncoderKind) -> bool;

    /// The encoder of the shaft. A quadrature ring says once that its position was lost.
    fn encoder_word(&mut self, axis: Axis, setup: EncoderSetup)
    -> Result<EncoderWord, EncoderLost>;

    /// Whether the contact of the home switch is closed: above home, where it is normally closed.
    fn home_switch_closed(&mut self, axis: Axis) -> bool;

    /// Whether the contact of the alarm output of an axis's driver is closed.
    fn alarm_closed(&mut self, axis: Axis) -> bool;

    /// Whether a wire of this kind leads to the drivers of both axes.
    fn has_driver_bus(&self, bus: DriverBus) -> bool;

    /// Sends bytes to the driver of an axis, after which so many come back. `false` where the wire is in use for
    /// the other axis: nothing was sent.
    fn ask_driver(
        &mut self,
        axis: Axis,
        bus: DriverBus,
        request: DriverBytes,
        answer_len: usize,
    ) -> bool;

    /// What has come of it. An answer is returned once.
    fn driver_answer(&mut self, axis: Axis, bus: DriverBus) -> DriverAnswer;

    /// Gives the motors' drivers their current, or takes it away.
    fn switch_drivers(&mut self, on: bool);

    /// Lets the brakes go, or engages them. Without power they are engaged.
    fn release_brakes(&mut self, released: bool);

    /// Whether the interlock that both controllers share is closed, so that motion is allowed.
    fn interlock_closed(&mut self) -> bool;

    /// Holds the shared interlock open, which stops the other controller too, or lets go of it. Letting go
    /// takes as long as the relay: when this returns, [`Self::interlock_closed`] reads its contact.
    fn hold_interlock_open(&mut self, open: bool);

    /// Gives a trigger pulse of so many µs, which begins at once or as soon as a timer can and ends by itself.
    /// Returns when it begins, µs since the start.
    fn begin_pulse(&mut self, now_us: u64, length_us: u32) -> u64;

    /// The trigger output is low from here on; a pulse under way is cut short.
    fn end_pulse(&mut self);

    /// Writes settings to the board's memory: whole, or not at all.
    fn save_settings(&mut self, bytes: &[u8]) -> Result<(), NotSaved>;
}
