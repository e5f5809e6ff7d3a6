//! Speed against accuracy of the arms: sessions on the simulated rig with one setting changed at a
//! time, and what a limit of jerk would bring.

pub mod jerk;
pub mod sessions;

pub use jerk::{JerkRow, jerk_rows};
pub use sessions::{Factor, MotionRow, motion_rows};
