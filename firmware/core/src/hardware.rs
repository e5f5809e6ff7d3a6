//! What a board must offer.

use gonia_protocol::settings::Axis;

use crate::steps::{Period, StepProgress};

/// The encoder did not answer, or its answer failed its own check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderLost;

/// What an encoder speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderKind {
    /// SSI: see [`crate::ssi`].
    Ssi,
    /// BiSS-C with its CRC: see [`crate::biss`].
    BissC,
}

/// How an encoder is to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderSetup {
    /// What it speaks.
    pub kind: EncoderKind,
    /// Counts of one turn: a power of two.
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

    /// The absolute encoder of the shaft, in counts of one turn.
    fn encoder_counts(&mut self, axis: Axis, setup: EncoderSetup) -> Result<u32, EncoderLost>;

    /// Whether the contact of the home switch is closed: above home, where it is normally closed.
    fn home_switch_closed(&mut self, axis: Axis) -> bool;

    /// Whether the contact of the alarm output of an axis's driver is closed.
    fn alarm_closed(&mut self, axis: Axis) -> bool;

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
