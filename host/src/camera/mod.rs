//! Cameras, and the simulated rig that one of them stands on.

pub mod command;
mod files;
pub mod folder;
pub mod rendering;
pub mod simulated;
mod simulated_port;
pub mod source;

pub use command::CommandCamera;
pub use folder::FolderCamera;
pub use rendering::RenderingCamera;
pub use simulated::SimulatedCamera;
pub use source::{Camera, CameraError};
