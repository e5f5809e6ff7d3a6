//! Whole-system tests live in `tests/`; here is what several of them need.
//!
//! | room | subject |
//! |---|---|
//! | [`poses`] | lists of poses, and how far an arm truly was from one |
//! | [`calibrated`] | a rig whose encoders sit off their axes and were calibrated on a test bench |
//! | [`random`] | numbers that look random and are the same every time |
#![allow(clippy::unwrap_used)]

pub mod calibrated;
pub mod poses;
pub mod random;
