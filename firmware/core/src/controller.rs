//! The states of a controller and their one owner.
//!
//! ```text
//! Boot → Unhomed → Homing → Idle ⇄ Moving → Settling → Idle ⇄ Armed
//! any state → Fault(code) or EStop → (ClearFault) → Idle, or Unhomed where home is lost
//! ```
//! Whoever wants another state calls [`Controller::enter`]; nothing else writes it.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    Arm, Completed, Faulted, Latch, LogEntry, Message, Outcome, Refusal, Setting, State, Status,
    Telemetry, Trigger,
};
use gonia_protocol::settings::{Axis, Key};
use heapless::Deque;

use crate::axis::{AxisDrive, Reading};
use crate::hardware::Hardware;
use crate::homing::Homing;
use crate::settings::Settings;
use crate::settle::{Limits, Settle, Verdict};
use crate::train::{Deed, Train};

/// Control ticks while something happens, µs.
pub const BUSY_TICK_US: u64 = 2_000;
/// Control ticks at rest, µs.
pub const REST_TICK_US: u64 = 20_000;
const LOG_LEN: usize = 16;
/// Start beyond a soft limit by less than this is the doing of the deadband, or of the gear's play
/// where homing parks.
const LIMIT_SLACK_UDEG: i32 = 300_000;

/// Two axes, their states, and what they were asked for.
#[derive(Debug)]
pub struct Controller {
    state: State,
    homed: bool,
    settings: Settings,
    drives: [AxisDrive; 2],
    homing: [Option<Homing>; 2],
    settle: [Option<Settle>; 2],
    target_udeg: [i32; 2],
    corrections: [u8; 2],
    /// The request under way, which will end in a `Completed`.
    job: Option<u16>,
    stopping: bool,
    train: Option<Train>,
    last: Option<(u16, Outcome)>,
    lease_until_us: u64,
    next_tick_us: u64,
    next_telemetry_us: u64,
    event_seq: u32,
    events: Deque<Message, 16>,
    log: Deque<LogEntry, LOG_LEN>,
}

/// What a request comes to.
pub type Answer = Result<Message, Refusal>;

impl Controller {
    /// A controller that has just started, with the settings found in the board's memory.
    /// `None` means a new board; damaged bytes latch a fault, with the defaults in use.
    pub fn new(now_us: u64, stored_settings: Option<&[u8]>) -> Self {
        let (settings, damaged) = match stored_settings.map(Settings::from_bytes) {
            None => (Settings::default(), false),
            Some(Ok(settings)) => (settings, false),
            Some(Err(_)) => (Settings::default(), true),
        };
        let mut controller = Self {
            state: State::Boot,
            homed: false,
            drives: Axis::BOTH.map(|axis| AxisDrive::new(axis, &settings)),
            settings,
            homing: [None; 2],
            settle: [None; 2],
            target_udeg: [0; 2],
            corrections: [0; 2],
            job: None,
            stopping: false,
            train: None,
            last: None,
            lease_until_us: 0,
            next_tick_us: now_us,
            next_telemetry_us: u64::MAX,
            event_seq: 0,
            events: Deque::new(),
            log: Deque::new(),
        };
        if damaged {
            controller.fault(now_us, FaultCode::SETTINGS_DAMAGED, None);
        }
        controller
    }

    /// What it is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether steps are being given.
    pub fn is_moving(&self) -> bool {
        self.drives.iter().any(AxisDrive::is_moving)
    }

    /// The settings in use.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// When [`Self::poll`] must be called next, µs.
    pub fn wake_us(&self) -> u64 {
        let train = self.train.as_ref().map_or(u64::MAX, Train::wake_us);
        self.next_tick_us.min(train)
    }

    /// The oldest event that nobody has taken.
    pub fn take_event(&mut self) -> Option<Message> {
        self.events.pop_front()
    }

    /// How it is; the counters of the wire are the caller's to fill in.
    pub fn status(&self, now_us: u64) -> Status {
        Status {
            time_us: now_us,
            state: self.state,
            homed: self.homed,
            axes: [self.drives[0].status(), self.drives[1].status()],
            last: self.last,
            frames_good: 0,
            frames_bad: 0,
            config_crc: self.settings.crc(),
        }
    }

