//! One axis: steps queued for its timer, encoder followed, segments of a move.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::AxisStatus;
use gonia_protocol::settings::{Axis, Key};

use crate::error_map::{ErrorMap, GearMap};
use crate::hardware::{EncoderKind, EncoderLost, Hardware};
use crate::profile::{Profile, Ramp, TICKS_PER_US};
use crate::settings::ControllerSettings;
use crate::steps::{DEPTH, End, Period};

const TURN_UDEG: i64 = 360_000_000;
/// The timer has steps for so long: four control ticks, 1/256 µs. A stop begins so much later.
const AHEAD_TICKS: u32 = 8_000 * TICKS_PER_US as u32;
/// Periods that wait at least, however long they are.
const AHEAD_MIN: usize = 2;
/// Bad readings in a row that make a fault; fewer are left out.
const MAX_BAD_READINGS: u8 = 3;
/// Movement between two readings that is always plausible: noise, a knock, ringing.
const ALWAYS_PLAUSIBLE_UDEG: i64 = 200_000;

/// Readings in a row with the encoder's warning bit that make a warning; fewer may be interference.
const WARNING_READINGS: u8 = 3;
/// A warning is not given again before the encoder has said nothing of it for so long, µs.
const WARNING_GAP_US: u64 = 10_000_000;

/// Steps and encoder of one axis.
#[derive(Debug)]
pub struct AxisDrive {
    axis: Axis,
    /// Steps that are still to be queued.
    profile: Option<Profile>,
    forward: bool,
    /// The direction that was queued last.
    queued_forward: Option<bool>,
    /// The way from below, after a segment that went down.
    take_up: Option<(u32, Ramp)>,
    /// The timer has something to do.
    is_playing: bool,
    /// The timer's count of steps, when it was last looked at.
    given: i32,
    /// Steps given.
    steps: i64,
    base_steps: i64,
    base_udeg: i64,
    /// Steps and encoder at home.
    home: Option<(i64, i64)>,
    gear: GearMap,
    /// The direction output is low for up.
    is_reversed: bool,
    steps_per_turn: i64,
    encoder: Encoder,
    following_udeg: i32,
    corrections: u32,
    missed_steps: u32,
}

/// The unwrapped encoder.
#[derive(Debug, Default)]
struct Encoder {
    map: ErrorMap,
    /// It counts up when the axis turns down.
    is_reversed: bool,
    /// The count at 0°; of a quadrature ring, counted from its index.
    zero: i64,
    /// The count at the index, where angles are counted from it.
    index: Option<u32>,
    /// The count at which the index has come so far, if it has.
    seen_index: Option<u32>,
    raw: Option<u32>,
    counts: i64,
    udeg: i32,
    read_us: u64,
    bad_readings: u8,
    /// Readings in a row with its warning bit.
    warnings: u8,
    /// A warning was given, and stands until then, µs.
    warned_until_us: u64,
    /// A warning is to be given.
    has_warning: bool,
}

/// Where an axis met its home switch.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// The encoder's count, over turns.
    count: i64,
    /// And its angle, µdeg, as it was counted then.
    pub udeg: i32,
}

/// A reading of the encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncoderReading {
    /// Good.
    Fresh,
    /// Bad; the last good position still stands.
    Stale,
}

impl AxisDrive {
    /// An axis at rest that has not been read yet.
    pub fn new(axis: Axis, settings: &ControllerSettings) -> Self {
        Self {
            axis,
            profile: None,
            forward: true,
            queued_forward: None,
            take_up: None,
            is_playing: false,
            given: 0,
            steps: 0,
            base_steps: 0,
            base_udeg: 0,
            home: None,
            gear: GearMap::new(axis, settings),
            is_reversed: settings.get(axis, Key::MotorReversed) != 0,
            steps_per_turn: i64::from(settings.get(axis, Key::StepsPerTurn)),
            encoder: Encoder {
                map: ErrorMap::new(axis, settings),
                is_reversed: settings.get(axis, Key::EncoderReversed) != 0,
                zero: i64::from(settings.get(axis, Key::EncoderZero)),
                ..Encoder::default()
            },
            following_udeg: 0,
            corrections: 0,
            missed_steps: 0,
        }
    }

