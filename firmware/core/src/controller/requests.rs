//! What each request does, and when it is refused.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    ControllerState, Latch, LogEntry, Message, RequestOutcome, RequestRefusal, Setting,
    TriggerRequest, TriggerRole,
};
use gonia_protocol::settings::{Axis, Key};

use super::drivers::has_pins;
use super::motion::is_at_home;
use super::{Answer, ArmController, has_alarm};
use crate::axis::AxisDrive;
use crate::hardware::Hardware;
use crate::homing::Homing;
use crate::quadrature::MOST_COUNTS_S;
use crate::settings::BadValue;
use crate::train::TriggerTrain;

/// A start beyond a soft limit by less than this comes from the in-position window, or from the gear's play
/// where homing parks.
const LIMIT_SLACK_UDEG: i32 = 300_000;

impl ArmController {
    /// Executes a request, once.
    pub fn execute(
        &mut self,
        now_us: u64,
        request: u16,
        message: &Message,
        hardware: &mut impl Hardware,
    ) -> Answer {
        self.restart_host_watchdog(now_us);
        for drive in &mut self.drives {
            drive.take_progress(hardware);
        }
        let answer = self.dispatch(now_us, request, message, hardware);
        self.feed(hardware);
        answer
    }

    fn dispatch(
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
            Message::RequestTrigger(arm) => self.request_trigger(now_us, request, arm, hardware),
            Message::Fire => self.fire(now_us, request, hardware),
            Message::Disarm => self.disarm(now_us, hardware),
            Message::ReadLatch(pulse) => self.read_latch(*pulse),
            Message::GetSetting(name) => self.get_setting(name.axis, name.key),
            Message::SetSetting(setting) => self.set_setting(now_us, setting, hardware),
            Message::SaveSettings => self.save_settings(now_us, hardware),
            Message::ReadLog(back) => Ok(Message::LogIs(self.read_log(*back))),
            _ => Err(RequestRefusal::NotUnderstood),
        }
    }

    fn stop(&mut self, now_us: u64, hardware: &mut impl Hardware) -> Answer {
        match self.state {
            ControllerState::Homing | ControllerState::Moving | ControllerState::Settling => {
                self.drives.iter_mut().for_each(AxisDrive::decelerate);
                self.stopping = true;
            }
            ControllerState::Armed => return self.disarm(now_us, hardware),
            _ => {}
        }
        Ok(Message::Accepted)
    }

    fn clear_fault(&mut self, now_us: u64, hardware: &mut impl Hardware) -> Answer {
        if self.drives.iter().any(AxisDrive::is_moving) {
            return Err(RequestRefusal::State(self.state));
        }
        let is_latched = matches!(
            self.state,
            ControllerState::EStop | ControllerState::Fault(_)
        );
        let mut axes = Axis::BOTH.into_iter();
        if is_latched && axes.any(|axis| has_alarm(axis, &self.settings, hardware)) {
            return Err(RequestRefusal::CauseRemains(FaultCode::DRIVER_ALARM));
        }
        match self.state {
            ControllerState::EStop => {
                hardware.hold_interlock_open(false);
                if !hardware.interlock_closed() {
                    return Err(RequestRefusal::CauseRemains(FaultCode::INTERLOCK_OPEN));
                }
            }
            ControllerState::Fault(code) => {
                let lost = Axis::BOTH.iter().any(|&axis| {
                    let setup = self.settings.encoder(axis);
                    hardware.encoder_word(axis, setup).is_err()
                });
                if lost {
                    return Err(RequestRefusal::CauseRemains(code));
                }
            }
            _ => return Ok(Message::Accepted),
        }
        self.restart_drivers();
        for drive in &mut self.drives {
            if !self.homed {
                drive.forget_encoder();
            }
        }
        self.enter(
            if self.homed {
                ControllerState::Idle
            } else {
                ControllerState::Unhomed
            },
            now_us,
        );
        Ok(Message::Accepted)
    }

    fn home(&mut self, now_us: u64, request: u16, hardware: &mut impl Hardware) -> Answer {
        if !matches!(self.state, ControllerState::Unhomed | ControllerState::Idle) {
            return Err(RequestRefusal::State(self.state));
        }
        self.homed = false;
        for (drive, homing) in self.drives.iter_mut().zip(&mut self.homing) {
            drive.clear_following();
            drive.forget_home();
            let at_home = is_at_home(drive.axis(), &self.settings, hardware);
            *homing = Some(Homing::begin(at_home));
        }
        self.job = Some(request);
        self.enter(ControllerState::Homing, now_us);
        Ok(Message::Accepted)
    }

    fn begin_move(&mut self, now_us: u64, request: u16, target_udeg: [i32; 2]) -> Answer {
        if self.state == ControllerState::Unhomed {
            return Err(RequestRefusal::NotHomed);
        }
        self.must_be(ControllerState::Idle)?;
        for axis in Axis::BOTH {
            let low = self.settings.get(axis, Key::SoftMin);
            let high = self.settings.get(axis, Key::SoftMax);
            let here = self.drives[axis.index()].encoder_udeg();
            if !(low..=high).contains(&target_udeg[axis.index()]) {
                return Err(RequestRefusal::TargetBeyondLimit(axis));
            }
            if !(low - LIMIT_SLACK_UDEG..=high + LIMIT_SLACK_UDEG).contains(&here) {
                return Err(RequestRefusal::StartBeyondLimit(axis));
            }
        }
        self.target_udeg = target_udeg;
        self.corrections = [0; 2];
        self.settling = [None; 2];
        for (drive, target) in self.drives.iter_mut().zip(target_udeg) {
            drive.clear_following();
            drive.go_to(target, &self.settings);
        }
        self.job = Some(request);
        self.enter(ControllerState::Moving, now_us);
        Ok(Message::Accepted)
    }

    fn request_trigger(
        &mut self,
        now_us: u64,
        request: u16,
        arm: &TriggerRequest,
        hardware: &mut impl Hardware,
    ) -> Answer {
        self.must_be(ControllerState::Idle)?;
        let train = TriggerTrain::new(arm.clone(), request).ok_or(RequestRefusal::Value)?;
        self.must_be_within_window(now_us, hardware)?;
        self.train = Some(train);
        self.enter(ControllerState::Armed, now_us);
        Ok(Message::Accepted)
    }

    fn fire(&mut self, now_us: u64, request: u16, hardware: &mut impl Hardware) -> Answer {
        self.must_be(ControllerState::Armed)?;
        let ready = self
            .train
            .as_ref()
            .is_some_and(|train| train.trigger() == TriggerRole::Source && train.is_waiting());
        if !ready {
            return Err(RequestRefusal::State(self.state));
        }
        self.must_be_within_window(now_us, hardware)?;
        if let Some(train) = &mut self.train {
            train.fire(now_us);
        }
        self.job = Some(request);
        Ok(Message::Accepted)
    }

    fn disarm(&mut self, now_us: u64, hardware: &mut impl Hardware) -> Answer {
        if self.state == ControllerState::Armed {
            hardware.end_pulse();
            self.train = None;
            self.enter(ControllerState::Idle, now_us);
            self.complete(RequestOutcome::Stopped);
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
            .ok_or(RequestRefusal::NoSuchPulse)
    }

    fn get_setting(&self, axis: Axis, number: u8) -> Answer {
        let key = Key::from_number(number).ok_or(RequestRefusal::Value)?;
        let value = self.settings.get(axis, key);
        Ok(Message::SettingIs(Setting {
            axis,
            key: number,
            value,
        }))
    }

    fn set_setting(
        &mut self,
        now_us: u64,
        setting: &Setting,
        hardware: &mut impl Hardware,
    ) -> Answer {
        if !matches!(self.state, ControllerState::Unhomed | ControllerState::Idle) {
            return Err(RequestRefusal::State(self.state));
        }
        let key = Key::from_number(setting.key).ok_or(RequestRefusal::Value)?;
        let mut changed = self.settings.clone();
        changed
            .set(setting.axis, key, setting.value)
            .map_err(|bad| match bad {
                BadValue::Value => RequestRefusal::Value,
                BadValue::CountRate(counts_s) => RequestRefusal::CountRate(counts_s, MOST_COUNTS_S),
            })?;
        if !has_pins(&changed, hardware) {
            return Err(RequestRefusal::NoPins);
        }
        self.settings = changed;
        self.apply_to_driver(setting.axis, key);
        // What an angle *means* has changed: the old zero is worth nothing.
        if matches!(
            key,
            Key::StepsPerTurn
                | Key::EncoderCountsPerTurn
                | Key::EncoderZero
                | Key::HomeAngle
                | Key::MotorReversed
                | Key::EncoderReversed
                | Key::EncoderKind
                | Key::DriverKind
                | Key::DriverAddress
                | Key::Microsteps
        ) || Key::ERROR_MAP.contains(&key)
            || Key::GEAR_MAP.contains(&key)
        {
            self.homed = false;
            self.enter(ControllerState::Unhomed, now_us);
            let drives = self.drives.iter_mut();
            drives.for_each(|drive| drive.apply(&self.settings));
        }
        Ok(Message::SettingIs(setting.clone()))
    }

    fn save_settings(&mut self, now_us: u64, hardware: &mut impl Hardware) -> Answer {
        if !matches!(self.state, ControllerState::Unhomed | ControllerState::Idle) {
            return Err(RequestRefusal::State(self.state));
        }
        if hardware.save_settings(&self.settings.to_bytes()).is_err() {
            self.fault(now_us, FaultCode::SETTINGS_NOT_SAVED, None);
            return Err(RequestRefusal::State(self.state));
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

    fn must_be(&self, state: ControllerState) -> Result<(), RequestRefusal> {
        if self.state == state {
            Ok(())
        } else {
            Err(RequestRefusal::State(self.state))
        }
    }

    fn must_be_within_window(
        &mut self,
        now_us: u64,
        hardware: &mut impl Hardware,
    ) -> Result<(), RequestRefusal> {
        match self.axis_outside_window(now_us, hardware) {
            Some((axis, error)) => Err(RequestRefusal::OutsideWindow(axis, error)),
            None => Ok(()),
        }
    }
}
