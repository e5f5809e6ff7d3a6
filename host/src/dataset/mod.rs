//! Files: rigs, capture folders, samples, dense BRDFs.

pub mod frame;
pub mod rig;

pub use frame::Frame;
pub use rig::Rig;
