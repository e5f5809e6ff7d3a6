//! Fault codes. A number, once given, keeps its meaning for ever.

use serde::{Deserialize, Serialize};

/// A latched fault, or a warning ([`FaultCode::is_warning`]). A number rather than an enum, so that a host can show the
/// code of a newer firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FaultCode(pub u16);

/// A fault: symptom, cause, remedy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultPage {
    /// The code.
    pub code: FaultCode,
    /// What was seen, in a few words.
    pub symptom: &'static str,
    /// What usually causes it.
    pub cause: &'static str,
    /// What to do.
    pub cure: &'static str,
}

impl FaultCode {
    /// The encoder did not answer three times in a row.
    pub const ENCODER_LOST: Self = Self(1);
    /// The encoder moved faster than the axis can.
    pub const ENCODER_JUMP: Self = Self(2);
    /// The encoder did not follow the steps.
    pub const FOLLOWING_ERROR: Self = Self(3);
    /// The target was not reached within the allowed corrections.
    pub const NOT_REACHED: Self = Self(4);
    /// The home switch was not found within the whole travel.
    pub const HOME_NOT_FOUND: Self = Self(5);
    /// The home switch still said home after backing off.
    pub const HOME_SWITCH_STUCK: Self = Self(6);
    /// The switch and the encoder disagree about where home is.
    pub const HOME_MISMATCH: Self = Self(7);
    /// No packet of the host came while the arm moved or was armed, for longer than the host watchdog
    /// allows.
    pub const HOST_WATCHDOG: Self = Self(8);
    /// The wired interlock or the emergency stop opened.
    pub const INTERLOCK_OPEN: Self = Self(9);
    /// Stored settings were damaged; defaults are in use.
    pub const SETTINGS_DAMAGED: Self = Self(10);
    /// Settings could not be written to the board's memory.
    pub const SETTINGS_NOT_SAVED: Self = Self(11);
    /// At rest, steps and encoder, both counted from home, differ by more than the step-loss limit.
    pub const STEP_LOSS: Self = Self(12);
    /// The home switch lets go again below home: it says home on more than one turn.
    pub const HOME_AMBIGUOUS: Self = Self(13);
    /// A motor's driver reports an alarm.
    pub const DRIVER_ALARM: Self = Self(14);

    /// A motor's driver that is set by wire does not answer, or by nonsense.
    pub const DRIVER_SILENT: Self = Self(15);
    /// A motor's driver does not hold what was written to it, or is another chip.
    pub const DRIVER_NOT_SET: Self = Self(16);
    /// A motor's driver has lost its settings.
    pub const DRIVER_RESET: Self = Self(17);
    /// A motor's driver has switched off because it is too hot.
    pub const DRIVER_TOO_HOT: Self = Self(18);
    /// A coil of a motor has a short.
    pub const DRIVER_SHORT: Self = Self(19);
    /// A motor's driver has too little voltage.
    pub const DRIVER_UNDERVOLTAGE: Self = Self(20);
    /// A coil of a motor draws no current.
    pub const MOTOR_OPEN: Self = Self(21);
    /// A warning: a motor's driver is warm.
    pub const DRIVER_WARM: Self = Self(22);
    /// A warning: an encoder is near its limits.
    pub const ENCODER_WARNING: Self = Self(23);
    /// An encoder says that its position is not valid.
    pub const ENCODER_INVALID: Self = Self(24);
    /// Both waves of a quadrature ring changed at once: an edge was lost, and with it the position.
    pub const EDGE_LOST: Self = Self(25);
    /// The index of a quadrature ring came at another count than before, or did not come.
    pub const INDEX_WRONG: Self = Self(26);
    /// Homing did not find the index of a quadrature ring.
    pub const INDEX_NOT_FOUND: Self = Self(27);

