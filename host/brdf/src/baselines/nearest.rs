//! The value of the nearest bin.

use super::{Failure, Interpolant, Neighbourhood, System};

/// Takes the nearest value as it is.
pub struct Nearest;

impl Interpolant for Nearest {
    fn estimate(&self, near: &Neighbourhood, _: &mut System) -> Result<[f64; 3], Failure> {
        near.values
            .first()
            .copied()
            .ok_or(Failure::TooFew { have: 0, need: 1 })
    }
}
