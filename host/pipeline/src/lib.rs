//! Frames → samples → dense BRDF → figures: the public library.

mod accumulate;
pub mod bracket;
pub mod chart;
pub mod compare;
pub mod process;
pub mod rivals;

pub use compare::{CompareError, Options, Side, compare};
