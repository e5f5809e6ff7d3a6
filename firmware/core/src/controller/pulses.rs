//! TriggerRole pulses: given or followed, each with the encoders latched at its rising edge.

use gonia_protocol::message::{ControllerState, Latch, Message, RequestOutcome, TriggerRole};
use gonia_protocol::settings::{Axis, Key};

use super::ArmController;
use crate::axis::EncoderReading;
use crate::hardware::Hardware;
use crate::train::TrainAction;

impl ArmController {
    /// The other controller raised the trigger wire at `edge_us`.
    pub fn trigger_edge(&mut self, now_us: u64, edge_us: u64, hardware: &mut impl Hardware) {
        let follows = self
            .train
            .as_ref()
            .is_some_and(|train| train.trigger() == TriggerRole::Follower);
        if self.state != ControllerState::Armed || !follows {
            return;
        }
        let outside = self.axis_outside_window(now_us, hardware);
        self.latch(edge_us, outside.is_none());
        if let Some(train) = &self.train
            && train.is_over()
        {
            let request = train.request();
            self.job = Some(request);
            self.enter(ControllerState::Idle, now_us);
            self.complete(RequestOutcome::Done);
        }
    }

    pub(super) fn give_pulses(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        let Some(train) = &mut self.train else { return };
        match train.due(now_us) {
            TrainAction::None => {}
            TrainAction::Give(length_us) => match self.axis_outside_window(now_us, hardware) {
                Some((axis, _)) => {
                    self.train = None;
                    self.enter(ControllerState::Idle, now_us);
                    self.complete(RequestOutcome::LeftWindow(axis));
                }
                None => {
                    let begins_us = hardware.begin_pulse(now_us, length_us);
                    self.latch(begins_us, true);
                }
            },
            TrainAction::Over => {
                hardware.end_pulse();
                if train.is_over() {
                    self.enter(ControllerState::Idle, now_us);
                    self.complete(RequestOutcome::Done);
                }
            }
        }
    }

    /// Keeps the encoders that were read just now.
    fn latch(&mut self, time_us: u64, within: bool) {
        let seq = self.next_seq();
        let encoder_udeg = [self.drives[0].encoder_udeg(), self.drives[1].encoder_udeg()];
        let Some(train) = &mut self.train else { return };
        let latch = Latch {
            seq,
            request: train.request(),
            pulse: train.latches().len() as u8,
            time_us,
            encoder_udeg,
            within,
        };
        train.latch(latch.clone());
        self.push_event(Message::Pulse(latch));
    }

    /// Reads both encoders now; the first axis outside the trigger window, or whose reading is bad.
    pub(super) fn axis_outside_window(
        &mut self,
        now_us: u64,
        hardware: &mut impl Hardware,
    ) -> Option<(Axis, i32)> {
        let mut outside = None;
        for axis in Axis::BOTH {
            let drive = &mut self.drives[axis.index()];
            let fresh = drive.read(now_us, &self.settings, hardware) == Ok(EncoderReading::Fresh);
            let error = drive.encoder_udeg() - self.target_udeg[axis.index()];
            let window = self.settings.get(axis, Key::TriggerWindow);
            if outside.is_none() && (!fresh || error.saturating_abs() > window) {
                outside = Some((axis, error));
            }
        }
        outside
    }
}
