//! The host's end of the wire.
//!
//! [`Transport`] moves bytes, in real or in virtual time; [`Controller`] is one arm's controller as
//! the host knows it. The protocol itself is `gonia-protocol`'s.

mod controller;
mod error;
mod stream;
mod transport;

pub use controller::{Controller, HEARTBEAT_US, Ticket};
pub use error::LinkError;
pub use stream::StreamTransport;
pub use transport::Transport;

pub use gonia_protocol as protocol;
