//! One cell at a time, from the bins nearest to it: the paper's method, and others to compare.
//!
//! A [`Predictor`] finds the nearest bins of a place, and an [`Interpolant`] makes one value of
//! them; what they are to do stands in [`CellSettings`], and has a name. [`fill()`] does it for the
//! whole grid.
//!
//! The paper (Section IV): localized radial basis functions through the 200 nearest samples, then
//! the mean of reciprocal values. The default of the program is [`crate::interpolate`]; this is what
//! it is measured by.

mod fill;
mod kernel;
mod moving_least_squares;
mod nearest;
mod neighbours;
mod predict;
mod rbf;
#[cfg(test)]
mod scipy_tests;
mod settings;
mod shepard;
mod space;
mod system;

pub use fill::{CellFill, CellFiller, Tally, fill, n_interpolated};
pub use kernel::Kernel;
pub use neighbours::Neighbourhood;
pub use predict::{Predictor, Workspace};
pub use settings::{CellSettings, Places, Rule, SettingsError, Values};
pub use space::Space;
pub use system::System;

/// Makes one value of the known values around a place.
pub trait Interpolant: Send + Sync {
    /// The value per channel at the place that all offsets in `near` are counted from.
    ///
    /// # Errors
    /// Too few neighbours, or a system of equations without a solution.
    fn estimate(&self, near: &Neighbourhood, system: &mut System) -> Result<[f64; 3], Failure>;
}

/// Why a cell has no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// Fewer neighbours than unknowns.
    #[error("{have} neighbours, and at least {need} are needed")]
    TooFew {
        /// Neighbours found.
        have: usize,
        /// Neighbours needed.
        need: usize,
    },
    /// The matrix is singular within the precision of its numbers.
    #[error("the system of equations is singular")]
    Singular,
    /// The solution overflowed.
    #[error("the value is not finite")]
    NotFinite,
}
