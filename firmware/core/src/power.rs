//! The motors' current and the brakes: which of the two goes first.
//!
//! A brake is engaged without power and holds an arm whose motors have none. So it is let go only when the
//! drivers have had their current for a while, and the drivers keep theirs until it has engaged: a brake takes
//! some 50 ms either way. A step against a brake is lost, so nothing moves before it has let go.

use crate::hardware::Hardware;

/// What the state of the controller asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerDemand {
    /// Drivers on, brakes let go.
    Run,
    /// Brakes engaged, drivers as they are: something else may take their current away.
    Brake,
    /// Brakes engaged, then drivers off.
    Off,
}

/// Drivers and brakes of one arm, which are off and engaged after a reset.
#[derive(Debug, Default)]
pub struct Power {
    has_current: bool,
    is_released: bool,
    /// What was switched last has had its effect, µs.
    settled_us: u64,
}

impl Power {
    /// Switches what is due.
    pub fn tick(
        &mut self,
        now_us: u64,
        demand: PowerDemand,
        brake_us: u64,
        hardware: &mut impl Hardware,
    ) {
        if demand != PowerDemand::Run && self.is_released {
            hardware.release_brakes(false);
            self.is_released = false;
            self.settled_us = now_us + brake_us;
        }
        while now_us >= self.settled_us {
            match demand {
                PowerDemand::Run if !self.has_current => self.switch(true, hardware),
                PowerDemand::Run if !self.is_released => {
                    hardware.release_brakes(true);
                    self.is_released = true;
                }
                PowerDemand::Off if self.has_current => self.switch(false, hardware),
                _ => return,
            }
            self.settled_us = now_us + brake_us;
        }
    }

    /// What keeps drivers and brakes as they are.
    pub fn as_it_is(&self) -> PowerDemand {
        match (self.has_current, self.is_released) {
            (false, _) => PowerDemand::Off,
            (true, false) => PowerDemand::Brake,
            (true, true) => PowerDemand::Run,
        }
    }

    /// Whether the motors hold the arm and may turn it.
    pub fn is_ready(&self, now_us: u64) -> bool {
        self.is_released && now_us >= self.settled_us
    }

    fn switch(&mut self, on: bool, hardware: &mut impl Hardware) {
        hardware.switch_drivers(on);
        self.has_current = on;
    }
}
