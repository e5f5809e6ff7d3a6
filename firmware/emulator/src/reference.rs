//! The simulator's arm with the firmware's core: what the same requests do without a chip.

use anyhow::{Result, bail};
use gonia_firmware::controller::ArmController;
use gonia_firmware::hardware::Hardware;
use gonia_protocol::message::{Message, RequestOutcome};
use gonia_protocol::settings::Axis;
use gonia_sim::arm::SimulatedArm;

/// The core in virtual time.
pub struct Reference {
    controller: ArmController,
    arm: SimulatedArm,
    now_us: u64,
    request: u16,
}

impl Reference {
    /// The same arm as on the chip's pins.
    pub fn new() -> Self {
        Self {
            controller: ArmController::new(0, None),
            arm: SimulatedArm::quiet_arm_near_home(),
            now_us: 0,
            request: 0,
        }
    }

    /// Does it and waits until it is done. Returns the steps given so far, up minus down.
    pub fn complete(&mut self, message: &Message) -> Result<[i64; 2]> {
        self.run_until(self.now_us + 100_000);
        self.request += 1;
        let answer = self
            .controller
            .execute(self.now_us, self.request, message, &mut self.arm);
        if answer != Ok(Message::Accepted) {
            bail!("the simulator answered {message:?} by {answer:?}");
        }
        for _ in 0..1_000_000 {
            self.run_until(self.now_us.max(self.controller.wake_us()));
            self.controller.restart_host_watchdog(self.now_us);
            while let Some(event) = self.controller.take_event() {
                match event {
                    Message::Completed(end) if end.outcome == RequestOutcome::Done => {
                        return Ok(Axis::BOTH.map(|axis| i64::from(self.arm.progress(axis).given)));
                    }
                    Message::Completed(end) => bail!("the simulator ended as {:?}", end.outcome),
                    _ => {}
                }
            }
        }
        bail!("the simulator has not ended")
    }

    fn run_until(&mut self, until_us: u64) {
        while self.controller.wake_us() <= until_us {
            self.now_us = self.controller.wake_us().max(self.now_us);
            self.arm.set_now(self.now_us);
            self.controller.poll(self.now_us, &mut self.arm);
        }
        self.now_us = until_us;
        self.arm.set_now(self.now_us);
    }
}
