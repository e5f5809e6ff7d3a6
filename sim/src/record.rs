//! What happened on the simulated rig and when: trigger pulses, and arms that came to rest.

use gonia_brdf::direction::{Direction, Pose};
use gonia_protocol::message::ControllerState;

use crate::fault::Arm;

/// A trigger pulse, and where the shafts truly were at its rising edge. Only the simulated camera
/// may look at this; the host sees encoders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriggerRecord {
    /// Counts pulses of both arms, from 0.
    pub sequence: u32,
    /// Virtual time, µs.
    pub time_us: u64,
    /// How long it was, µs; `None` while it lasts.
    pub width_us: Option<u64>,
    /// The arm that gave it.
    pub source: Arm,
    /// True θ and φ of the light arm, degrees.
    pub light_deg: [f64; 2],
    /// True θ and φ of the camera arm, degrees.
    pub camera_deg: [f64; 2],
}

impl TriggerRecord {
    /// The true pose.
    pub fn pose(&self) -> Pose {
        let direction = |[theta, phi]: [f64; 2]| Direction::from_deg(theta, phi);
        Pose {
            light: direction(self.light_deg),
            view: direction(self.camera_deg),
        }
    }
}

/// An arm with a latched fault, or whose controller has restarted, has come to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StopRecord {
    /// Virtual time of its last step or of its latched fault, whichever came later, µs.
    pub time_us: u64,
    /// Which arm.
    pub arm: Arm,
    /// The state it is in; `Boot` after a restart.
    pub state: ControllerState,
}
