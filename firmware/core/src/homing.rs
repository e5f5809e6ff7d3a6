//! How one axis finds home: fast seek, back off, slow approach, zero.
//!
//! The switch shows only *which turn* the shaft is in; the angle within the turn is the absolute
//! encoder's, so the switch's own repeatability (some 0.01°) does not enter the zero.
//!
//! A switch that says "home" at and below the home angle shows the turn wherever the axis stands. One with a cam
//! on the shaft says so once a turn, and shows it only to an axis that cannot travel a turn. The two differ
//! below home: the cam lets its switch go again. So an axis that can travel a turn drives on below home by
//! `home_probe`, which is wider than the cam, and is home only where the switch still says so. Up would not do:
//! the next cam may lie beyond the stop. Nor is it enough to search for a lower cam: the lowest one is known
//! only by the stop below it.
//!
//! A quadrature ring has no angle until its index has come, so where the switch was met is kept as a count, and the
//! axis drives up from there until the index comes. That it did so before, on the way down, is as good.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::settings::Key;

use crate::axis::{AxisDrive, Contact};
use crate::hardware::Hardware;
use crate::settings::ControllerSettings;

/// Equal readings that end a bounce of the switch (at one reading every 2 ms).
const DEBOUNCE: u8 = 3;
/// Equal readings that no chatter of a worn switch gives (40 ms): 0.1 s.
const CERTAIN: u8 = 50;
/// The slow way off the switch is this part of the fast search's speed.
const CLEARING_SLOWDOWN: u64 = 4;
/// Settling timeouts until an arm has swung out.
const SWING_OUT: u64 = 2;
/// A turn, and what the search needs to come to rest.
const INDEX_REACH_UDEG: i64 = 365_000_000;
/// How many back-offs below the switch an axis may stand at the start.
const MAX_BELOW: i64 = 10;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HomingPhase {
    /// At rest, until the switch's reading is steady.
    Look,
    /// Fast, down, until the switch says home.
    Seek,
    /// Slowing down below the switch.
    Stop,
    /// Up, onto a cam that the fast search ran across.
    Return,
    /// Up, until the switch lets go.
    Clear,
    /// Slowing down above it.
    StopAbove,
    /// A little further up.
    BackOff,
    /// Slowly down, until it says so again.
    Approach,
    /// Down, to see whether the switch still says home there.
    Probe,
    /// Up, until the index of a quadrature ring has come.
    FindIndex,
    /// Slowing down above it.
    StopAtIndex,
    /// Home is known; on to the lowest admissible angle.
    Park,
    /// Until the arm has swung out.
    Rest {
        until_us: u64,
    },
    /// For another settling timeout the encoder is read: steps and encoder are compared from here on.
    Read {
        until_us: u64,
    },
    Done,
}

/// The search of one axis.
#[derive(Clone, Copy, Debug)]
pub struct Homing {
    phase: HomingPhase,
    same_readings: u8,
    last_reading: bool,
    /// Where the slow approach met the switch.
    contact: Option<Contact>,
    /// Of the encoder at rest.
    rest_sum: i64,
    rest_count: i64,
}

impl Homing {
    /// Begins, with the axis at rest.
    pub fn begin(at_home: bool) -> Self {
        Self {
            phase: HomingPhase::Look,
            same_readings: 1,
            last_reading: at_home,
            contact: None,
            rest_sum: 0,
            rest_count: 0,
        }
    }

    /// Where the axis rests, by the mean of its encoder, µdeg.
    pub fn rest_udeg(&self) -> i64 {
        self.rest_sum / self.rest_count.max(1)
    }

    /// Whether this axis is home and at rest.
    pub fn is_done(&self) -> bool {
        self.phase == HomingPhase::Done
    }

    /// Looks at switch and motion, every control tick.
    pub fn tick(
        &mut self,
        now_us: u64,
        at_home: bool,
        drive: &mut AxisDrive,
        settings: &ControllerSettings,
        hardware: &mut impl Hardware,
    ) -> Result<(), FaultCode> {
        self.note(at_home);
        match self.phase {
            HomingPhase::Probe => self.probe(at_home, drive, settings),
            HomingPhase::FindIndex | HomingPhase::StopAtIndex => self.find_index(drive, settings),
            HomingPhase::Park | HomingPhase::Rest { .. } | HomingPhase::Read { .. } => {
                self.park(now_us, drive, settings);
                Ok(())
            }
            HomingPhase::Done => Ok(()),
            _ => self.search(at_home, drive, settings, hardware),
        }
    }

