//! The material of glTF 2.0 (appendix B) with the extensions `KHR_materials_specular`, `_anisotropy`, `_sheen` and
//! `_clearcoat`, without transmission: what engines and web pages show.
//!
//! With the lobe `L(α) = D G / (4 cos θi cos θv)` of GGX (height-correlated G), Schlick's Fresnel term by the angle
//! between light and half vector, and c the base colour:
//! base `b = (1 − metallic)((1 − specular F(0.04)) c/π + specular F(0.04) L) + metallic F(c) L`, with
//! `αt = mix(roughness², 1, strength²)` along the tangent and `αb = roughness²` across it; under a sheen
//! `s = colour D_Charlie V_Charlie` (Conty and Kulla 2017, α = sheen_roughness²) it is
//! `s + b min over both directions of (1 − max(colour) E(cos θ))`, E the sheen's directional albedo; under a clear coat
//! `mix(that, L(clearcoat_roughness²), clearcoat F(0.04, cos θv))`. The coat makes it not reciprocal as published; here
//! F is its mean over both directions, and with it the model the mean of both orders of light and view.

use super::{Brdf, ggx, half_vector, schlick, turned};
use crate::direction::{Direction, Vec3, dot};
use crate::elementary::Elementary;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::OnceLock;

/// The model's parameters under glTF's names, each from 0 to 1 but the azimuth. Positive and reciprocal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gltf {
    /// `baseColorFactor`.
    pub base_color: [f64; 3],
    /// `metallicFactor`.
    pub metallic: f64,
    /// `roughnessFactor`.
    pub roughness: f64,
    /// `specularFactor`.
    pub specular: f64,
    /// `anisotropyStrength`.
    pub anisotropy_strength: f64,
    /// `sheenColorFactor`.
    pub sheen_color: [f64; 3],
    /// `sheenRoughnessFactor`.
    pub sheen_roughness: f64,
    /// `clearcoatFactor`.
    pub clearcoat: f64,
    /// `clearcoatRoughnessFactor`.
    pub clearcoat_roughness: f64,
    /// `anisotropyRotation` in degrees: azimuth of the direction along which the highlight is longer.
    pub azimuth_deg: f64,
}

/// Reflectance of a dielectric of index 1.5 at normal incidence.
const F0: f64 = 0.04;
/// Widths below this are a mirror's.
const LEAST_ALPHA: f64 = 1e-3;
/// The least roughness of a sheen.
const LEAST_SHEEN_ROUGHNESS: f64 = 0.05;

impl Brdf for Gltf {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let (s, c) = self.azimuth_deg.to_radians().sine_cosine();
        let (light, view) = (turned(light, c, s), turned(view, c, s));
        let h = half_vector(light, view);
        let cos_d = dot(light, h).clamp(0.0, 1.0);
        let base = self.base(light, view, h, cos_d);
        let (sheen, through) = self.sheen(light[2], view[2], h[2]);
        let coat_alpha = (self.clearcoat_roughness.powi(2)).max(LEAST_ALPHA);
        let coat = ggx::lobe(light, view, h, [coat_alpha; 2]);
        let share = 0.5 * self.clearcoat * (schlick(F0, light[2]) + schlick(F0, view[2]));
        [0, 1, 2].map(|c| {
            let below = self.sheen_color[c] * sheen + through * base[c];
            below + share * (coat - below)
        })
    }
}

impl Gltf {
    fn base(&self, light: Vec3, view: Vec3, h: Vec3, cos_d: f64) -> [f64; 3] {
        let across = (self.roughness * self.roughness).max(LEAST_ALPHA);
        let along = across + (1.0 - across) * self.anisotropy_strength.powi(2);
        let lobe = ggx::lobe(light, view, h, [along, across]);
        let dielectric = self.specular * schlick(F0, cos_d);
        self.base_color.map(|c| {
            let plain = (1.0 - dielectric) * c / PI + dielectric * lobe;
            plain + self.metallic * (schlick(c, cos_d) * lobe - plain)
        })
    }

    /// The sheen without its colour, and the share of the base that is seen through it.
    fn sheen(&self, cos_i: f64, cos_v: f64, cos_h: f64) -> (f64, f64) {
        let most = self.sheen_color.into_iter().fold(0.0, f64::max);
        if most <= 0.0 {
            return (0.0, 1.0);
        }
        let roughness = self.sheen_roughness.max(LEAST_SHEEN_ROUGHNESS);
        let albedo = |cos| sheen_albedo(cos, roughness);
        let through = 1.0 - most * albedo(cos_i).max(albedo(cos_v));
        (charlie(cos_i, cos_v, cos_h, roughness), through.max(0.0))
    }
}

/// The sheen's D V.
fn charlie(cos_i: f64, cos_v: f64, cos_h: f64, roughness: f64) -> f64 {
    let alpha = roughness * roughness;
    let sine2 = (1.0 - cos_h * cos_h).max(0.0);
    let d = (2.0 + 1.0 / alpha) * sine2.power(0.5 / alpha) / TAU;
    let (i, v) = (cos_i.max(1e-6), cos_v.max(1e-6));
    d / ((1.0 + lambda(i, alpha) + lambda(v, alpha)) * 4.0 * i * v)
}