    /// The host was heard.
    pub fn renew_lease(&mut self, now_us: u64) {
        self.lease_until_us = now_us + self.settings.get_u64(Axis::Theta, Key::Lease);
    }

    /// Does whatever is due: pulses, and every tick the control of both axes; and sees to it that the
    /// step timers have something to do until the next tick.
    pub fn poll(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        for drive in &mut self.drives {
            drive.look(hardware);
        }
        if self.train.is_some() {
            self.give_pulses(now_us, hardware);
        }
        if now_us >= self.next_tick_us {
            self.tick(now_us, hardware);
            let period = if self.is_busy() {
                BUSY_TICK_US
            } else {
                REST_TICK_US
            };
            self.next_tick_us = now_us + period;
        }
        self.feed(hardware);
    }

    fn feed(&mut self, hardware: &mut impl Hardware) {
        for drive in &mut self.drives {
            drive.feed(hardware);
        }
    }

    /// Executes a request, once.
    pub fn execute(
        &mut self,
        now_us: u64,
        request: u16,
        message: &Message,
        hardware: &mut impl Hardware,
    ) -> Answer {
        self.renew_lease(now_us);
        for drive in &mut self.drives {
            drive.look(hardware);
        }
        let answer = self.obey(now_us, request, message, hardware);
        self.feed(hardware);
        answer
    }

    fn obey(
        &mut self,
        now_us: u64,
        request: u16,
        message: &Message,
        hardware: &mut impl Hardware,
    ) -> Answer {
        match message {
            Message::GetStatus => Ok(Message::Status(self.status(now_us))),
            Message::Stop => self.stop(now_us, hardware),
            Message::EStop => {
                hardware.hold_interlock_open(true);
                self.emergency_stop(now_us, hardware);
                Ok(Message::Accepted)
            }
            Message::ClearFault => self.clear_fault(now_us, hardware),
            Message::Home => self.home(now_us, request, hardware),
            Message::Move(to) => self.begin_move(now_us, request, to.target_udeg),
            Message::Arm(arm) => self.arm(now_us, request, arm, hardware),
            Message::Fire => self.fire(now_us, request, hardware),
            Message::Disarm => self.disarm(now_us, hardware),
            Message::ReadLatch(pulse) => self.read_latch(*pulse),
            Message::GetSetting(name) => self.get_setting(name.axis, name.key),
            Message::SetSetting(setting) => self.set_setting(now_us, setting),
            Message::SaveSettings => self.save_settings(now_us, hardware),
            Message::ReadLog(back) => Ok(Message::LogIs(self.read_log(*back))),
            _ => Err(Refusal::NotUnderstood),
        }
    }

    /// The other controller has raised the trigger wire.
    pub fn trigger_edge(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        let follows = self
            .train
            .as_ref()
            .is_some_and(|train| train.trigger() == Trigger::Follower);
        if self.state != State::Armed || !follows {
            return;
        }
        let outside = self.axis_outside_window(now_us, hardware);
        self.latch(now_us, outside.is_none());
        if let Some(train) = &self.train
            && train.is_over()
        {
            let request = train.request();
            self.job = Some(request);
            self.enter(State::Idle, now_us);
            self.complete(Outcome::Done);
        }
    }

    // ---- requests ----

    fn stop(&mut self, now_us: u64, hardware: &mut impl Hardware) -> Answer {
        match self.state {
            State::Homing | State::Moving | State::Settling => {
                self.drives.iter_mut().for_each(AxisDrive::decelerate);
                self.stopping = true;
            }
            State::Armed => return self.disarm(now_us, hardware),
            _ => {}
        }
        Ok(Message::Accepted)
    }

    fn clear_fault(&mut self, now_us: u64, hardware: &mut impl Hardware) -> Answer {
        if self.drives.iter().any(AxisDrive::is_moving) {
            return Err(Refusal::State(self.state));
        }
        match self.state {
            State::EStop => {
                hardware.hold_interlock_open(false);
                if !hardware.interlock_closed() {
                    return Err(Refusal::CauseRemains(FaultCode::INTERLOCK_OPEN));
                }
            }
            State::Fault(code) => {
                let lost = Axis::BOTH
                    .iter()
                    .any(|&axis| hardware.encoder_counts(axis).is_err());
                if lost {
                    return Err(Refusal::CauseRemains(code));
                }
            }
            _ => return Ok(Message::Accepted),
        }
        for drive in &mut self.drives {
            if !self.homed {
                drive.forget_encoder();
            }
        }
        self.enter(
            if self.homed {
                State::Idle
            } else {
                State::Unhomed
            },
            now_us,
        );
        Ok(Message::Accepted)
    }

