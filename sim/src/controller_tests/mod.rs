//! The firmware's core on a simulated arm, without the wire.

mod drivers;
mod encoders;
mod homing;
mod quadrature;
mod safety;

use gonia_firmware::controller::{Answer, ArmController};
use gonia_protocol::message::{ControllerState, Message, RequestOutcome, Setting};
use gonia_protocol::settings::{Axis, Key};

use crate::arm::SimulatedArm;
use crate::plant::PlantConfig;

const MINUTE_US: u64 = 60_000_000;

/// A controller that has started, and its arm.
struct TestBench {
    controller: ArmController,
    arm: SimulatedArm,
    now_us: u64,
    request: u16,
    host_is_there: bool,
    /// φ's lowest angle so far, degrees.
    lowest_phi_deg: f64,
}

impl TestBench {
    /// θ near its home switch, and this φ.
    fn new(phi: PlantConfig) -> Self {
        Self::with_arm([PlantConfig::worm_axis(-5e6, 3e6), phi])
    }

    fn with_arm(axes: [PlantConfig; 2]) -> Self {
        let mut bench = Self {
            controller: ArmController::new(0, None),
            arm: SimulatedArm::new(axes, 3),
            now_us: 0,
            request: 0,
            host_is_there: true,
            lowest_phi_deg: f64::MAX,
        };
        bench.run_us(1);
        bench
    }

    /// The default φ, near its home switch.
    fn near_home() -> Self {
        Self::new(PlantConfig::worm_axis(-190e6, -170e6))
    }

    /// One control tick or so. Returns how the request under way ended, if it did.
    fn tick(&mut self) -> Option<RequestOutcome> {
        self.now_us = self.controller.wake_us().max(self.now_us);
        self.arm.set_now(self.now_us);
        if self.host_is_there {
            self.controller.restart_host_watchdog(self.now_us);
        }
        self.controller.poll(self.now_us, &mut self.arm);
        self.lowest_phi_deg = self.arm.true_deg(self.now_us)[1].min(self.lowest_phi_deg);
        let mut outcome = None;
        while let Some(event) = self.controller.take_event() {
            if let Message::Completed(end) = event {
                outcome = Some(end.outcome);
            }
        }
        outcome
    }

    fn run_us(&mut self, us: u64) {
        let until_us = self.now_us + us;
        while self.now_us < until_us {
            self.tick();
        }
    }

    fn ask(&mut self, message: &Message) -> Answer {
        self.request += 1;
        let (now_us, request) = (self.now_us, self.request);
        self.controller
            .execute(now_us, request, message, &mut self.arm)
    }

    fn set(&mut self, axis: Axis, key: Key, value: i32) {
        let key = key.number();
        let setting = Message::SetSetting(Setting { axis, key, value });
        assert!(matches!(self.ask(&setting), Ok(Message::SettingIs(_))));
    }

    /// How the request under way ends.
    fn outcome(&mut self) -> RequestOutcome {
        let until_us = self.now_us + 5 * MINUTE_US;
        while self.now_us < until_us {
            if let Some(outcome) = self.tick() {
                return outcome;
            }
        }
        panic!("not ended; {:?}", self.controller.state());
    }

    fn home(&mut self) -> RequestOutcome {
        assert_eq!(self.ask(&Message::Home), Ok(Message::Accepted));
        self.outcome()
    }

    fn state(&self) -> ControllerState {
        self.controller.state()
    }

    fn phi_deg(&self) -> f64 {
        self.arm.true_deg(self.now_us)[1]
    }
}
