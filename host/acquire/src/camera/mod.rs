//! Cameras. A session needs a [`Camera`], whatever it is; [`open_camera`] makes the one that `rig.toml`
//! names, and a camera of one's own implements the trait.
//!
//! | module | holds |
//! |---|---|
//! | `source` | the trait [`Camera`], a [`Pulse`], and what can go wrong |
//! | `open` | [`open_camera`]: from a rig's source to a camera |
//! | `folder` | frames that another program leaves in a folder |
//! | `command` | a program that is run for each frame |
//! | `genicam` | GigE Vision cameras, with the feature `genicam` |
//! | `natural_order` | files in the order of their counters |
//! | `matching` | whether frames are those of the trigger pulses, by number and time |
//! | `rendering` | the camera of the simulated rig |
//! | `simulated_frames` | frames of the simulated rig without a session |

pub mod command;
mod files;
pub mod folder;
#[cfg(feature = "genicam")]
pub mod genicam;
pub mod matching;
mod natural_order;
mod open;
pub mod rendering;
pub mod simulated_frames;
#[cfg(feature = "genicam")]
pub mod simulated_gige;
pub mod source;

pub use command::CommandCamera;
pub use folder::FolderCamera;
#[cfg(feature = "genicam")]
pub use genicam::GenicamCamera;
pub use open::{CameraSetup, open_camera};
pub use rendering::RenderingCamera;
pub use simulated_frames::SimulatedFrames;
#[cfg(feature = "genicam")]
pub use simulated_gige::SimulatedGige;
pub use source::{Camera, CameraError, Pulse};
