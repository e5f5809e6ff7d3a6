//! Shepard's method (1968): a mean weighted by inverse distance.

use super::{Failure, Interpolant, Neighbourhood, System};
use crate::elementary::Elementary;

/// Mean with the weights r^−power.
pub struct Shepard {
    /// How fast the weight falls.
    pub power: f64,
}

impl Interpolant for Shepard {
    fn estimate(&self, near: &Neighbourhood, _: &mut System) -> Result<[f64; 3], Failure> {
        let (Some(first), Some(nearest)) = (near.values.first(), near.distances.first()) else {
            return Err(Failure::TooFew { have: 0, need: 1 });
        };
        if *nearest == 0.0 {
            return Ok(*first);
        }
        let mut sum = [0.0; 3];
        let mut total = 0.0;
        for (value, distance) in near.values.iter().zip(&near.distances) {
            // Relative to the nearest one, so that no power can overflow.
            let weight = (nearest / distance).power(self.power);
            total += weight;
            for c in 0..3 {
                sum[c] += weight * value[c];
            }
        }
        Ok(sum.map(|s| s / total))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_inverse_distances() {
        let mut near = Neighbourhood::default();
        near.push([3.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 8.0]);
        near.push([0.0, 6.0, 0.0, 0.0, 0.0, 0.0], [6.0, 5.0, 8.0]);
        let shepard = Shepard { power: 2.0 };
        let got = shepard.estimate(&near, &mut System::default());
        assert_eq!(got, Ok([2.0, 1.0, 8.0]));
        let mut at = Neighbourhood::default();
        at.push([0.0; 6], [7.0; 3]);
        at.push([1.0; 6], [1.0; 3]);
        assert_eq!(
            shepard.estimate(&at, &mut System::default()),
            Ok([7.0; 3]),
            "at a node, its value"
        );
        let none = Neighbourhood::default();
        assert!(shepard.estimate(&none, &mut System::default()).is_err());
    }
}
