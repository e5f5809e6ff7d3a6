//! The simulated rig: plant and wire of the two controllers, and the scene that the camera sees.
//!
//! | room | subject |
//! |---|---|
//! | [`plant`] | motor, gear, shaft, encoder and switch of one axis (`no_std`) |
//! | [`swing`] | how an arm swings on its gear (`no_std`) |
//! | [`driver_chip`] | a motor's driver that is set by wire (`no_std`) |
//! | [`arm`] | the arm: two such axes behind the firmware's hardware trait (`no_std`) |
//! | [`fault`], [`random_faults`] | what may go wrong, as data; random fault plans by a seed |
//! | [`wire`] | bytes under way between host and controller |
//! | [`record`] | what happened and when: pulses, stops |
//! | [`rig`] | two real controllers on their plants, in virtual time |
//! | [`scene`] | what the camera sees |
#![cfg_attr(not(feature = "std"), no_std)]

pub mod arm;
pub mod driver_chip;
pub mod plant;
pub mod quadrature;
pub mod swing;

/// The steps of a run, as the controllers give them.
pub use gonia_firmware::profile;

#[cfg(feature = "std")]
pub mod fault;
#[cfg(feature = "std")]
pub mod random_faults;
#[cfg(feature = "std")]
pub mod record;
#[cfg(feature = "std")]
pub mod rig;
#[cfg(feature = "std")]
pub mod scene;
#[cfg(feature = "std")]
pub mod wire;
#[cfg(feature = "std")]
mod world;

#[cfg(test)]
mod controller_tests;
