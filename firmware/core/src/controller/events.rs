//! Events for the host, numbered, and the log of faults.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{Completed, Faulted, LogEntry, Message, RequestOutcome, Telemetry};
use gonia_protocol::settings::{Axis, Key};

use super::ArmController;

impl ArmController {
    /// The oldest event that was not taken yet.
    pub fn take_event(&mut self) -> Option<Message> {
        self.events.pop_front()
    }

    pub(super) fn note_fault(&mut self, now_us: u64, code: FaultCode, axis: Option<Axis>) {
        if self.log.is_full() {
            self.log.pop_front();
        }
        // Never full here.
        let _ = self.log.push_back(LogEntry {
            time_us: now_us,
            fault: Some(code),
            axis,
        });
        let seq = self.next_seq();
        self.push_event(Message::Faulted(Faulted { seq, code, axis }));
    }

    /// Ends the request under way, if there is one.
    pub(super) fn complete(&mut self, outcome: RequestOutcome) {
        self.stopping = false;
        let Some(request) = self.job.take() else {
            return;
        };
        self.last = Some((request, outcome));
        let seq = self.next_seq();
        let completed = Completed {
            seq,
            request,
            outcome,
            encoder_udeg: [self.drives[0].encoder_udeg(), self.drives[1].encoder_udeg()],
            corrections: self.corrections,
        };
        self.push_event(Message::Completed(completed));
    }

    pub(super) fn send_telemetry(&mut self, now_us: u64) {
        if now_us < self.next_telemetry_us {
            return;
        }
        let period = self.settings.get_u64(Axis::Theta, Key::Telemetry);
        if period == 0 || !self.is_busy() {
            self.next_telemetry_us = u64::MAX;
            return;
        }
        self.next_telemetry_us = now_us + period;
        let telemetry = Telemetry {
            seq: self.next_seq(),
            time_us: now_us,
            state: self.state,
            commanded_udeg: [
                self.drives[0].commanded_udeg(),
                self.drives[1].commanded_udeg(),
            ],
            encoder_udeg: [self.drives[0].encoder_udeg(), self.drives[1].encoder_udeg()],
        };
        self.push_event(Message::Telemetry(telemetry));
    }

    pub(super) fn next_seq(&mut self) -> u32 {
        self.event_seq = self.event_seq.wrapping_add(1);
        self.event_seq
    }

    /// An event that finds no room is lost; the host sees the gap in the numbers and requests the status.
    pub(super) fn push_event(&mut self, event: Message) {
        let _ = self.events.push_back(event);
    }
}
