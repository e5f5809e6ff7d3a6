//! Baselines: the paper's method and other known ones, which interpolate one cell at a time from the bins
//! nearest to it.
//!
//! A [`Predictor`] finds the nearest bins of a place, and an [`Interpolant`] makes one value of
//! them; [`BaselineSettings`] say how, and have a name. [`fill()`] does it for the
//! whole grid.
//!
//! The paper (Section IV): localized radial basis functions through the 200 nearest samples, then
//! the mean of reciprocal values. The default of the program is [`crate::interpolate`]; this is what
//! it is measured by.

mod basis;
mod bin_tree;
mod fill;
mod moving_least_squares;
mod nearest;
mod predict;
mod rbf;
mod settings;
mod shepard;
mod space;
mod system;

pub use basis::BasisFunction;
pub use bin_tree::Neighbourhood;
pub use fill::{BaselineFill, BaselineFiller, Tally, fill, n_interpolated};
pub use predict::{Predictor, Workspace};
pub use settings::{BaselineSettings, Places, Rule, Transform, UnknownBaseline};
pub use space::Space;
pub use system::System;

/// Makes one value of the bins around a place.
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
        /// BinTree found.
        have: usize,
        /// BinTree needed.
        need: usize,
    },
    /// The matrix is singular within the precision of its numbers.
    #[error("the system of equations is singular")]
    Singular,
    /// The solution overflowed.
    #[error("the value is not finite")]
    NotFinite,
}
