//! The anisotropic Gaussian model of Ward (1992), the paper's reference 8.
//!
//! `f = ρd/π + ρs exp(−tan²θh (cos²φh/αx² + sin²φh/αy²)) / (4π αx αy √((n·ωi)(n·ωv)))`.

use super::{Brdf, half_vector, turned};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use std::f64::consts::PI;

/// One Gaussian lobe on a diffuse base. Positive and reciprocal. The albedo of a narrow lobe is
/// ρs cos θi: it loses light towards the horizon, as is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ward {
    /// Albedo of the diffuse base per channel.
    pub diffuse: [f64; 3],
    /// Weight ρs of the lobe per channel, ≥ 0.
    pub specular: [f64; 3],
    /// Standard deviation of the slope along the lobe's own x axis, times √2, > 0.
    pub alpha_x: f64,
    /// The same along its y axis.
    pub alpha_y: f64,
    /// Azimuth of the lobe's x axis, degrees.
    pub azimuth_deg: f64,
}

impl Brdf for Ward {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let (s, c) = self.azimuth_deg.to_radians().sine_cosine();
        let h = turned(half_vector(light, view), c, s);
        let exponent =
            ((h[0] / self.alpha_x).powi(2) + (h[1] / self.alpha_y).powi(2)) / (h[2] * h[2]);
        let cosines = light[2].max(1e-9) * view[2].max(1e-9);
        let value =
            (-exponent).exponential() / (4.0 * PI * self.alpha_x * self.alpha_y * cosines.sqrt());
        [0, 1, 2].map(|c| self.diffuse[c] / PI + self.specular[c] * value)
    }
}

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    #[test]
    fn it_is_positive_reciprocal_and_has_the_albedo_of_a_narrow_lobe() {
        let model = Ward {
            diffuse: [0.3, 0.2, 0.1],
            specular: [0.7, 0.3, 0.1],
            alpha_x: 0.04,
            alpha_y: 0.08,
            azimuth_deg: 31.0,
        };
        checks::is_positive_and_reciprocal(&model);
        for theta_i in [0.0f64, 30.0, 60.0] {
            let albedo = checks::albedo(&model, theta_i, 50.0);
            for c in 0..3 {
                let narrow = model.diffuse[c] + model.specular[c] * theta_i.to_radians().cosine();
                assert!(
                    (albedo[c] / narrow - 1.0).abs() < 0.02,
                    "{theta_i}: {albedo:?}"
                );
            }
        }
    }
}