    fn home(&mut self, now_us: u64, request: u16, hardware: &mut impl Hardware) -> Answer {
        if !matches!(self.state, State::Unhomed | State::Idle) {
            return Err(Refusal::State(self.state));
        }
        self.homed = false;
        for (drive, homing) in self.drives.iter_mut().zip(&mut self.homing) {
            drive.clear_following();
            drive.forget_home();
            let closed = hardware.home_switch_closed(drive.axis());
            *homing = Some(Homing::begin(closed));
        }
        self.job = Some(request);
        self.enter(State::Homing, now_us);
        Ok(Message::Accepted)
    }

    fn begin_move(&mut self, now_us: u64, request: u16, target_udeg: [i32; 2]) -> Answer {
        if self.state == State::Unhomed {
            return Err(Refusal::NotHomed);
        }
        self.must_be(State::Idle)?;
        for axis in Axis::BOTH {
            let low = self.settings.get(axis, Key::SoftMin);
            let high = self.settings.get(axis, Key::SoftMax);
            let here = self.drives[axis.index()].encoder_udeg();
            if !(low..=high).contains(&target_udeg[axis.index()]) {
                return Err(Refusal::TargetBeyondLimit(axis));
            }
            if !(low - LIMIT_SLACK_UDEG..=high + LIMIT_SLACK_UDEG).contains(&here) {
                return Err(Refusal::StartBeyondLimit(axis));
            }
        }
        self.target_udeg = target_udeg;
        self.corrections = [0; 2];
        self.settle = [None; 2];
        for (drive, target) in self.drives.iter_mut().zip(target_udeg) {
            drive.clear_following();
            drive.go_to(target, &self.settings);
        }
        self.job = Some(request);
        self.enter(State::Moving, now_us);
        Ok(Message::Accepted)
    }

    fn arm(
        &mut self,
        now_us: u64,
        request: u16,
        arm: &Arm,
        hardware: &mut impl Hardware,
    ) -> Answer {
        self.must_be(State::Idle)?;
        let train = Train::new(arm.clone(), request).ok_or(Refusal::Value)?;
        self.must_be_within_window(now_us, hardware)?;
        self.train = Some(train);
        self.enter(State::Armed, now_us);
        Ok(Message::Accepted)
    }

    fn fire(&mut self, now_us: u64, request: u16, hardware: &mut impl Hardware) -> Answer {
        self.must_be(State::Armed)?;
        let ready = self
            .train
            .as_ref()
            .is_some_and(|train| train.trigger() == Trigger::Source && train.is_waiting());
        if !ready {
            return Err(Refusal::State(self.state));
        }
        self.must_be_within_window(now_us, hardware)?;
        if let Some(train) = &mut self.train {
            train.fire(now_us);
        }
        self.job = Some(request);
        Ok(Message::Accepted)
    }

    fn disarm(&mut self, now_us: u64, hardware: &mut impl Hardware) -> Answer {
        if self.state == State::Armed {
            hardware.set_trigger(false);
            self.train = None;
            self.enter(State::Idle, now_us);
            self.complete(Outcome::Stopped);
        }
        Ok(Message::Accepted)
    }

    fn read_latch(&self, pulse: u8) -> Answer {
        self.train
            .as_ref()
            .and_then(|train| train.latches().get(pulse as usize))
            .map(|latch| {
                Message::LatchIs(Latch {
                    seq: 0,
                    ..latch.clone()
                })
            })
            .ok_or(Refusal::NoSuchPulse)
    }

    fn get_setting(&self, axis: Axis, number: u8) -> Answer {
        let key = Key::from_number(number).ok_or(Refusal::Value)?;
        let value = self.settings.get(axis, key);
        Ok(Message::SettingIs(Setting {
            axis,
            key: number,
            value,
        }))
    }