    /// Until the slow approach has found where the switch changes.
    fn search(
        &mut self,
        at_home: bool,
        drive: &mut AxisDrive,
        settings: &ControllerSettings,
        hardware: &mut impl Hardware,
    ) -> Result<(), FaultCode> {
        let steady = self.same_readings >= DEBOUNCE;
        let backoff = i64::from(settings.get(drive.axis(), Key::HomeBackoff));
        match self.phase {
            HomingPhase::Look if steady && at_home => self.clear(drive, settings),
            HomingPhase::Look if steady => {
                // The whole travel, and a tenth more.
                let axis = drive.axis();
                let travel = i64::from(settings.get(axis, Key::SoftMax))
                    - i64::from(settings.get(axis, Key::HomeAngle));
                let ramp = drive.ramp(settings, Key::HomeFastSpeed);
                drive.run(-drive.steps_of(travel * 11 / 10), ramp);
                self.phase = HomingPhase::Seek;
            }
            HomingPhase::Seek if at_home && steady => {
                drive.decelerate();
                self.phase = HomingPhase::Stop;
            }
            HomingPhase::Seek if !drive.is_moving() => return Err(FaultCode::HOME_NOT_FOUND),
            HomingPhase::Stop if !drive.is_moving() && at_home && steady => {
                self.clear(drive, settings);
            }
            HomingPhase::Stop if !drive.is_moving() && self.is_off_for_certain() => {
                if drive.travels_a_turn(settings) {
                    return Err(FaultCode::HOME_AMBIGUOUS);
                }
                self.clear(drive, settings);
                self.phase = HomingPhase::Return;
            }
            HomingPhase::Return if at_home && steady => self.phase = HomingPhase::Clear,
            HomingPhase::Return if !drive.is_moving() => return Err(FaultCode::HOME_NOT_FOUND),
            HomingPhase::Clear if !at_home && steady => {
                drive.decelerate();
                self.phase = HomingPhase::StopAbove;
            }
            HomingPhase::Clear if !drive.is_moving() => return Err(FaultCode::HOME_SWITCH_STUCK),
            HomingPhase::StopAbove if !drive.is_moving() => {
                drive.run(drive.steps_of(backoff), clearing_ramp(drive, settings));
                self.phase = HomingPhase::BackOff;
            }
            HomingPhase::BackOff if !drive.is_moving() => {
                if at_home {
                    return Err(FaultCode::HOME_SWITCH_STUCK);
                }
                let ramp = drive.ramp(settings, Key::HomeSlowSpeed);
                drive.run(-drive.steps_of(backoff * 3), ramp);
                self.phase = HomingPhase::Approach;
            }
            // The first contact counts, bounce or not: the encoder has the angle.
            HomingPhase::Approach if at_home => {
                drive.halt(hardware);
                let contact = drive.contact();
                self.contact = Some(contact);
                if !drive.lacks_index(settings) {
                    drive.set_turn(contact, settings)?;
                }
                if drive.travels_a_turn(settings) {
                    let way = i64::from(settings.get(drive.axis(), Key::HomeProbe));
                    let ramp = drive.ramp(settings, Key::HomeFastSpeed);
                    drive.run(-drive.steps_of(way), ramp);
                    self.same_readings = 0;
                    self.phase = HomingPhase::Probe;
                } else {
                    self.go_to_index(drive, settings)?;
                }
            }
            HomingPhase::Approach if !drive.is_moving() => return Err(FaultCode::HOME_NOT_FOUND),
            _ => {}
        }
        Ok(())
    }

    /// Below home: whether the switch still says so.
    fn probe(
        &mut self,
        at_home: bool,
        drive: &mut AxisDrive,
        settings: &ControllerSettings,
    ) -> Result<(), FaultCode> {
        if self.is_off_for_certain() {
            return Err(FaultCode::HOME_AMBIGUOUS);
        }
        if !drive.is_moving() && at_home && self.same_readings >= CERTAIN {
            return self.go_to_index(drive, settings);
        }
        Ok(())
    }

