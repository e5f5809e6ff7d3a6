//! A session at the rig: the arms' controllers, cameras, what is measured when, and the session's folder.
//!
//! | module | holds |
//! |---|---|
//! | [`link`] | the host's end of the wire: a controller behind a serial port, its calibration |
//! | [`camera`] | the trait [`camera::Camera`], the cameras there are, and the simulated one |
//! | [`capture`] | a session: arms and camera together, pose by pose, with recovery and control poses |
//! | [`session`] | the folder that a session writes, reads and verifies |
//! | [`motion`] | the arms' speed against their accuracy, on the simulated rig |
//!
//! `examples/own_camera.rs` is a whole session with a camera of one's own.

pub mod camera;
pub mod capture;
pub mod link;
pub mod motion;
mod program;
pub mod session;

pub use program::ProgramError;
