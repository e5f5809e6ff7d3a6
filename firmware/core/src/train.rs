//! A train of trigger pulses.

use gonia_protocol::message::{Latch, MAX_PULSES, TriggerRequest, TriggerRole};

/// The train that was requested, and the latches of its pulses.
#[derive(Debug)]
pub struct TriggerTrain {
    wanted: TriggerRequest,
    request: u16,
    latches: heapless::Vec<Latch, MAX_PULSES>,
    phase: TrainPhase,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TrainPhase {
    Waiting,
    High { until_us: u64 },
    Low { until_us: u64 },
}

/// What is to be done for a train now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrainAction {
    /// Nothing before its next due time.
    None,
    /// Latch, and give a pulse of so many µs.
    Give(u32),
    /// The pulse is over.
    Over,
}

impl TriggerTrain {
    /// An armed train; `None` if it has no pulse or one of no length.
    pub fn new(wanted: TriggerRequest, request: u16) -> Option<Self> {
        let valid = !wanted.exposures_us.is_empty() && wanted.exposures_us.iter().all(|&us| us > 0);
        valid.then_some(Self {
            wanted,
            request,
            latches: heapless::Vec::new(),
            phase: TrainPhase::Waiting,
        })
    }

    /// Which end of the trigger wire this is.
    pub fn trigger(&self) -> TriggerRole {
        self.wanted.trigger
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
        let high = matches!(self.phase, TrainPhase::High { .. });
        self.latches.len() == self.wanted.exposures_us.len() && !high
    }

    /// Whether it waits for its first pulse.
    pub fn is_waiting(&self) -> bool {
        self.phase == TrainPhase::Waiting && self.latches.is_empty()
    }

    /// Begins to give pulses.
    pub fn fire(&mut self, now_us: u64) {
        self.phase = TrainPhase::Low { until_us: now_us };
    }

    /// Keeps a latch; the exposure of its pulse has begun.
    pub fn latch(&mut self, latch: Latch) {
        let exposure = self.wanted.exposures_us.get(self.latches.len());
        if let (TriggerRole::Source, Some(&us)) = (self.wanted.trigger, exposure) {
            self.phase = TrainPhase::High {
                until_us: latch.time_us + u64::from(us),
            };
        }
        // More pulses than armed for are not latched.
        let _ = self.latches.push(latch);
    }

    /// When [`Self::due`] has something to say, µs.
    pub fn wake_us(&self) -> u64 {
        match self.phase {
            TrainPhase::Waiting => u64::MAX,
            TrainPhase::High { until_us } | TrainPhase::Low { until_us } => until_us,
        }
    }

    /// What is to be done at this time.
    pub fn due(&mut self, now_us: u64) -> TrainAction {
        match self.phase {
            TrainPhase::High { until_us } if now_us >= until_us => {
                self.phase = if self.latches.len() == self.wanted.exposures_us.len() {
                    TrainPhase::Waiting
                } else {
                    TrainPhase::Low {
                        until_us: now_us + u64::from(self.wanted.gap_us),
                    }
                };
                TrainAction::Over
            }
            TrainPhase::Low { until_us } if now_us >= until_us => {
                let exposure = self.wanted.exposures_us.get(self.latches.len());
                exposure.map_or(TrainAction::None, |&us| TrainAction::Give(us))
            }
            _ => TrainAction::None,
        }
    }
}