    fn set_setting(&mut self, now_us: u64, setting: &Setting) -> Answer {
        if !matches!(self.state, State::Unhomed | State::Idle) {
            return Err(Refusal::State(self.state));
        }
        let key = Key::from_number(setting.key).ok_or(Refusal::Value)?;
        self.settings
            .set(setting.axis, key, setting.value)
            .map_err(|_| Refusal::Value)?;
        // What an angle *means* has changed: the old zero is worth nothing.
        if matches!(
            key,
            Key::StepsPerTurn | Key::EncoderCountsPerTurn | Key::EncoderZero | Key::HomeAngle
        ) || Key::ERROR_MAP.contains(&key)
            || Key::GEAR_MAP.contains(&key)
        {
            self.homed = false;
            self.enter(State::Unhomed, now_us);
            let drives = self.drives.iter_mut();
            drives.for_each(|drive| drive.apply(&self.settings));
        }
        Ok(Message::SettingIs(setting.clone()))
    }

    fn save_settings(&mut self, now_us: u64, hardware: &mut impl Hardware) -> Answer {
        if !matches!(self.state, State::Unhomed | State::Idle) {
            return Err(Refusal::State(self.state));
        }
        if hardware.save_settings(&self.settings.to_bytes()).is_err() {
            self.fault(now_us, FaultCode::SETTINGS_NOT_SAVED, None);
            return Err(Refusal::State(self.state));
        }
        Ok(Message::Accepted)
    }

    fn read_log(&self, back: u8) -> LogEntry {
        let newest_first = self.log.iter().rev().nth(back as usize);
        newest_first.cloned().unwrap_or(LogEntry {
            time_us: 0,
            fault: None,
            axis: None,
        })
    }

    fn must_be(&self, state: State) -> Result<(), Refusal> {
        if self.state == state {
            Ok(())
        } else {
            Err(Refusal::State(self.state))
        }
    }

    fn must_be_within_window(
        &mut self,
        now_us: u64,
        hardware: &mut impl Hardware,
    ) -> Result<(), Refusal> {
        match self.axis_outside_window(now_us, hardware) {
            Some((axis, error)) => Err(Refusal::OutsideWindow(axis, error)),
            None => Ok(()),
        }
    }

    // ---- every tick ----

    fn is_busy(&self) -> bool {
        !matches!(
            self.state,
            State::Idle | State::Unhomed | State::EStop | State::Fault(_)
        ) || self.drives.iter().any(AxisDrive::is_moving)
    }

    fn needs_lease(&self) -> bool {
        matches!(
            self.state,
            State::Homing | State::Moving | State::Settling | State::Armed
        )
    }

    fn tick(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        if !hardware.interlock_closed() && self.state != State::EStop {
            self.emergency_stop(now_us, hardware);
        }
        for drive in &mut self.drives {
            let axis = drive.axis();
            if let Err(code) = drive.read(now_us, &self.settings, hardware) {
                self.fault_unless_latched(now_us, code, Some(axis), hardware);
                return;
            }
        }
        if self.needs_lease() && now_us > self.lease_until_us {
            self.fault_unless_latched(now_us, FaultCode::LEASE_EXPIRED, None, hardware);
            return;
        }
        match self.state {
            State::Boot => self.enter(State::Unhomed, now_us),
            State::Homing => self.tick_homing(now_us, hardware),
            State::Moving | State::Settling => self.tick_motion(now_us, hardware),
            _ => {}
        }
        self.send_telemetry(now_us);
    }

    fn tick_homing(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        if self.finish_stop(now_us) || !self.check_following(now_us, hardware) {
            return;
        }
        for (drive, homing) in self.drives.iter_mut().zip(&mut self.homing) {
            let Some(homing) = homing else { continue };
            let axis = drive.axis();
            let closed = hardware.home_switch_closed(axis);
            if let Err(code) = homing.tick(now_us, closed, drive, &self.settings, hardware) {
                self.fault_unless_latched(now_us, code, Some(axis), hardware);
                return;
            }
        }
        if self.homing.iter().flatten().all(Homing::is_done) {
            self.homed = true;
            for (drive, homing) in self.drives.iter_mut().zip(&mut self.homing) {
                if let Some(homing) = homing.take() {
                    drive.count_from_home(homing.rest_udeg());
                }
            }
            self.target_udeg = Axis::BOTH.map(|axis| self.settings.get(axis, Key::SoftMin));
            self.enter(State::Idle, now_us);
            self.complete(Outcome::Done);
        }
    }