    /// The turn is known. An encoder that knows its angle goes on to park; one that lacks its index goes up for it, a
    /// turn and a little more at most, and no further than the highest admissible angle.
    fn go_to_index(
        &mut self,
        drive: &mut AxisDrive,
        settings: &ControllerSettings,
    ) -> Result<(), FaultCode> {
        if !drive.lacks_index(settings) {
            return self.count_from_index(drive, settings);
        }
        let get = |key| i64::from(settings.get(drive.axis(), key));
        let reach = (get(Key::SoftMax) - get(Key::HomeAngle)).min(INDEX_REACH_UDEG);
        let contact = self.contact.map_or(0, |contact| i64::from(contact.udeg));
        let way = contact + reach - i64::from(drive.encoder_udeg());
        drive.run(
            drive.steps_of(way),
            drive.ramp(settings, Key::HomeFastSpeed),
        );
        self.phase = HomingPhase::FindIndex;
        Ok(())
    }

    fn find_index(
        &mut self,
        drive: &mut AxisDrive,
        settings: &ControllerSettings,
    ) -> Result<(), FaultCode> {
        match self.phase {
            HomingPhase::FindIndex if !drive.lacks_index(settings) => {
                drive.decelerate();
                self.phase = HomingPhase::StopAtIndex;
            }
            HomingPhase::FindIndex if !drive.is_moving() => return Err(FaultCode::INDEX_NOT_FOUND),
            HomingPhase::StopAtIndex if !drive.is_moving() => {
                return self.count_from_index(drive, settings);
            }
            _ => {}
        }
        Ok(())
    }

    /// At rest, with the index known: where the switch was met is an angle now.
    fn count_from_index(
        &mut self,
        drive: &mut AxisDrive,
        settings: &ControllerSettings,
    ) -> Result<(), FaultCode> {
        if let (Some(contact), true) = (self.contact, drive.has_new_index()) {
            drive.set_turn(contact, settings)?;
        }
        self.go_to_park(drive, settings);
        Ok(())
    }

    fn go_to_park(&mut self, drive: &mut AxisDrive, settings: &ControllerSettings) {
        drive.go_to(settings.get(drive.axis(), Key::SoftMin), settings);
        self.phase = HomingPhase::Park;
    }

    /// To the lowest admissible angle, and the encoder's mean there.
    fn park(&mut self, now_us: u64, drive: &mut AxisDrive, settings: &ControllerSettings) {
        match self.phase {
            HomingPhase::Park if !drive.is_moving() => {
                let timeout_us = settings.get_u64(drive.axis(), Key::SettlingTimeout);
                let until_us = now_us + SWING_OUT * timeout_us;
                self.phase = HomingPhase::Rest { until_us };
            }
            HomingPhase::Rest { until_us } if now_us >= until_us => {
                let timeout_us = settings.get_u64(drive.axis(), Key::SettlingTimeout);
                let until_us = now_us + timeout_us;
                self.phase = HomingPhase::Read { until_us };
            }
            HomingPhase::Read { until_us } => {
                self.rest_sum += i64::from(drive.encoder_udeg());
                self.rest_count += 1;
                if now_us >= until_us {
                    self.phase = HomingPhase::Done;
                }
            }
            _ => {}
        }
    }

    fn clear(&mut self, drive: &mut AxisDrive, settings: &ControllerSettings) {
        let get = |key| i64::from(settings.get(drive.axis(), key));
        // What the fast search ran past the switch: v²/2a, and half the rise at full speed.
        let speed = get(Key::HomeFastSpeed);
        let overrun = speed.pow(2) / (2 * get(Key::Acceleration)).max(1)
            + speed * get(Key::JerkTime) / 2_000_000;
        let way = overrun + MAX_BELOW * get(Key::HomeBackoff);
        drive.run(drive.steps_of(way), clearing_ramp(drive, settings));
        self.same_readings = 0;
        self.phase = HomingPhase::Clear;
    }

    fn note(&mut self, reading: bool) {
        if reading == self.last_reading {
            self.same_readings = self.same_readings.saturating_add(1);
        } else {
            self.last_reading = reading;
            self.same_readings = 1;
        }
    }

    /// The switch has let go, and not for a bounce.
    fn is_off_for_certain(&self) -> bool {
        !self.last_reading && self.same_readings >= CERTAIN
    }
}

fn clearing_ramp(drive: &AxisDrive, settings: &ControllerSettings) -> crate::profile::Ramp {
    crate::profile::Ramp::new(
        settings.get_u64(drive.axis(), Key::HomeFastSpeed) / CLEARING_SLOWDOWN,
        settings.get_u64(drive.axis(), Key::Acceleration),
        settings.get_u64(drive.axis(), Key::JerkTime),
        settings.get_u64(drive.axis(), Key::StepsPerTurn),
    )
}
