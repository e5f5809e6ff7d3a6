//! Radial basis functions.

use crate::elementary::Elementary;
use crate::interpolate::Matern32;

/// A radial basis function of the distance r. Those without a length are homogeneous: scaling all
/// distances scales the kernel, so that they need none. Signs are those that make the kernel
/// conditionally positive definite, as in scipy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BasisFunction {
    /// −r
    Linear,
    /// r² ln r
    ThinPlate,
    /// r³
    Cubic,
    /// exp(−(r/ℓ)²)
    Gaussian,
    /// −√(1 + (r/ℓ)²)
    Multiquadric,
    /// Wendland's C² function in up to seven dimensions, (1 − r/ℓ)⁶₊ (6 r/ℓ + 1): zero from ℓ on.
    Wendland,
    /// Matérn 3/2, (1 + √3 r/ℓ) exp(−√3 r/ℓ): the kernel of the default method.
    Matern,
}

impl BasisFunction {
    /// All of them.
    pub const ALL: [BasisFunction; 7] = [
        BasisFunction::Linear,
        BasisFunction::ThinPlate,
        BasisFunction::Cubic,
        BasisFunction::Gaussian,
        BasisFunction::Multiquadric,
        BasisFunction::Wendland,
        BasisFunction::Matern,
    ];

    /// Its name in `rbf-NAME`.
    pub fn name(self) -> &'static str {
        match self {
            BasisFunction::Linear => "linear",
            BasisFunction::ThinPlate => "thin-plate",
            BasisFunction::Cubic => "cubic",
            BasisFunction::Gaussian => "gaussian",
            BasisFunction::Multiquadric => "multiquadric",
            BasisFunction::Wendland => "wendland",
            BasisFunction::Matern => "matern",
        }
    }

    /// The length ℓ that suits the kernel, in radii of the neighbourhood; `None` for those that have
    /// none. Flat kernels interpolate better and condition worse; these are the common compromise.
    pub fn usual_length(self) -> Option<f64> {
        match self {
            BasisFunction::Linear | BasisFunction::ThinPlate | BasisFunction::Cubic => None,
            BasisFunction::Gaussian | BasisFunction::Multiquadric => Some(0.5),
            BasisFunction::Wendland => Some(4.0),
            BasisFunction::Matern => Some(8.0),
        }
    }

    /// Degree of the polynomial that is fitted with it: the least one that the kernel's order of
    /// conditional positive definiteness allows, and at least the constant.
    pub fn tail_degree(self) -> usize {
        match self {
            BasisFunction::ThinPlate | BasisFunction::Cubic => 1,
            _ => 0,
        }
    }

    /// The value at distance `r` ≥ 0, for a length ℓ > 0.
    #[inline]
    pub fn value(self, r: f64, length: f64) -> f64 {
        let s = r / length;
        match self {
            BasisFunction::Linear => -r,
            // r² ln r → 0 as r → 0.
            BasisFunction::ThinPlate => {
                if r > 0.0 {
                    r * r * r.natural_log()
                } else {
                    0.0
                }
            }
            BasisFunction::Cubic => r * r * r,
            BasisFunction::Gaussian => (-s * s).exponential(),
            BasisFunction::Multiquadric => -(1.0 + s * s).sqrt(),
            BasisFunction::Wendland => (1.0 - s).max(0.0).powi(6) * (6.0 * s + 1.0),
            BasisFunction::Matern => Matern32::of(3f64.sqrt() * s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_have_their_values_at_zero_and_at_their_length() {
        let at = |k: BasisFunction| (k.value(0.0, 2.0), k.value(2.0, 2.0));
        assert_eq!(at(BasisFunction::Linear), (0.0, -2.0));
        assert_eq!(
            at(BasisFunction::ThinPlate),
            (0.0, 4.0 * 2f64.natural_log())
        );
        assert_eq!(at(BasisFunction::Cubic), (0.0, 8.0));
        assert_eq!(at(BasisFunction::Gaussian), (1.0, (-1f64).exponential()));
        assert_eq!(at(BasisFunction::Multiquadric), (-1.0, -(2f64.sqrt())));
        assert_eq!(at(BasisFunction::Wendland), (1.0, 0.0));
        assert_eq!(BasisFunction::Wendland.value(3.0, 2.0), 0.0);
        let (zero, length) = at(BasisFunction::Matern);
        assert_eq!(zero, 1.0);
        assert!((length - 0.483_358).abs() < 1e-6);
    }
}
