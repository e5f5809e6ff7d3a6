//! Two real controllers on their plants, in virtual time.
//!
//! Time passes only while a port waits for bytes; both arms run on together whichever port waits.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use gonia_brdf::direction::Pose;

use crate::arm::SimulatedArm;
use crate::fault::{Arm, FaultPlan};
use crate::record::{StopRecord, TriggerRecord};
use crate::world::World;

/// The simulated rig. Clones are the same rig.
#[derive(Clone, Debug)]
pub struct SimRig {
    world: Arc<Mutex<World>>,
}

impl SimRig {
    /// A rig of default arms. The same seed and plan give the same bytes.
    pub fn new(seed: u64, faults: FaultPlan) -> Self {
        let light = SimulatedArm::default_arm(seed.wrapping_mul(4).wrapping_add(1));
        let camera = SimulatedArm::default_arm(seed.wrapping_mul(4).wrapping_add(2));
        Self::with_arms(seed, faults, [light, camera])
    }

    /// A rig of other arms: light, camera.
    pub fn with_arms(seed: u64, faults: FaultPlan, arms: [SimulatedArm; 2]) -> Self {
        Self {
            world: Arc::new(Mutex::new(World::new(seed, faults, arms))),
        }
    }

    /// The host's end of an arm's wire.
    pub fn port(&self, arm: Arm) -> SimPort {
        SimPort {
            world: Arc::clone(&self.world),
            arm,
        }
    }

    /// Virtual time, µs.
    pub fn now_us(&self) -> u64 {
        lock(&self.world).now_us()
    }

    /// Where the arms truly were at the last trigger pulse.
    pub fn true_pose_at_last_trigger(&self) -> Option<Pose> {
        lock(&self.world).triggers().last().map(TriggerRecord::pose)
    }

    /// How many trigger pulses there were so far.
    pub fn trigger_count(&self) -> usize {
        lock(&self.world).triggers().len()
    }

    /// Every trigger pulse so far.
    pub fn triggers(&self) -> Vec<TriggerRecord> {
        lock(&self.world).triggers().to_vec()
    }

    /// Every time that an arm came to rest latched or by a restart, so far.
    pub fn stops(&self) -> Vec<StopRecord> {
        lock(&self.world).stops().to_vec()
    }

    /// The true angles of an arm now, degrees.
    pub fn true_deg(&self, arm: Arm) -> [f64; 2] {
        let mut world = lock(&self.world);
        let now_us = world.now_us();
        world.hardware(arm).true_deg(now_us)
    }

    /// A hash of every byte that the controllers have sent: equal for equal runs.
    pub fn trace(&self) -> u64 {
        lock(&self.world).trace()
    }
}

/// The host's end of one wire.
#[derive(Debug)]
pub struct SimPort {
    world: Arc<Mutex<World>>,
    arm: Arm,
}

impl SimPort {
    /// Sends bytes to the controller.
    pub fn send(&self, bytes: &[u8]) {
        lock(&self.world).send(self.arm, bytes);
    }

    /// Lets virtual time pass until bytes arrive, or for `timeout_us`; appends what arrived.
    pub fn receive(&self, out: &mut Vec<u8>, timeout_us: u64) {
        let mut world = lock(&self.world);
        let deadline = world.now_us() + timeout_us;
        world.receive(self.arm, out, deadline);
    }

    /// Virtual time, µs.
    pub fn now_us(&self) -> u64 {
        lock(&self.world).now_us()
    }
}

/// A thread that panicked elsewhere does not make the rig unusable.
fn lock(world: &Mutex<World>) -> MutexGuard<'_, World> {
    world.lock().unwrap_or_else(PoisonError::into_inner)
}
