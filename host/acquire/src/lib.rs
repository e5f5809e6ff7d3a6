//! A session at the rig: the host's end of the wire, cameras, and what is measured when.

pub mod camera;
pub mod capture;
pub mod link;
pub mod motion;
pub mod session;
