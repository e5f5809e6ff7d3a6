//! The ideal diffuse reflector: the same radiance in every direction.

use super::Brdf;
use crate::direction::Vec3;
use std::f64::consts::PI;

/// `f = ρ/π`. Reciprocal; its albedo is ρ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    /// Albedo ρ per channel, 0 ..= 1.
    pub albedo: [f64; 3],
}

impl Brdf for Lambert {
    fn eval(&self, _: Vec3, _: Vec3) -> [f64; 3] {
        self.albedo.map(|rho| rho / PI)
    }
}

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    #[test]
    fn it_reflects_its_albedo_from_any_direction() {
        let model = Lambert {
            albedo: [0.9, 0.5, 0.1],
        };
        checks::is_positive_and_reciprocal(&model);
        for theta_i in [0.0, 80.0] {
            let found = checks::albedo(&model, theta_i, 20.0);
            for c in 0..3 {
                assert!((found[c] - model.albedo[c]).abs() < 1e-3, "{found:?}");
            }
        }
    }
}
