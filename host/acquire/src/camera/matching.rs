//! Whether frames are those of the trigger pulses, by the numbers and times that a camera gives them.
//!
//! Camera and controller have clocks of their own: what is compared is how much time lies between two
//! frames and between their two pulses. A camera may tell the beginning or the end of an exposure.

use crate::camera::source::{CameraError, Pulse};

/// The two clocks may differ by this, seconds: what a camera takes to begin, and its clock's ticks.
const TOLERANCE_S: f64 = 0.002;
/// And by this share of the time between two pulses: crystals are good to 1e-4 each.
const DRIFT: f64 = 3e-4;
/// The last of the numbers of 16 bits that GigE Vision begins with; 1 comes after it.
const LAST_SHORT_ID: u64 = 0xFFFF;

/// What a camera says of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamp {
    /// Its number; it grows by one a frame.
    pub id: u64,
    /// When, by the camera's clock, ns; 0 of a camera without one.
    pub time_ns: u64,
}

/// Matches the frames of one shot after the other.
#[derive(Debug, Default)]
pub struct Matching {
    last_id: Option<u64>,
    last: Option<(Stamp, Pulse)>,
}

impl Matching {
    /// A frame that is of no interest, but was numbered.
    pub fn pass(&mut self, stamp: Stamp) {
        self.last_id = Some(stamp.id);
    }

    /// The camera begins to count anew. Its clock may go on; if not, the next shot does not match, and
    /// is taken again.
    pub fn count_anew(&mut self) {
        self.last_id = None;
    }

    /// Checks a shot's frames, which must be as many as its pulses.
    ///
    /// # Errors
    /// A number is missing before or among them, or a frame is not of the time of its pulse. All that
    /// was known of the camera's clock is forgotten then.
    pub fn check(&mut self, stamps: &[Stamp], pulses: &[Pulse]) -> Result<(), CameraError> {
        let checked = self.check_ids(stamps).and_then(|()| {
            let mut last = self.last;
            for pair in stamps.iter().copied().zip(pulses.iter().copied()) {
                check_times(last, pair)?;
                last = Some(pair);
            }
            Ok(last)
        });
        match checked {
            Ok(last) => {
                self.last_id = stamps.last().map(|stamp| stamp.id);
                self.last = last;
                Ok(())
            }
            Err(why) => {
                *self = Self::default();
                Err(CameraError::OtherPulse(why))
            }
        }
    }

    fn check_ids(&self, stamps: &[Stamp]) -> Result<(), String> {
        let mut last = self.last_id;
        for stamp in stamps {
            if let Some(last) = last
                && !follows(stamp.id, last)
            {
                return Err(format!("frame {} came after frame {last}", stamp.id));
            }
            last = Some(stamp.id);
        }
        Ok(())
    }
}

fn follows(id: u64, last: u64) -> bool {
    id == last.wrapping_add(1) || (last == LAST_SHORT_ID && id == 1)
}

fn check_times(last: Option<(Stamp, Pulse)>, (stamp, pulse): (Stamp, Pulse)) -> Result<(), String> {
    let Some((last_stamp, last_pulse)) = last else {
        return Ok(());
    };
    if stamp.time_ns == 0 || last_stamp.time_ns == 0 {
        return Ok(());
    }
    let between_frames_s =
        (i128::from(stamp.time_ns) - i128::from(last_stamp.time_ns)) as f64 * 1e-9;
    let between_pulses_s =
        (i128::from(pulse.time_us) - i128::from(last_pulse.time_us)) as f64 * 1e-6;
    let longer_s = pulse.exposure_s - last_pulse.exposure_s;
    let off_s = between_frames_s - between_pulses_s;
    if off_s.abs().min((off_s - longer_s).abs()) <= TOLERANCE_S + DRIFT * between_pulses_s.abs() {
        return Ok(());
    }
    Err(format!(
        "{between_frames_s:.4} s lie between two frames, and {between_pulses_s:.4} s between their pulses"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of a pulse at so many seconds, by clocks that are apart.
    fn frame(id: u64, at_s: f64, exposure_s: f64) -> (Stamp, Pulse) {
        let time_ns = (7e9 + at_s * 1e9 * (1.0 + 1e-4)) as u64;
        let time_us = (3e6 + at_s * 1e6) as u64;
        (Stamp { id, time_ns }, Pulse::new(exposure_s, time_us))
    }

    fn check(matching: &mut Matching, frames: &[(Stamp, Pulse)]) -> Result<(), CameraError> {
        let (stamps, pulses): (Vec<_>, Vec<_>) = frames.iter().copied().unzip();
        matching.check(&stamps, &pulses)
    }

    #[test]
    fn frames_match_whether_the_camera_tells_the_beginning_or_the_end_of_an_exposure() {
        for end in [0.0, 1.0] {
            let mut matching = Matching::default();
            for shot in 0..5u64 {
                let at_s = 8.0 * shot as f64;
                let frames: Vec<_> = [(0.0, 0.01), (0.02, 0.1), (0.13, 1.0)]
                    .into_iter()
                    .zip(65_530 + 3 * shot..)
                    .map(|((s, exposure_s), id)| {
                        // Numbers of 16 bits begin again at 1.
                        let id = if id > 65_535 { id - 65_535 } else { id };
                        let (mut stamp, pulse) = frame(id, at_s + s, exposure_s);
                        stamp.time_ns += (end * exposure_s * 1e9) as u64;
                        (stamp, pulse)
                    })
                    .collect();
                check(&mut matching, &frames).unwrap();
            }
        }
    }

    #[test]
    fn a_missing_number_and_a_frame_of_another_time_are_found_out() {
        let first = frame(1, 0.0, 0.01);
        let begin = || {
            let mut matching = Matching::default();
            check(&mut matching, &[first]).unwrap();
            matching
        };
        let skipped = check(&mut begin(), &[frame(3, 8.0, 0.01)]).unwrap_err();
        assert!(
            skipped.to_string().contains("frame 3 came after frame 1"),
            "{skipped}"
        );
        // The frame of an earlier moment, for the pulse that came after it.
        let mut early = frame(2, 8.0, 0.01);
        early.0.time_ns -= 15_000_000;
        let mut matching = begin();
        let refused = check(&mut matching, &[early]).unwrap_err();
        assert!(matches!(&refused, CameraError::OtherPulse(_)), "{refused}");
        // Nothing is known any more: the next one counts.
        check(&mut matching, &[frame(9, 16.0, 0.01)]).unwrap();
        // A camera that was opened anew counts anew, and its clock went on.
        let mut matching = begin();
        matching.count_anew();
        assert!(check(&mut matching, &[early]).is_err());
        let mut matching = begin();
        matching.pass(Stamp { id: 2, time_ns: 0 });
        check(&mut matching, &[frame(3, 8.0, 0.01)]).unwrap();
        // Without a clock there is nothing to compare.
        let mut timeless = early;
        timeless.0.time_ns = 0;
        check(&mut begin(), &[timeless]).unwrap();
    }
}
