//! Cameras.

pub mod simulated;

pub use simulated::SimulatedCamera;
