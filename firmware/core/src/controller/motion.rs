//! Homing, moves and settling, tick by tick.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, RequestOutcome};
use gonia_protocol::settings::{Axis, Key};

use super::ArmController;
use crate::axis::AxisDrive;
use crate::hardware::Hardware;
use crate::homing::Homing;
use crate::settings::ControllerSettings;
use crate::settling::{SettlingLimits, SettlingMonitor, SettlingResult};

/// What the home switch of an axis says, whichever way its contact works.
pub(super) fn is_at_home(
    axis: Axis,
    settings: &ControllerSettings,
    hardware: &mut impl Hardware,
) -> bool {
    let opens_at_home = settings.get(axis, Key::HomeNormallyClosed) != 0;
    hardware.home_switch_closed(axis) != opens_at_home
}

impl ArmController {
    pub(super) fn tick_homing(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        if !self.check_following(now_us, hardware)
            || self.finish_stop(now_us)
            || !self.power.is_ready(now_us)
            || !self.drivers_are_set()
        {
            return;
        }
        for (drive, homing) in self.drives.iter_mut().zip(&mut self.homing) {
            let Some(homing) = homing else { continue };
            let axis = drive.axis();
            let at_home = is_at_home(axis, &self.settings, hardware);
            if let Err(code) = homing.tick(now_us, at_home, drive, &self.settings, hardware) {
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
            self.enter(ControllerState::Idle, now_us);
            self.complete(RequestOutcome::Done);
        }
    }

    pub(super) fn tick_motion(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        if !self.check_following(now_us, hardware) || self.finish_stop(now_us) {
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
            if let Some(axis) = self.axis_with_step_loss() {
                self.fault_unless_latched(now_us, FaultCode::STEP_LOSS, Some(axis), hardware);
                return;
            }
            self.enter(ControllerState::Idle, now_us);
            self.complete(RequestOutcome::Done);
        } else if self.drives.iter().any(AxisDrive::is_moving) {
            self.enter(ControllerState::Moving, now_us);
        } else {
            self.enter(ControllerState::Settling, now_us);
        }
    }

    /// The first axis whose steps and encoder differ by more than the step-loss limit.
    fn axis_with_step_loss(&self) -> Option<Axis> {
        Axis::BOTH.into_iter().find(|&axis| {
            let i = axis.index();
            let mean_udeg = self.settling[i]
                .as_ref()
                .map_or(0, SettlingMonitor::mean_udeg);
            let encoder_udeg = i64::from(self.target_udeg[i]) + mean_udeg;
            let limit = i64::from(self.settings.get(axis, Key::StepLossLimit));
            self.drives[i].step_loss_udeg(encoder_udeg).abs() > limit
        })
    }

    /// One axis after its run: whether it has reached its target, up to now.
    fn tick_settling(&mut self, now_us: u64, axis: Axis) -> Result<bool, FaultCode> {
        let i = axis.index();
        let drive = &mut self.drives[i];
        if drive.is_moving() {
            return Ok(false);
        }
        let limits = SettlingLimits {
            window_udeg: self.settings.get(axis, Key::InPositionWindow),
            time_us: self.settings.get_u64(axis, Key::SettlingTime),
            timeout_us: self.settings.get_u64(axis, Key::SettlingTimeout),
        };
        let settling = self.settling[i].get_or_insert_with(|| SettlingMonitor::new(now_us, limits));
        match settling.reading(now_us, drive.encoder_udeg() - self.target_udeg[i]) {
            SettlingResult::Wait => Ok(false),
            SettlingResult::Reached => Ok(true),
            SettlingResult::Restless => Err(FaultCode::NOT_REACHED),
            SettlingResult::Off(error) => {
                if i32::from(self.corrections[i]) >= self.settings.get(axis, Key::MaxCorrections) {
                    return Err(FaultCode::NOT_REACHED);
                }
                self.corrections[i] += 1;
                drive.note_correction(error, &self.settings);
                // The mean, not the last reading: that one has the noise and the swing in it.
                drive.go_by(-i64::from(error), &self.settings);
                self.settling[i] = None;
                Ok(false)
            }
        }
    }

    /// Whether every axis that moves follows its steps; a fault where one does not.
    pub(super) fn check_following(&mut self, now_us: u64, hardware: &mut impl Hardware) -> bool {
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
                    ControllerState::Idle
                } else {
                    ControllerState::Unhomed
                },
                now_us,
            );
            self.complete(RequestOutcome::Stopped);
            return true;
        }
        self.stopping
    }
}