    fn tick_motion(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        if self.finish_stop(now_us) || !self.check_following(now_us, hardware) {
            return;
        }
        let mut reached = true;
        for axis in Axis::BOTH {
            match self.tick_settling(now_us, axis) {
                Ok(there) => reached &= there,
                Err(code) => {
                    self.fault_unless_latched(now_us, code, Some(axis), hardware);
                    return;
                }
            }
        }
        if reached {
            if let Some(axis) = self.axis_in_disagreement() {
                self.fault_unless_latched(now_us, FaultCode::STEPS_DISAGREE, Some(axis), hardware);
                return;
            }
            self.enter(State::Idle, now_us);
            self.complete(Outcome::Done);
        } else if self.drives.iter().any(AxisDrive::is_moving) {
            self.enter(State::Moving, now_us);
        } else {
            self.enter(State::Settling, now_us);
        }
    }

    /// The first axis whose steps and encoder tell of different places.
    fn axis_in_disagreement(&self) -> Option<Axis> {
        Axis::BOTH.into_iter().find(|&axis| {
            let i = axis.index();
            let mean_udeg = self.settle[i].as_ref().map_or(0, Settle::mean_udeg);
            let encoder_udeg = i64::from(self.target_udeg[i]) + mean_udeg;
            let limit = i64::from(self.settings.get(axis, Key::StepsDisagree));
            self.drives[i].disagreement_udeg(encoder_udeg).abs() > limit
        })
    }

    /// One axis after its run: whether it has reached its target, up to now.
    fn tick_settling(&mut self, now_us: u64, axis: Axis) -> Result<bool, FaultCode> {
        let i = axis.index();
        let drive = &mut self.drives[i];
        if drive.is_moving() {
            return Ok(false);
        }
        let limits = Limits {
            deadband_udeg: self.settings.get(axis, Key::Deadband),
            window_us: self.settings.get_u64(axis, Key::SettleWindow),
            patience_us: self.settings.get_u64(axis, Key::SettlePatience),
        };
        let settle = self.settle[i].get_or_insert_with(|| Settle::new(now_us, limits));
        match settle.reading(now_us, drive.encoder_udeg() - self.target_udeg[i]) {
            Verdict::Wait => Ok(false),
            Verdict::Reached => Ok(true),
            Verdict::Restless => Err(FaultCode::NOT_REACHED),
            Verdict::Off(error) => {
                if i32::from(self.corrections[i]) >= self.settings.get(axis, Key::MaxCorrections) {
                    return Err(FaultCode::NOT_REACHED);
                }
                self.corrections[i] += 1;
                drive.note_correction(error, &self.settings);
                // The mean, not the last reading: that one has the noise and the swing in it.
                drive.go_by(-i64::from(error), &self.settings);
                self.settle[i] = None;
                Ok(false)
            }
        }
    }

    fn check_following(&mut self, now_us: u64, hardware: &mut impl Hardware) -> bool {
        for i in 0..2 {
            let drive = &mut self.drives[i];
            if drive.is_moving() && !drive.is_following(&self.settings) {
                let axis = drive.axis();
                self.fault_unless_latched(now_us, FaultCode::FOLLOWING_ERROR, Some(axis), hardware);
                return false;
            }
        }
        true
    }

    /// After `Stop`: waits until both axes rest. Returns whether a stop is under way.
    fn finish_stop(&mut self, now_us: u64) -> bool {
        if self.stopping && !self.drives.iter().any(AxisDrive::is_moving) {
            self.enter(
                if self.homed {
                    State::Idle
                } else {
                    State::Unhomed
                },
                now_us,
            );
            self.complete(Outcome::Stopped);
            return true;
        }
        self.stopping
    }

    // ---- pulses ----

    fn give_pulses(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        let Some(train) = &mut self.train else { return };
        match train.due(now_us) {
            Deed::None => {}
            Deed::Raise => match self.axis_outside_window(now_us, hardware) {
                Some((axis, _)) => {
                    self.train = None;
                    self.enter(State::Idle, now_us);
                    self.complete(Outcome::LeftWindow(axis));
                }
                None => {
                    self.latch(now_us, true);
                    hardware.set_trigger(true);
                }
            },
            Deed::Lower => {
                hardware.set_trigger(false);
                if train.is_over() {
                    self.enter(State::Idle, now_us);
                    self.complete(Outcome::Done);
                }
            }
        }
    }

