//! Fault codes. A number, once given, keeps its meaning for ever.

use serde::{Deserialize, Serialize};

/// A latched fault. A number rather than an enum, so that a host can show the code of a
/// newer firmware.
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

    /// Every fault that exists, in the order of its number.
    pub const PAGES: [FaultPage; 14] = [
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
    ];

    /// The page of this fault, if this build knows it.
    pub fn page(self) -> Option<&'static FaultPage> {
        Self::PAGES.iter().find(|page| page.code == self)
    }

    /// Whether the position is no longer trusted after this fault, so that the arm must be homed.
    pub fn loses_home(self) -> bool {
        !matches!(
            self,
            Self::NOT_REACHED
                | Self::HOST_WATCHDOG
                | Self::SETTINGS_DAMAGED
                | Self::SETTINGS_NOT_SAVED
        )
    }
}

impl core::fmt::Display for FaultCode {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.page() {
            Some(page) => write!(f, "fault {}: {}; {}", self.0, page.symptom, page.cure),
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
