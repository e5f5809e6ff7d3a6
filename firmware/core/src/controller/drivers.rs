//! Motors' drivers that are set by wire: their settings before they get their current, and what they report.

use gonia_protocol::message::ControllerState;
use gonia_protocol::settings::{Axis, Key};

use super::ArmController;
use crate::driver::{DriverMotion, DriverWatch};
use crate::hardware::Hardware;
use crate::settings::ControllerSettings;

/// Whether the board has the pins that the settings of drivers and encoders ask for.
pub(super) fn has_pins(settings: &ControllerSettings, hardware: &impl Hardware) -> bool {
    Axis::BOTH.into_iter().all(|axis| {
        let driver = settings.driver(axis);
        driver.is_none_or(|driver| hardware.has_driver_bus(driver.bus))
            && hardware.has_encoder(axis, settings.encoder(axis).kind)
    })
}

impl ArmController {
    /// Sets and watches the drivers. Not while something is latched: what stopped the arm may have taken their
    /// supply, and who clears it has them set anew.
    pub(super) fn tick_drivers(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        if matches!(
            self.state,
            ControllerState::Fault(_) | ControllerState::EStop
        ) {
            return;
        }
        for axis in Axis::BOTH {
            let Some(setup) = self.settings.driver(axis) else {
                continue;
            };
            let drive = &self.drives[axis.index()];
            let motion = DriverMotion {
                is_moving: drive.is_moving(),
                steps: drive.steps(),
            };
            let watch = &mut self.drivers[axis.index()];
            if motion.is_moving {
                watch.look_soon(now_us);
            }
            match watch.tick(now_us, axis, &setup, motion, hardware) {
                Some(code) if code.is_warning() => self.note_fault(now_us, code, Some(axis)),
                Some(code) => {
                    self.fault_unless_latched(now_us, code, Some(axis), hardware);
                    return;
                }
                None => {}
            }
        }
    }

    /// Whether every driver that is set by wire holds its settings.
    pub(super) fn drivers_are_set(&self) -> bool {
        Axis::BOTH.into_iter().all(|axis| {
            let watch = &self.drivers[axis.index()];
            watch.is_set() || self.settings.driver(axis).is_none()
        })
    }

    /// Whether a driver's settings are on their way.
    pub(super) fn sets_drivers(&self) -> bool {
        let is_latched = matches!(
            self.state,
            ControllerState::Fault(_) | ControllerState::EStop
        );
        !is_latched && !self.drivers_are_set()
    }

    /// What was latched is cleared: drivers whose supply may have gone are set anew.
    pub(super) fn restart_drivers(&mut self) {
        let may_have_gone = self.state == ControllerState::EStop;
        for watch in &mut self.drivers {
            if may_have_gone {
                watch.restart();
            } else {
                watch.restart_if_failed();
            }
        }
    }

    /// A setting has changed: if it is one of a driver, that is set anew.
    pub(super) fn apply_to_driver(&mut self, axis: Axis, key: Key) {
        if Key::DRIVER.contains(&key) {
            self.drivers[axis.index()] = DriverWatch::default();
        }
    }
}