    /// Keeps the encoders that were read just now.
    fn latch(&mut self, now_us: u64, within: bool) {
        let seq = self.next_seq();
        let encoder_udeg = [self.drives[0].encoder_udeg(), self.drives[1].encoder_udeg()];
        let Some(train) = &mut self.train else { return };
        let latch = Latch {
            seq,
            request: train.request(),
            pulse: train.latches().len() as u8,
            time_us: now_us,
            encoder_udeg,
            within,
        };
        train.latch(latch.clone());
        self.push_event(Message::Pulse(latch));
    }

    /// Reads both encoders now; the first axis outside the trigger window, or whose reading is bad.
    fn axis_outside_window(
        &mut self,
        now_us: u64,
        hardware: &mut impl Hardware,
    ) -> Option<(Axis, i32)> {
        let mut outside = None;
        for axis in Axis::BOTH {
            let drive = &mut self.drives[axis.index()];
            let fresh = drive.read(now_us, &self.settings, hardware) == Ok(Reading::Fresh);
            let error = drive.encoder_udeg() - self.target_udeg[axis.index()];
            let window = self.settings.get(axis, Key::TriggerWindow);
            if outside.is_none() && (!fresh || error.saturating_abs() > window) {
                outside = Some((axis, error));
            }
        }
        outside
    }

    // ---- transitions ----

    /// The one place where the state changes.
    fn enter(&mut self, state: State, now_us: u64) {
        if self.state == state {
            return;
        }
        #[cfg(feature = "defmt")]
        defmt::debug!("{} -> {}", self.state, state);
        self.state = state;
        self.next_tick_us = self.next_tick_us.min(now_us + BUSY_TICK_US);
        let telemetry = self.settings.get_u64(Axis::Theta, Key::Telemetry);
        if telemetry > 0 && self.next_telemetry_us == u64::MAX && self.needs_lease() {
            self.next_telemetry_us = now_us + telemetry;
        }
    }

    fn emergency_stop(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        self.halt(hardware);
        hardware.set_trigger(false);
        // Stopping at once may have lost steps.
        self.homed = false;
        self.note_fault(now_us, FaultCode::INTERLOCK_OPEN, None);
        self.enter(State::EStop, now_us);
        self.drop_work(Outcome::Failed(FaultCode::INTERLOCK_OPEN));
    }

    fn fault_unless_latched(
        &mut self,
        now_us: u64,
        code: FaultCode,
        axis: Option<Axis>,
        hardware: &mut impl Hardware,
    ) {
        if matches!(self.state, State::Fault(_) | State::EStop) {
            return;
        }
        hardware.set_trigger(false);
        if code == FaultCode::LEASE_EXPIRED {
            self.drives.iter_mut().for_each(AxisDrive::decelerate);
        } else {
            self.halt(hardware);
        }
        self.fault(now_us, code, axis);
    }

    fn halt(&mut self, hardware: &mut impl Hardware) {
        for drive in &mut self.drives {
            drive.halt(hardware);
        }
    }

    /// Latches a fault; the caller has stopped the arm.
    fn fault(&mut self, now_us: u64, code: FaultCode, axis: Option<Axis>) {
        self.homed &= !code.loses_home();
        self.note_fault(now_us, code, axis);
        self.enter(State::Fault(code), now_us);
        self.drop_work(Outcome::Failed(code));
    }

    fn drop_work(&mut self, outcome: Outcome) {
        self.homing = [None; 2];
        self.settle = [None; 2];
        self.train = None;
        self.complete(outcome);
    }

    fn note_fault(&mut self, now_us: u64, code: FaultCode, axis: Option<Axis>) {
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
    fn complete(&mut self, outcome: Outcome) {
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

    fn send_telemetry(&mut self, now_us: u64) {
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

    fn next_seq(&mut self) -> u32 {
        self.event_seq = self.event_seq.wrapping_add(1);
        self.event_seq
    }

    /// An event that finds no room is lost; the host sees the gap in the numbers and asks.
    fn push_event(&mut self, event: Message) {
        let _ = self.events.push_back(event);
    }
}
