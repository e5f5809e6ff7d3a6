//! The anisotropic microfacet model with the GGX distribution: Walter et al. (2007), in the
//! anisotropic form of Burley (2012), with the height-correlated masking of Heitz (2014).
//!
//! `f = ρ/π + ks F(ωi·h) D(h) G(ωi, ωv) / (4 (n·ωi)(n·ωv))`,
//! `D = 1 / (π αx αy (hx²/αx² + hy²/αy² + hz²)²)`, `G = 1 / (1 + Λ(ωi) + Λ(ωv))`,
//! `Λ(ω) = (√(1 + (αx²ωx² + αy²ωy²)/ωz²) − 1)/2`.

use super::{Brdf, half_vector, schlick, turned};
use crate::direction::{Vec3, dot};
use crate::elementary::Elementary;
use std::f64::consts::PI;

/// One GGX lobe on a diffuse base. Positive and reciprocal; the lobe alone loses energy for
/// `specular` ≤ 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    /// Albedo of the diffuse base per channel.
    pub diffuse: [f64; 3],
    /// Weight of the lobe per channel, ≥ 0.
    pub specular: [f64; 3],
    /// Reflectance at normal incidence of Schlick's Fresnel term, 0 ..= 1.
    pub f0: f64,
    /// Roughness along the lobe's own x axis, > 0.
    pub alpha_x: f64,
    /// Roughness along its y axis, > 0.
    pub alpha_y: f64,
    /// Azimuth of the lobe's x axis, degrees.
    pub azimuth_deg: f64,
}

/// D G / (4 cos θi cos θv) of the widths αx and αy, with the height-correlated G; for directions whose z is not below 0.
pub(super) fn lobe(light: Vec3, view: Vec3, h: Vec3, [alpha_x, alpha_y]: [f64; 2]) -> f64 {
    let (ax2, ay2) = (alpha_x.powi(2), alpha_y.powi(2));
    let k = h[0] * h[0] / ax2 + h[1] * h[1] / ay2 + h[2] * h[2];
    let d = 1.0 / (PI * alpha_x * alpha_y * k * k);
    let root = |w: Vec3| {
        let wz2 = (w[2] * w[2]).max(1e-18);
        (1.0 + (ax2 * w[0] * w[0] + ay2 * w[1] * w[1]) / wz2).sqrt()
    };
    // 1 + Λi + Λv = (root i + root v)/2.
    let g = 2.0 / (root(light) + root(view));
    let cosines = light[2].max(1e-9) * view[2].max(1e-9);
    d * g / (4.0 * cosines)
}

impl Brdf for Ggx {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let (s, c) = self.azimuth_deg.to_radians().sine_cosine();
        let (light, view) = (turned(light, c, s), turned(view, c, s));
        let h = half_vector(light, view);
        let value =
            schlick(self.f0, dot(light, h)) * lobe(light, view, h, [self.alpha_x, self.alpha_y]);
        [0, 1, 2].map(|c| self.diffuse[c] / PI + self.specular[c] * value)
    }
}

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    #[test]
    fn it_is_positive_reciprocal_and_loses_energy() {
        for (alpha_x, alpha_y) in [(0.1, 0.4), (0.3, 0.3), (0.9, 0.2)] {
            let model = model(alpha_x, alpha_y);
            checks::is_positive_and_reciprocal(&model);
            for theta_i in [0.0, 40.0, 70.0] {
                let albedo = checks::albedo(&model, theta_i, 50.0);
                assert!(albedo[0] < 1.0, "{alpha_x} {alpha_y} {theta_i}: {albedo:?}");
            }
        }
        // Smooth facets that reflect all lose next to nothing.
        assert!(checks::albedo(&model(0.1, 0.15), 0.0, 0.0)[0] > 0.98);
    }

    fn model(alpha_x: f64, alpha_y: f64) -> Ggx {
        Ggx {
            diffuse: [0.0; 3],
            specular: [1.0, 0.5, 0.1],
            f0: 1.0,
            alpha_x,
            alpha_y,
            azimuth_deg: 31.0,
        }
    }
}
