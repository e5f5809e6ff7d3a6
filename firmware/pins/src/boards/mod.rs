//! The boards, one file each.

mod btt_octopus;
mod nucleo_f446re;

pub use btt_octopus::BTT_OCTOPUS;
pub use nucleo_f446re::NUCLEO_F446RE;

use crate::Board;

/// Every board that one flashes.
pub const BOARDS: &[&Board] = &[&BTT_OCTOPUS, &NUCLEO_F446RE];

/// A board by its name.
pub fn named(name: &str) -> Option<&'static Board> {
    BOARDS.iter().copied().find(|board| board.name == name)
}
