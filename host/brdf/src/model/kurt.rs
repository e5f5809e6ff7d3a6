//! The anisotropic microfacet model of Kurt, Szirmay-Kalos and Křivánek (2010), with an azimuth
//! per lobe (our extension: two threads of a fabric lie across each other).
//!
//! Per lobe: `f = F(ωi·h) D(h) / (4 (ωi·h) [(n·ωi)(n·ωv)]^α)` with
//! `D = exp(−tan²θh (cos²φh/mx² + sin²φh/my²)) / (π mx my cos⁴θh)`, on a base `kd/π`.

use super::{Brdf, half_vector};
use crate::direction::{Vec3, dot};
use crate::elementary::Elementary;
use std::f64::consts::PI;

/// A diffuse base and any number of lobes. Reciprocal and positive.
#[derive(Clone, Debug)]
pub struct Kurt {
    diffuse_over_pi: [f64; 3],
    lobes: Vec<PreparedLobe>,
}

/// The parameters of one lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KurtLobe {
    /// Weight per channel, ≥ 0.
    pub specular: [f64; 3],
    /// Reflectance at normal incidence of Schlick's Fresnel term, 0 ..= 1.
    pub f0: f64,
    /// Roughness along the lobe's own x axis, > 0.
    pub mx: f64,
    /// Roughness along its y axis, > 0.
    pub my: f64,
    /// Exponent α of the shadowing-like denominator.
    pub alpha: f64,
    /// Azimuth of the lobe's x axis, degrees.
    pub azimuth_deg: f64,
}

#[derive(Clone, Debug)]
struct PreparedLobe {
    scale: [f64; 3],
    f0: f64,
    inv_mx2: f64,
    inv_my2: f64,
    alpha: f64,
    axis: [f64; 2],
}

impl Kurt {
    /// A model of albedo-like `diffuse` (per channel) and lobes.
    pub fn new(diffuse: [f64; 3], lobes: &[KurtLobe]) -> Self {
        Self {
            diffuse_over_pi: diffuse.map(|d| d / PI),
            lobes: lobes
                .iter()
                .map(|l| {
                    let (s, c) = l.azimuth_deg.to_radians().sine_cosine();
                    PreparedLobe {
                        scale: l.specular.map(|s| s / (4.0 * PI * l.mx * l.my)),
                        f0: l.f0,
                        inv_mx2: 1.0 / (l.mx * l.mx),
                        inv_my2: 1.0 / (l.my * l.my),
                        alpha: l.alpha,
                        axis: [c, s],
                    }
                })
                .collect(),
        }
    }

    /// A plain-woven fabric of gold and dark-green threads, turned off the grid's axes, in the
    /// spirit of the paper's *fabric112*: the demo's material.
    pub fn two_thread_fabric() -> Self {
        let thread = |specular, mx, my, azimuth_deg| KurtLobe {
            specular,
            f0: 0.06,
            mx,
            my,
            alpha: 0.35,
            azimuth_deg,
        };
        Self::new(
            [0.16, 0.12, 0.07],
            &[
                thread([1.9, 1.4, 0.5], 0.14, 0.55, 23.0),
                thread([0.5, 0.8, 0.55], 0.20, 0.62, 113.0),
            ],
        )
    }

    /// A white, nearly diffuse cloth: the demo's reference, whose reflectance the host is not told.
    pub fn white_reference_fabric() -> Self {
        Self::new(
            [0.80, 0.79, 0.76],
            &[KurtLobe {
                specular: [0.8; 3],
                f0: 0.04,
                mx: 0.75,
                my: 0.65,
                alpha: 0.2,
                azimuth_deg: 0.0,
            }],
        )
    }
}

impl Brdf for Kurt {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let mut f = self.diffuse_over_pi;
        let h = half_vector(light, view);
        let cos_d = dot(light, h).max(1e-9);
        let inv_cos2 = 1.0 / (h[2] * h[2]);
        let schlick = (1.0 - cos_d).powi(5);
        let cosines = light[2].max(1e-9) * view[2].max(1e-9);
        for lobe in &self.lobes {
            let hx = h[0] * lobe.axis[0] + h[1] * lobe.axis[1];
            let hy = h[1] * lobe.axis[0] - h[0] * lobe.axis[1];
            let exponent = (hx * hx * lobe.inv_mx2 + hy * hy * lobe.inv_my2) * inv_cos2;
            let fresnel = lobe.f0 + (1.0 - lobe.f0) * schlick;
            // exp and the power share one call: the simulator evaluates this at every pixel.
            let shape = (-exponent - lobe.alpha * cosines.natural_log()).exponential();
            let value = fresnel * shape * inv_cos2 * inv_cos2 / cos_d;
            for c in 0..3 {
                f[c] += lobe.scale[c] * value;
            }
        }
        f
    }
}

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    #[test]
    fn the_demos_materials_are_reciprocal_positive_and_lose_energy() {
        for model in [Kurt::two_thread_fabric(), Kurt::white_reference_fabric()] {
            checks::is_positive_and_reciprocal(&model);
            for theta_i in [0.0, 30.0, 60.0, 80.0] {
                let albedo = checks::albedo(&model, theta_i, 40.0);
                assert!(albedo.iter().all(|a| *a < 1.0), "{theta_i}: {albedo:?}");
            }
        }
    }
}
