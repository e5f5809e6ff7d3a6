//! What can go wrong between host and controller, each in one line.

use gonia_protocol::message::RequestRefusal;

/// Why a request failed.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The port cannot be used.
    #[error("{arm}: the port failed: {source}; check the cable and that nobody else uses it")]
    Port {
        /// Which controller.
        arm: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// Nobody answers.
    #[error("{arm}: no answer to {what}; check power, cable and port")]
    NoAnswer {
        /// Which controller.
        arm: String,
        /// What was asked.
        what: &'static str,
    },
    /// What is sent comes back.
    #[error(
        "{arm}: what is sent comes back: an echo, and no controller; check that RX and TX are not joined, and that the port is the right one"
    )]
    Echo {
        /// Which controller.
        arm: String,
    },
    /// Something else is at the other end.
    #[error(
        "{arm}: something else answers (\"{said}\"), and no controller; check that the port is the right one, and its baud rate"
    )]
    Foreign {
        /// Which controller.
        arm: String,
        /// Its first words.
        said: String,
    },
    /// Both ports lead to the same arm.
    #[error(
        "both ports lead to the {arm}'s controller: set the jumper of the other board (docs/src/guides/arms.md), or give the other port"
    )]
    SameArm {
        /// Which.
        arm: String,
    },
    /// The controller speaks another protocol.
    #[error(
        "{arm}: its firmware {firmware} speaks protocol {theirs}, this host {ours}; update the older one"
    )]
    Version {
        /// Which controller.
        arm: String,
        /// Its firmware.
        firmware: String,
        /// Its protocol and schema.
        theirs: String,
        /// Ours.
        ours: String,
    },
    /// The controller said no.
    #[error("{arm}: {what} refused: {refusal}")]
    Refused {
        /// Which controller.
        arm: String,
        /// What was asked.
        what: &'static str,
        /// Why not.
        refusal: RequestRefusal,
    },
    /// The answer makes no sense.
    #[error("{arm}: the answer to {what} is of another kind; update the firmware")]
    Confused {
        /// Which controller.
        arm: String,
        /// What was asked.
        what: &'static str,
    },
    /// Something accepted does not end.
    #[error("{arm}: {what} did not end within {limit_s:.1} s; stop the arm and look at it")]
    Endless {
        /// Which controller.
        arm: String,
        /// What was asked.
        what: &'static str,
        /// How long it was waited for.
        limit_s: f64,
    },
}
