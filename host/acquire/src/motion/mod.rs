//! Speed against accuracy of the arms: sessions on the simulated rig with one setting changed at a
//! time, and what a limit of jerk would bring; and how its encoders are calibrated.

mod arms;
mod chart;
mod encoders;
mod jerk;
pub mod sessions;

pub use arms::{ArmRow, arm_rows};
pub use chart::motion_chart;
pub use encoders::calibrate_encoders;
pub use jerk::{JerkRow, jerk_rows};
pub use sessions::{Factor, MotionRow, motion_rows};
