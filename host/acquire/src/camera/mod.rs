//! Cameras, and the simulated rig that one of them stands on.

pub mod command;
mod files;
pub mod folder;
#[cfg(feature = "genicam")]
pub mod genicam;
pub mod matching;
pub mod rendering;
pub mod simulated;
#[cfg(feature = "genicam")]
pub mod simulated_gige;
mod simulated_port;
pub mod source;

pub use command::CommandCamera;
pub use folder::FolderCamera;
#[cfg(feature = "genicam")]
pub use genicam::GenicamCamera;
pub use rendering::RenderingCamera;
pub use simulated::SimulatedCamera;
#[cfg(feature = "genicam")]
pub use simulated_gige::SimulatedGige;
pub use source::{Camera, CameraError, Pulse};