    /// Which axis this is.
    pub fn axis(&self) -> Axis {
        self.axis
    }

    /// Whether steps are being given.
    pub fn is_moving(&self) -> bool {
        self.profile.is_some() || self.is_playing
    }

    /// The encoder's reading, µdeg.
    pub fn encoder_udeg(&self) -> i32 {
        self.encoder.udeg
    }

    /// Where the steps say it is, µdeg: counted from home, or, where that is not known, from where the
    /// encoder was when the run began.
    pub fn commanded_udeg(&self) -> i32 {
        let (steps, udeg) = self.home.unwrap_or((self.base_steps, self.base_udeg));
        (udeg + self.turned_udeg(steps)) as i32
    }

    /// How far the steps have turned the axis since there were so many, µdeg.
    fn turned_udeg(&self, since_steps: i64) -> i64 {
        (self.steps - since_steps) * TURN_UDEG / self.steps_per_turn
    }

    /// What the status of the controller says of this axis.
    pub fn status(&self) -> AxisStatus {
        AxisStatus {
            commanded_udeg: self.commanded_udeg(),
            encoder_udeg: self.encoder_udeg(),
            following_udeg: self.following_udeg,
            corrections: self.corrections,
            missed_steps: self.missed_steps,
        }
    }

    /// Takes note of the steps that the timer has given since the last time.
    pub fn take_progress(&mut self, hardware: &mut impl Hardware) {
        let progress = hardware.progress(self.axis);
        let given = i64::from(progress.given.wrapping_sub(self.given));
        self.steps += if self.is_reversed { -given } else { given };
        self.given = progress.given;
        self.is_playing = progress.is_playing;
    }

    /// Queues steps until the timer has enough for a while.
    pub fn feed(&mut self, hardware: &mut impl Hardware) {
        let mut waiting = hardware.progress(self.axis).waiting;
        while let Some(profile) = &mut self.profile {
            let interval = profile.interval();
            let enough = (AHEAD_TICKS / interval.max(1)) as usize;
            if waiting >= enough.clamp(AHEAD_MIN, DEPTH - 1) {
                return;
            }
            let mut push = |ticks, end| {
                hardware.queue_step(self.axis, Period::new(ticks, end));
                waiting += 1;
            };
            // The first interval of a run is long: half of it before the turn, half after.
            let mut ticks = interval;
            if self.queued_forward != Some(self.forward) {
                self.queued_forward = Some(self.forward);
                push(interval / 2, End::Turn(self.forward != self.is_reversed));
                ticks -= interval / 2;
            }
            push(
                ticks,
                if profile.is_step() {
                    End::Step
                } else {
                    End::Rest
                },
            );
            self.is_playing = true;
            if !profile.advance() {
                let next = self.take_up.take();
                self.profile = next.and_then(|(steps, ramp)| Profile::new(steps, ramp));
                self.forward = true;
            }
        }
    }

    /// Starts a run of steps, up for positive ones, from rest.
    pub fn run(&mut self, steps: i64, ramp: Ramp) {
        self.take_up = None;
        self.rebase();
        let count = u32::try_from(steps.unsigned_abs()).unwrap_or(u32::MAX);
        self.profile = Profile::new(count, ramp);
        self.forward = steps > 0;
    }

    /// Starts a run to an absolute angle.
    pub fn go_to(&mut self, target_udeg: i32, settings: &ControllerSettings) {
        let way_udeg = i64::from(target_udeg) - i64::from(self.encoder.udeg);
        self.go_by(way_udeg, settings);
    }

