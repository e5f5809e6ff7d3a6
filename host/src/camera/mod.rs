//! Cameras, and the simulated rig that one of them stands on.

pub mod simulated;
mod simulated_port;

pub use simulated::SimulatedCamera;
