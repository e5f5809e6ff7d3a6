//! The arm controller's logic: no hardware, no clock of its own, no allocation.
//!
//! Bytes go in through [`node::ControllerNode::receive`], time through [`node::ControllerNode::poll`]; pins, encoders
//! and flash are behind [`hardware::Hardware`]. The same code runs on a board and in the simulator.
//!
//! | room | subject |
//! |---|---|
//! | [`node`] | the wire's end: packets to commands, answers and events to packets |
//! | [`controller`] | the states and their one owner |
//! | [`axis`] | one axis: steps, encoder, segments of a move |
//! | [`profile`], [`steps`] | when the next step is due; from the main loop to the timer that gives it |
//! | [`homing`], [`settling`], [`train`] | how one axis finds home; how one axis comes to rest; trigger pulses |
//! | [`driver`], [`single_wire`] | motors' drivers that are set by wire, and watched; a UART on one plain pin |
//! | [`power`] | motors' current and brakes: which goes first |
//! | [`error_map`] | what the encoder reads wrong over a turn, and its removal |
//! | [`settings`], [`store`] | values of the settings; two sectors of flash that keep them |
//! | [`board`] | the main loop of every board, and what a board gives it |
//! | [`hardware`] | what a board must offer |
//! | [`spi_encoder`] ([`ssi`], [`biss`]) | an absolute encoder over `embedded-hal`; what its words say |
//! | [`clock`] | a board's counter made one of 64 bits, and its alarm |
#![no_std]

pub mod axis;
pub mod biss;
pub mod board;
pub mod clock;
pub mod controller;
pub mod driver;
pub mod error_map;
pub mod hardware;
pub mod homing;
pub mod node;
pub mod power;
pub mod profile;
pub mod quadrature;
pub mod settings;
pub mod settling;
pub mod single_wire;
pub mod spi_encoder;
pub mod ssi;
pub mod steps;
pub mod store;
pub mod train;

/// Version of this firmware: major, minor, patch.
pub const VERSION: [u8; 3] = [
    number(env!("CARGO_PKG_VERSION_MAJOR")),
    number(env!("CARGO_PKG_VERSION_MINOR")),
    number(env!("CARGO_PKG_VERSION_PATCH")),
];

/// State of the sources that this was built from, from `GONIA_GIT` at build time.
pub fn git_state() -> heapless::String<16> {
    let state = option_env!("GONIA_GIT").unwrap_or("unknown");
    state.chars().take(16).filter(char::is_ascii).collect()
}

const fn number(digits: &str) -> u8 {
    let (digits, mut value, mut i) = (digits.as_bytes(), 0, 0);
    while i < digits.len() {
        value = value * 10 + (digits[i] - b'0');
        i += 1;
    }
    value
}