    /// Starts a run over an angle; its last part always leads up, so that the gear's backlash is
    /// taken from one side.
    pub fn go_by(&mut self, way_udeg: i64, settings: &ControllerSettings) {
        let ramp = self.ramp(settings, Key::MaxSpeed);
        let steps = self.steps_of(way_udeg);
        if steps >= 0 {
            self.run(steps, ramp);
            return;
        }
        let take_up = self.steps_of(i64::from(settings.get(self.axis, Key::BacklashTakeup)));
        self.run(steps - take_up, ramp);
        self.take_up = u32::try_from(take_up).ok().map(|up| (up, ramp));
    }

    /// Slows down and stops, after the steps that wait already; nothing follows.
    pub fn decelerate(&mut self) {
        self.take_up = None;
        if !self.profile.as_mut().is_some_and(Profile::decelerate) {
            self.profile = None;
        }
    }

    /// Stops at once.
    pub fn halt(&mut self, hardware: &mut impl Hardware) {
        self.take_up = None;
        self.profile = None;
        // A turn may be among what is dropped.
        self.queued_forward = None;
        hardware.halt(self.axis);
        self.take_progress(hardware);
    }

    /// Counts a correction of an error of so many µdeg; a large one means that steps were missed.
    pub fn note_correction(&mut self, error_udeg: i32, settings: &ControllerSettings) {
        self.corrections += 1;
        // Half the take-up is more than backlash and ringing leave; a lost magnetic cycle is more.
        if error_udeg.unsigned_abs()
            > settings.get(self.axis, Key::BacklashTakeup).unsigned_abs() / 2
        {
            let steps = self.steps_of(i64::from(error_udeg)).unsigned_abs();
            self.missed_steps = self.missed_steps.saturating_add(steps as u32);
        }
    }

    /// Compares steps and encoder: the error and whether it is within its limit.
    pub fn is_following(&mut self, settings: &ControllerSettings) -> bool {
        let run_udeg = (self.base_udeg + self.turned_udeg(self.base_steps)) as i32;
        let error = run_udeg - self.encoder.udeg;
        self.following_udeg = self.following_udeg.max(error.saturating_abs());
        error.saturating_abs() <= settings.get(self.axis, Key::FollowingLimit)
    }

    /// Reads the encoder. A single bad reading is left out, several in a row are a fault.
    pub fn read(
        &mut self,
        now_us: u64,
        settings: &ControllerSettings,
        hardware: &mut impl Hardware,
    ) -> Result<EncoderReading, FaultCode> {
        let turn = i64::from(settings.get(self.axis, Key::EncoderCountsPerTurn));
        let encoder = &mut self.encoder;
        let word = hardware.encoder_word(self.axis, settings.encoder(self.axis));
        encoder.note_warning(now_us, word.is_ok_and(|word| word.warns));
        // Count 0 stays where it is.
        let turned = |raw: u32| match encoder.is_reversed && raw > 0 && i64::from(raw) < turn {
            true => turn as u32 - raw,
            false => raw,
        };
        if let Ok(word) = word {
            encoder.seen_index = word.index.map(turned);
        }
        if encoder.index.is_some() && encoder.index != encoder.seen_index {
            // It was lost while nobody asked.
            return Err(FaultCode::INDEX_WRONG);
        }
        let (counts, fault) = match word.map(|word| turned(word.counts)) {
            Ok(raw) if i64::from(raw) < turn => {
                let Some(last_raw) = encoder.raw else {
                    // The first reading: somewhere within half a turn of 0, until homing.
                    encoder.raw = Some(raw);
                    encoder.read_us = now_us;
                    encoder.index = encoder.seen_index;
                    encoder.set_counts(wrap(i64::from(raw) - encoder.base(), turn), turn);
                    return Ok(EncoderReading::Fresh);
                };
                let moved = wrap(i64::from(raw) - i64::from(last_raw), turn);
                let speed = i64::from(settings.get(self.axis, Key::MaxSpeed));
                let elapsed_us = (now_us - encoder.read_us).min(10_000_000) as i64;
                let plausible_udeg = ALWAYS_PLAUSIBLE_UDEG + 2 * speed * elapsed_us / 1_000_000;
                if moved.abs() * TURN_UDEG <= plausible_udeg * turn {
                    encoder.raw = Some(raw);
                    (Some(encoder.counts + moved), FaultCode::ENCODER_JUMP)
                } else {
                    (None, FaultCode::ENCODER_JUMP)
                }
            }
            Err(EncoderLost::Invalid) => (None, FaultCode::ENCODER_INVALID),
            // One is enough, and none after it says so.
            Err(EncoderLost::Edge) => return Err(FaultCode::EDGE_LOST),
            Err(EncoderLost::Index) => return Err(FaultCode::INDEX_WRONG),
            _ => (None, FaultCode::ENCODER_LOST),
        };
        if let Some(counts) = counts {
            encoder.set_counts(counts, turn);
            encoder.read_us = now_us;
            encoder.bad_readings = 0;
            return Ok(EncoderReading::Fresh);
        }
        encoder.bad_readings = encoder.bad_readings.saturating_add(1);
        if encoder.bad_readings >= MAX_BAD_READINGS {
            Err(fault)
        } else {
            Ok(EncoderReading::Stale)
        }
    }

