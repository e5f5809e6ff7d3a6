//! gonia on the host: from poses to a dense BRDF.
//!
//! Data flows one way: `plan → poses → [link → arms] → frames → registration → samples →
//! compensation → bins → interpolation → dense BRDF → EXR, pictures, report`.
pub mod camera;
pub mod capture;
pub mod cli;
pub mod dataset;
pub mod evaluate;
pub mod hdr;
pub mod link;
pub mod live;
pub mod plan;
pub mod process;
pub mod report;
pub mod session;
pub mod vision;
