//! What a board must offer.

use gonia_protocol::settings::Axis;

use crate::steps::{Period, StepProgress};

/// The encoder did not answer, or its answer failed its own check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderLost;

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
    fn encoder_counts(&mut self, axis: Axis) -> Result<u32, EncoderLost>;

    /// Whether the home switch is closed: it is at and below the home angle.
    fn home_switch_closed(&mut self, axis: Axis) -> bool;

    /// Whether the interlock that both controllers share is closed, so that motion is allowed.
    fn interlock_closed(&mut self) -> bool;

    /// Holds the shared interlock open, which stops the other controller too, or lets go of it.
    fn hold_interlock_open(&mut self, open: bool);

    /// Sets the trigger output.
    fn set_trigger(&mut self, on: bool);

    /// Writes settings to the board's memory: whole, or not at all.
    fn save_settings(&mut self, bytes: &[u8]) -> Result<(), NotSaved>;
}