    /// Whether the encoder has begun to warn since the last call.
    pub fn take_warning(&mut self) -> bool {
        core::mem::take(&mut self.encoder.has_warning)
    }

    /// Steps given since the start, up minus down.
    pub fn steps(&self) -> i64 {
        self.steps
    }

    /// Whether the axis can travel so far that a cam on it closes the home switch at several turns.
    pub fn travels_a_turn(&self, settings: &ControllerSettings) -> bool {
        let get = |key| i64::from(settings.get(self.axis, key));
        get(Key::SoftMax) - get(Key::HomeAngle) >= TURN_UDEG - get(Key::HomeProbe)
    }

    /// Forgets the encoder's past, so that the next reading is taken as it is.
    pub fn forget_encoder(&mut self) {
        self.encoder.raw = None;
        self.encoder.index = None;
        self.encoder.bad_readings = 0;
    }

    /// Whether the encoder has an index from which angles are not counted yet.
    pub fn has_new_index(&self) -> bool {
        self.encoder.index.is_none() && self.encoder.seen_index.is_some()
    }

    /// Whether no angle is known before the encoder's index has come.
    pub fn lacks_index(&self, settings: &ControllerSettings) -> bool {
        settings.encoder(self.axis).kind == EncoderKind::Quadrature
            && self.encoder.seen_index.is_none()
    }

    /// Where the axis stands.
    pub fn contact(&self) -> Contact {
        Contact {
            count: self.encoder.counts + self.encoder.base(),
            udeg: self.encoder.udeg,
        }
    }

    /// The axis has met the home switch there, and is at rest: chooses the encoder's turn in which that was nearest to
    /// the home angle; an error where none is within the tolerance. From here on angles are counted from the
    /// encoder's index, where it has one.
    pub fn set_turn(
        &mut self,
        contact: Contact,
        settings: &ControllerSettings,
    ) -> Result<(), FaultCode> {
        let turn = i64::from(settings.get(self.axis, Key::EncoderCountsPerTurn));
        let home = i64::from(settings.get(self.axis, Key::HomeAngle));
        let Contact { count: is, .. } = self.contact();
        self.encoder.index = self.encoder.seen_index;
        let base = self.encoder.base();
        self.encoder.set_counts(contact.count - base, turn);
        let was_udeg = i64::from(self.encoder.udeg);
        let off = (was_udeg - home + TURN_UDEG / 2).rem_euclid(TURN_UDEG) - TURN_UDEG / 2;
        let turns = (home + off - was_udeg + TURN_UDEG / 2).div_euclid(TURN_UDEG);
        self.encoder.set_counts(is - base + turns * turn, turn);
        self.rebase();
        if off.abs() > i64::from(settings.get(self.axis, Key::HomeTolerance)) {
            return Err(FaultCode::HOME_MISMATCH);
        }
        Ok(())
    }

