//! The host's end of the wire.
//!
//! [`Transport`] moves bytes, in real or in virtual time; [`RemoteController`] is one arm's controller as
//! the host knows it. The protocol itself is `gonia-protocol`'s.

mod calibrate;
mod controller;
mod error;
mod error_map;
mod gear_map;
mod simulated_port;
mod stream;
mod transport;

pub use calibrate::{CalibrateError, EncoderCalibration, calibrate_axis, is_uncalibrated};
pub use controller::{HEARTBEAT_US, RemoteController, Ticket};
pub use error::LinkError;
pub use error_map::{ErrorMapFit, MapFitError, Reading, fit_error_map};
pub use gear_map::{GearMapFit, GearReading, fit_gear_map};
pub use stream::StreamTransport;
pub use transport::Transport;

pub use gonia_protocol as protocol;