    /// Every fault and warning that exists, in the order of its number.
    pub const PAGES: [FaultPage; 27] = [
        page(
            Self::ENCODER_LOST,
            "encoder does not answer",
            "loose encoder cable, no supply",
            "check the encoder's plug, clear the fault, home",
        ),
        page(
            Self::ENCODER_JUMP,
            "encoder jumped",
            "interference on the encoder cable, dirt on the ring",
            "check the cable's screen, clean the ring, clear the fault, home",
        ),
        page(
            Self::FOLLOWING_ERROR,
            "arm does not follow the motor",
            "arm blocked, motor stalled, coupling slipping",
            "free the arm, clear the fault, home; lower the acceleration if it returns",
        ),
        page(
            Self::NOT_REACHED,
            "target not reached within the allowed corrections",
            "vibration, a loose gear, or an in-position window below what the encoder resolves",
            "remove the vibration, tighten the gear, or widen in_position_window; clear the fault",
        ),
        page(
            Self::HOME_NOT_FOUND,
            "home switch not found",
            "switch moved or its cable shorted (cut, where it is normally open), or arm blocked short of it",
            "check the switch's cable and the way to it, clear the fault, home",
        ),
        page(
            Self::HOME_SWITCH_STUCK,
            "home switch says home above it too",
            "switch jammed, its cable cut or unplugged (shorted, where it is normally open), or home_normally_closed not what the switch is",
            "free or replace the switch, check its cable and home_normally_closed, clear the fault, home",
        ),
        page(
            Self::HOME_MISMATCH,
            "home switch and encoder disagree",
            "switch moved, encoder zero not calibrated",
            "put the switch back or calibrate encoder_zero, clear the fault, home",
        ),
        page(
            Self::HOST_WATCHDOG,
            "host watchdog expired while moving or armed; arm stopped",
            "host busy, crashed or unplugged",
            "reconnect, clear the fault; no homing needed",
        ),
        page(
            Self::INTERLOCK_OPEN,
            "interlock or emergency stop open; arm stopped",
            "emergency stop pressed, door open, other arm in emergency stop",
            "make the rig safe, close the interlock, clear the fault, home",
        ),
        page(
            Self::SETTINGS_DAMAGED,
            "stored settings damaged; defaults in use",
            "power lost while saving, worn flash",
            "check every setting, save again, clear the fault",
        ),
        page(
            Self::SETTINGS_NOT_SAVED,
            "settings not saved",
            "flash write failed",
            "save again; replace the board if it returns",
        ),
        page(
            Self::STEP_LOSS,
            "steps and encoder differ at rest by more than step_loss_limit",
            "steps lost, gear slipped, more backlash than backlash_takeup, or an encoder that shifted or was never calibrated",
            "clear the fault, home: the switch shows which is right; if it returns, calibrate the encoder or raise backlash_takeup",
        ),
        page(
            Self::HOME_AMBIGUOUS,
            "home switch lets go below home, so that it does not show the turn",
            "a cam that works the switch once a turn, on an axis that travels a turn or more",
            "fit a switch that says home from there down, or lower soft_max until the travel from home_angle is shorter than a turn less home_probe; clear the fault, home",
        ),
        page(
            Self::DRIVER_ALARM,
            "motor's driver reports an alarm; brakes engaged, drivers switched off",
            "driver too hot, overcurrent, motor cable, supply missing; or the alarm's cable cut",
            "see what the driver shows, mend that, clear the fault, home",
        ),
        page(
            Self::DRIVER_SILENT,
            "motor's driver does not answer",
            "driver without supply, its wire cut or its jumper not set, driver_kind or driver_address not what is fitted",
            "check supply, wire, jumpers, driver_kind and driver_address; clear the fault, home",
        ),
        page(
            Self::DRIVER_NOT_SET,
            "motor's driver does not hold its settings",
            "interference on its wire, or another chip than driver_kind names",
            "check the wire, its ground and driver_kind; clear the fault, home",
        ),
        page(
            Self::DRIVER_RESET,
            "motor's driver has lost its settings",
            "its supply sagged or was switched off and on",
            "check the drivers' supply, clear the fault (the settings are written again), home",
        ),
        page(
            Self::DRIVER_TOO_HOT,
            "motor's driver has switched off, too hot",
            "run_current too high for its cooling, no air, or a short that heats it",
            "cool it, lower run_current and hold_current, clear the fault, home",
        ),
        page(
            Self::DRIVER_SHORT,
            "short at a motor's coil",
            "motor cable damaged, a coil shorted, a plug moved under power",
            "power off, check cable and motor, clear the fault, home",
        ),
        page(
            Self::DRIVER_UNDERVOLTAGE,
            "motor's driver has too little voltage",
            "supply too weak, or switched off",
            "check the drivers' supply, clear the fault, home",
        ),
        page(
            Self::MOTOR_OPEN,
            "a motor's coil draws no current",
            "motor unplugged, a wire or a coil broken",
            "check plug, cable and motor with the power off, clear the fault, home",
        ),
        page(
            Self::DRIVER_WARM,
            "motor's driver above 120 °C",
            "run_current or hold_current high for its cooling, no air",
            "give it air, or lower run_current and hold_current, before it switches off",
        ),
        page(
            Self::ENCODER_WARNING,
            "encoder warns that it is near its limits",
            "dirt on the ring, distance or temperature near what it allows",
            "clean the ring, check its distance and temperature at the next stop",
        ),
        page(
            Self::ENCODER_INVALID,
            "encoder says that its position is not valid",
            "ring dirty, too far or too near, too fast or too hot",
            "clean the ring, check its distance, clear the fault, home",
        ),
        page(
            Self::EDGE_LOST,
            "encoder has lost an edge, and the position with it",
            "interference on its cable, or the shaft was turned faster than max_speed",
            "check the cable's screen and the receiver, clear the fault, home",
        ),
        page(
            Self::INDEX_WRONG,
            "encoder's index did not come at its count",
            "its wire broken, encoder_counts_per_turn not what the ring has, counts lost to interference",
            "check the index's wire, the cable's screen and encoder_counts_per_turn; clear the fault, home",
        ),
        page(
            Self::INDEX_NOT_FOUND,
            "encoder's index not found between home and soft_max",
            "its wire broken, or a ring fitted so that the index lies beyond the travel",
            "check the index's wire, or turn the ring on its shaft; clear the fault, home",
        ),
    ];

