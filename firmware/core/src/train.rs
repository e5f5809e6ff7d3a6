//! A train of trigger pulses.

use gonia_protocol::message::{Arm, Latch, MAX_PULSES, Trigger};

/// The train that is armed, and what its pulses have latched.
#[derive(Debug)]
pub struct Train {
    arm: Arm,
    request: u16,
    latches: heapless::Vec<Latch, MAX_PULSES>,
    phase: Phase,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Waiting,
    High { until_us: u64 },
    Low { until_us: u64 },
}

/// What a train wants done now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deed {
    /// Nothing before its next due time.
    None,
    /// Latch, and raise the output.
    Raise,
    /// Lower the output.
    Lower,
}

impl Train {
    /// An armed train; `None` if it has no pulse or one of no length.
    pub fn new(arm: Arm, request: u16) -> Option<Self> {
        let valid = !arm.exposures_us.is_empty() && arm.exposures_us.iter().all(|&us| us > 0);
        valid.then_some(Self {
            arm,
            request,
            latches: heapless::Vec::new(),
            phase: Phase::Waiting,
        })
    }

    /// Which end of the trigger wire this is.
    pub fn trigger(&self) -> Trigger {
        self.arm.trigger
    }

    /// The request that armed it.
    pub fn request(&self) -> u16 {
        self.request
    }

    /// What was latched so far.
    pub fn latches(&self) -> &[Latch] {
        &self.latches
    }

    /// Whether every pulse is latched and the output is low.
    pub fn is_over(&self) -> bool {
        let high = matches!(self.phase, Phase::High { .. });
        self.latches.len() == self.arm.exposures_us.len() && !high
    }

    /// Whether it waits for its first pulse.
    pub fn is_waiting(&self) -> bool {
        self.phase == Phase::Waiting && self.latches.is_empty()
    }

    /// Begins to give pulses.
    pub fn fire(&mut self, now_us: u64) {
        self.phase = Phase::Low { until_us: now_us };
    }

    /// Keeps a latch; the exposure of its pulse begins.
    pub fn latch(&mut self, latch: Latch) {
        let exposure = self.arm.exposures_us.get(self.latches.len());
        if let (Trigger::Source, Some(&us)) = (self.arm.trigger, exposure) {
            self.phase = Phase::High {
                until_us: latch.time_us + u64::from(us),
            };
        }
        // More pulses than armed for are not latched.
        let _ = self.latches.push(latch);
    }

    /// When [`Self::due`] has something to say, µs.
    pub fn wake_us(&self) -> u64 {
        match self.phase {
            Phase::Waiting => u64::MAX,
            Phase::High { until_us } | Phase::Low { until_us } => until_us,
        }
    }

    /// What is to be done at this time.
    pub fn due(&mut self, now_us: u64) -> Deed {
        match self.phase {
            Phase::High { until_us } if now_us >= until_us => {
                self.phase = if self.latches.len() == self.arm.exposures_us.len() {
                    Phase::Waiting
                } else {
                    Phase::Low {
                        until_us: now_us + u64::from(self.arm.gap_us),
                    }
                };
                Deed::Lower
            }
            Phase::Low { until_us } if now_us >= until_us => Deed::Raise,
            _ => Deed::None,
        }
    }
}
