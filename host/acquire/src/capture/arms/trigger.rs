//! One shot's trigger pulses: the camera arm gives them, the light arm follows, and both capture their
//! encoders with each.

use crate::capture::arms::{Arms, Latched, TryError};
use crate::link::LinkError;
use gonia_protocol::message::{MAX_PULSES, RequestOutcome, TriggerRequest, TriggerRole};

/// A follower captures with the pulse; its event is here soon after, µs.
const FOLLOWER_LIMIT_US: u64 = 300_000;

impl Arms {
    /// Triggers, and collects what both arms captured at each pulse.
    pub(in crate::capture) fn trigger(&mut self) -> Result<Vec<Latched>, TryError> {
        let exposures_us: heapless::Vec<u32, MAX_PULSES> =
            self.options.exposures_us.iter().copied().collect();
        let pulses = exposures_us.len() as u8;
        let request = |trigger| TriggerRequest {
            trigger,
            exposures_us: exposures_us.clone(),
            gap_us: self.options.gap_us,
        };
        let (follower, source) = (request(TriggerRole::Follower), request(TriggerRole::Source));
        let following = self.light.request_trigger(follower)?;
        let length_us: u64 = self
            .options
            .exposures_us
            .iter()
            .map(|&us| u64::from(us))
            .sum();
        let limit_us = length_us + 8 * u64::from(self.options.gap_us) + 1_000_000;
        let fired = self
            .camera
            .request_trigger(source)
            .and_then(|_| self.camera.fire());
        let given = fired.and_then(|ticket| self.wait_for([None, Some(ticket)], limit_us));
        match given {
            Ok([_, Some(RequestOutcome::Done)]) => {}
            Ok([_, outcome]) => {
                self.disarm()?;
                return Err(
                    outcome.map_or(TryError::Repeat("no trigger".into()), |outcome| {
                        TryError::of_outcome("the trigger", outcome)
                    }),
                );
            }
            Err(error) => {
                self.disarm()?;
                return Err(error.into());
            }
        }
        match self.light.wait(following, FOLLOWER_LIMIT_US) {
            Ok(completed) if completed.outcome == RequestOutcome::Done => {}
            Ok(completed) => {
                return Err(TryError::of_outcome("the trigger", completed.outcome));
            }
            Err(LinkError::Endless { .. }) => {
                self.disarm()?;
                let why = "the light arm did not see the trigger".into();
                return Err(TryError::Repeat(why));
            }
            Err(error) => return Err(error.into()),
        }
        let mut captured = Vec::new();
        for pulse in 0..pulses {
            let pair = [self.light.latch(pulse)?, self.camera.latch(pulse)?];
            if !pair.iter().all(|latch| latch.within) {
                let why = "an arm was outside its window at the trigger".into();
                return Err(TryError::Repeat(why));
            }
            let time_us = pair[1].time_us;
            captured.push(Latched {
                encoder_udeg: pair.map(|latch| latch.encoder_udeg),
                time_us,
            });
        }
        Ok(captured)
    }

    fn disarm(&mut self) -> Result<(), LinkError> {
        self.light.disarm()?;
        self.camera.disarm()
    }
}