    /// Home is no longer known.
    pub fn forget_home(&mut self) {
        self.home = None;
    }

    /// The axis rests at home, by the mean of many readings here: steps and encoder count from this.
    pub fn count_from_home(&mut self, encoder_udeg: i64) {
        self.home = Some((self.steps, encoder_udeg));
    }

    /// How far the encoder, with this mean reading, is ahead of the steps, both counted from home,
    /// µdeg. At rest, come to from below, what is left of the gear's error and of the encoder's is all
    /// that is in it.
    pub fn step_loss_udeg(&self, encoder_udeg: i64) -> i64 {
        self.home.map_or(0, |(steps, home_udeg)| {
            let gear = self.gear.ahead_udeg(encoder_udeg) - self.gear.ahead_udeg(home_udeg);
            encoder_udeg - home_udeg - self.turned_udeg(steps) - gear
        })
    }

    /// A ramp up to the speed of a key.
    pub fn ramp(&self, settings: &ControllerSettings, speed: Key) -> Ramp {
        Ramp::new(
            settings.get_u64(self.axis, speed),
            settings.get_u64(self.axis, Key::Acceleration),
            settings.get_u64(self.axis, Key::JerkTime),
            self.steps_per_turn.unsigned_abs(),
        )
    }

    /// An angle in steps, rounded to the nearest.
    pub fn steps_of(&self, udeg: i64) -> i64 {
        (udeg * self.steps_per_turn + TURN_UDEG / 2).div_euclid(TURN_UDEG)
    }

    /// Takes up settings that may have changed. Only at rest.
    pub fn apply(&mut self, settings: &ControllerSettings) {
        self.steps_per_turn = i64::from(settings.get(self.axis, Key::StepsPerTurn));
        self.encoder.map = ErrorMap::new(self.axis, settings);
        self.encoder.is_reversed = settings.get(self.axis, Key::EncoderReversed) != 0;
        self.is_reversed = settings.get(self.axis, Key::MotorReversed) != 0;
        // Which way the direction output stands may mean the other way now.
        self.queued_forward = None;
        self.gear = GearMap::new(self.axis, settings);
        self.encoder.zero = i64::from(settings.get(self.axis, Key::EncoderZero));
        self.home = None;
        self.rebase();
        self.forget_encoder();
    }

    /// Starts a new move: the following error counts from here.
    pub fn clear_following(&mut self) {
        self.following_udeg = 0;
    }

    fn rebase(&mut self) {
        self.base_steps = self.steps;
        self.base_udeg = i64::from(self.encoder.udeg);
    }
}

impl Encoder {
    fn note_warning(&mut self, now_us: u64, warns: bool) {
        if !warns {
            self.warnings = 0;
            return;
        }
        self.warnings = self.warnings.saturating_add(1);
        if self.warnings >= WARNING_READINGS {
            self.has_warning |= now_us >= self.warned_until_us;
            self.warned_until_us = now_us + WARNING_GAP_US;
        }
    }

    /// The count from which `counts` are counted.
    fn base(&self) -> i64 {
        self.zero + i64::from(self.index.unwrap_or(0))
    }

    fn set_counts(&mut self, counts: i64, turn: i64) {
        self.counts = counts;
        let place = |counts: i64| (((counts.rem_euclid(turn)) << 32) / turn) as u32;
        let error =
            self.map.error_udeg(place(counts + self.zero)) - self.map.error_udeg(place(self.zero));
        self.udeg = (counts * TURN_UDEG).div_euclid(turn) as i32 - error;
    }
}

/// A difference of counts as the shorter way round.
fn wrap(counts: i64, turn: i64) -> i64 {
    (counts + turn / 2).rem_euclid(turn) - turn / 2
}