    /// The page of this fault, if this build knows it.
    pub fn page(self) -> Option<&'static FaultPage> {
        Self::PAGES.iter().find(|page| page.code == self)
    }

    /// Whether this is only a warning: it is reported and logged, and the arm goes on.
    pub fn is_warning(self) -> bool {
        matches!(self, Self::DRIVER_WARM | Self::ENCODER_WARNING)
    }

    /// Whether a driver that is set by wire is at fault, so that its current is switched off.
    pub fn is_of_driver(self) -> bool {
        matches!(
            self,
            Self::DRIVER_SILENT
                | Self::DRIVER_NOT_SET
                | Self::DRIVER_RESET
                | Self::DRIVER_TOO_HOT
                | Self::DRIVER_SHORT
                | Self::DRIVER_UNDERVOLTAGE
                | Self::MOTOR_OPEN
        )
    }

    /// Whether the position is no longer trusted after this fault, so that the arm must be homed.
    pub fn loses_home(self) -> bool {
        !matches!(
            self,
            Self::NOT_REACHED
                | Self::HOST_WATCHDOG
                | Self::SETTINGS_DAMAGED
                | Self::SETTINGS_NOT_SAVED
                | Self::DRIVER_WARM
                | Self::ENCODER_WARNING
        )
    }
}

impl core::fmt::Display for FaultCode {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.page() {
            Some(page) => {
                let what = if self.is_warning() {
                    "warning"
                } else {
                    "fault"
                };
                write!(f, "{what} {}: {}; {}", self.0, page.symptom, page.cure)
            }
            None => write!(f, "fault {}, unknown to this host; update it", self.0),
        }
    }
}

const fn page(
    code: FaultCode,
    symptom: &'static str,
    cause: &'static str,
    cure: &'static str,
) -> FaultPage {
    FaultPage {
        code,
        symptom,
        cause,
        cure,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_its_own_number_and_page() {
        for (i, page) in FaultCode::PAGES.iter().enumerate() {
            assert_eq!(page.code.0 as usize, i + 1);
            assert_eq!(page.code.page(), Some(page));
        }
        assert_eq!(FaultCode(999).page(), None);
    }
}