fn lambda(cos: f64, alpha: f64) -> f64 {
    let l = |x: f64| {
        let t = (1.0 - alpha) * (1.0 - alpha);
        let mix = |a: f64, b: f64| a + t * (b - a);
        let (a, b, c) = (
            mix(21.5473, 25.3245),
            mix(3.82987, 3.32435),
            mix(0.19823, 0.16801),
        );
        let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
        a / (1.0 + b * x.power(c)) + d * x + e
    };
    if cos < 0.5 {
        l(cos).exponential()
    } else {
        (2.0 * l(0.5) - l(1.0 - cos)).exponential()
    }
}

/// Places of the albedo's table along cosine and roughness.
const PLACES: usize = 32;

/// Directional albedo of the sheen, of a table made once: linear between its places.
fn sheen_albedo(cos: f64, roughness: f64) -> f64 {
    static TABLE: OnceLock<Vec<f64>> = OnceLock::new();
    let last = (PLACES - 1) as f64;
    let table = TABLE.get_or_init(|| {
        let at = |k: usize| (k % PLACES) as f64 / last;
        let of = |k: usize| {
            let roughness = LEAST_SHEEN_ROUGHNESS + (1.0 - LEAST_SHEEN_ROUGHNESS) * at(k);
            albedo_by_quadrature(at(k / PLACES).max(0.02), roughness)
        };
        (0..PLACES * PLACES).map(of).collect()
    });
    let share = (roughness - LEAST_SHEEN_ROUGHNESS) / (1.0 - LEAST_SHEEN_ROUGHNESS);
    let [(x, u), (y, v)] = [cos, share].map(|t| {
        let t = t.clamp(0.0, 1.0) * last;
        let k = (t as usize).min(PLACES - 2);
        (k, t - k as f64)
    });
    let at = |x: usize, y: usize| table[x * PLACES + y];
    let row = |x: usize| at(x, y) + v * (at(x, y + 1) - at(x, y));
    row(x) + u * (row(x + 1) - row(x))
}

fn albedo_by_quadrature(cos_i: f64, roughness: f64) -> f64 {
    const RINGS: usize = 48;
    const AZIMUTHS: usize = 24;
    let light = [(1.0 - cos_i * cos_i).max(0.0).sqrt(), 0.0, cos_i];
    let mut sum = 0.0;
    for ring in 0..RINGS {
        let theta = (ring as f64 + 0.5) / RINGS as f64 * FRAC_PI_2;
        // Both halves of the azimuth are alike.
        for k in 0..AZIMUTHS {
            let phi = (k as f64 + 0.5) / AZIMUTHS as f64 * PI;
            let view = Direction { theta, phi }.to_vec3();
            let h = half_vector(light, view);
            sum += charlie(cos_i, view[2], h[2], roughness) * view[2] * theta.sine();
        }
    }
    (sum * FRAC_PI_2 / RINGS as f64 * TAU / AZIMUTHS as f64).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    fn model(metallic: f64, sheen: f64, clearcoat: f64) -> Gltf {
        Gltf {
            base_color: [0.7, 0.4, 0.1],
            metallic,
            roughness: 0.5,
            specular: 0.8,
            anisotropy_strength: 0.6,
            sheen_color: [sheen, 0.5 * sheen, 0.2 * sheen],
            sheen_roughness: 0.4,
            clearcoat,
            clearcoat_roughness: 0.2,
            azimuth_deg: 31.0,
        }
    }

    #[test]
    fn it_is_positive_and_reciprocal_and_loses_energy() {
        for (metallic, sheen, coat) in [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.3, 0.7, 0.6)] {
            let model = model(metallic, sheen, coat);
            checks::is_positive_and_reciprocal(&model);
            for theta_i in [0.0, 40.0, 70.0] {
                let albedo = checks::albedo(&model, theta_i, 50.0);
                assert!(
                    albedo[0] < 1.0,
                    "{metallic} {sheen} {coat} {theta_i}: {albedo:?}"
                );
            }
        }
    }

    #[test]
    fn without_extensions_it_is_appendix_b() {
        // The half vector is the normal: D = 1/(π α²), and the visibility is that of the isotropic GGX.
        let model = Gltf {
            anisotropy_strength: 0.0,
            specular: 1.0,
            ..model(0.0, 0.0, 0.0)
        };
        let (s, c) = (0.75f64.sqrt(), 0.5);
        let f = model.eval([s, 0.0, c], [-s, 0.0, c])[0];
        let fresnel = 0.04 + 0.96 / 32.0;
        let a2 = 1.0 / 16.0;
        let visibility = 0.5 / (2.0 * c * (c * c * (1.0 - a2) + a2).sqrt());
        let expected = (1.0 - fresnel) * 0.7 / PI + fresnel * visibility / (PI * a2);
        assert!((f / expected - 1.0).abs() < 1e-12, "{f} {expected}");
    }

    #[test]
    fn the_sheens_table_is_near_its_integral() {
        for (cos, roughness) in [(0.9, 0.3), (0.3, 0.5), (0.55, 0.9)] {
            let (table, exact) = (
                sheen_albedo(cos, roughness),
                albedo_by_quadrature(cos, roughness),
            );
            assert!(
                (table - exact).abs() < 0.01,
                "{cos} {roughness}: {table} {exact}"
            );
        }
    }
}
