//! The simulated rig: plant and wire of the two controllers, and the scene that the camera sees.
pub mod scene;
