//! Disney's principled model (Burley 2012, 2015) without transmission, in the form of Mitsuba 3's `principled`: what
//! artists' programs have under that name or *Disney*.
//!
//! With h the half vector, Fx = (1 − cos θx)⁵ for x of i, v and d (between light and h), and c the base colour:
//!
//! `f = F D G / (4 cos θi cos θv)` the main lobe, GGX of `αx = r²/a, αy = r² a, a = √(1 − 0.9 anisotropic)`, Smith's G
//! of both directions by themselves, and `F = (1 − metallic)((1 − spec_tint) F_dielectric(η) + spec_tint
//! Schlick(c/Y(c) F0)) + metallic Schlick(c)`, where `η = 2/(1 − √(0.08 specular)) − 1` and F0 is its reflectance;
//! `+ clearcoat/4 · Schlick(0.04) D₁ G(0.25)`, D₁ Burley's GTR1 of roughness `0.1 − 0.099 clearcoat_gloss`;
//! `+ (1 − metallic) c/π · mix(f_d + f_r, f_ss, flatness)`, with `f_d = (1 − Fi/2)(1 − Fv/2)`,
//! `R = 2 r cos² θd`, `f_r = R (Fi + Fv + Fi Fv (R − 1))`, and
//! `f_ss = 1.25 ((1 + (R/2 − 1) Fi)(1 + (R/2 − 1) Fv)(1/(cos θi + cos θv) − ½) + ½)`;
//! `+ (1 − metallic) sheen Fd · mix(1, c/Y(c), sheen_tint)`.

use super::{Brdf, dielectric, half_vector, schlick, turned};
use crate::direction::{Vec3, dot};
use crate::elementary::Elementary;
use std::f64::consts::PI;

/// The model's parameters, each from 0 to 1 but the azimuth. Positive where the base colour is, and reciprocal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Principled {
    /// Colour of the diffuse base and of a metal.
    pub base_color: [f64; 3],
    /// Square root of the lobe's GGX width.
    pub roughness: f64,
    /// How much longer the highlight is along x: widths differ by the factor 1 − 0.9 times this.
    pub anisotropic: f64,
    /// Share of a metal.
    pub metallic: f64,
    /// Reflectance at normal incidence over 0.08, of what is no metal.
    pub specular: f64,
    /// Share of the base colour in that reflectance.
    pub spec_tint: f64,
    /// Strength of the sheen towards the horizon.
    pub sheen: f64,
    /// Share of the base colour in the sheen.
    pub sheen_tint: f64,
    /// Share of the diffuse base that is a flat, subsurface-like one.
    pub flatness: f64,
    /// Strength of the coat.
    pub clearcoat: f64,
    /// Its gloss.
    pub clearcoat_gloss: f64,
    /// Azimuth of the direction along which the highlight is longer (the tangent), degrees.
    pub azimuth_deg: f64,
}

/// Least width of the main lobe, as in Mitsuba.
const LEAST_ALPHA: f64 = 0.001;
/// Width that shadows the coat.
const COAT_SHADOWING: f64 = 0.25;
/// Its reflectance at normal incidence.
const COAT_F0: f64 = 0.04;

impl Brdf for Principled {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let (s, c) = self.azimuth_deg.to_radians().sine_cosine();
        let (light, view) = (turned(light, c, s), turned(view, c, s));
        let h = half_vector(light, view);
        let cos_d = dot(light, h).clamp(0.0, 1.0);
        let (lobe, coat) = (self.lobe(light, view, h), self.coat(light, view, h, cos_d));
        let fresnel = self.fresnel(cos_d);
        let (diffuse, sheen) = self.base(light[2], view[2], cos_d);
        [0, 1, 2].map(|c| {
            let base = self.base_color[c] * diffuse + self.tinted(c, self.sheen_tint) * sheen;
            fresnel[c] * lobe + coat + (1.0 - self.metallic) * base
        })
    }
}

impl Principled {
    /// 1 of a white, c/Y(c) of a wholly tinted channel.
    fn tinted(&self, channel: usize, share: f64) -> f64 {
        let [r, g, b] = self.base_color;
        let luminance = 0.212_671 * r + 0.715_160 * g + 0.072_169 * b;
        let tint = if luminance > 0.0 {
            self.base_color[channel] / luminance
        } else {
            1.0
        };
        1.0 + share * (tint - 1.0)
    }

    /// D G / (4 cos θi cos θv) of the main lobe.
    fn lobe(&self, light: Vec3, view: Vec3, h: Vec3) -> f64 {
        let aspect = (1.0 - 0.9 * self.anisotropic).sqrt();
        let r2 = self.roughness * self.roughness;
        let (ax, ay) = (
            (r2 / aspect).max(LEAST_ALPHA),
            (r2 * aspect).max(LEAST_ALPHA),
        );
        let k = (h[0] / ax).powi(2) + (h[1] / ay).powi(2) + h[2] * h[2];
        let d = 1.0 / (PI * ax * ay * k * k);
        d * smith_over_cosine(light, ax, ay) * smith_over_cosine(view, ax, ay) / 4.0
    }

    fn fresnel(&self, cos_d: f64) -> [f64; 3] {
        if self.specular <= 0.0 {
            // As in Mitsuba: no lobe at all where the indices are alike.
            return [0.0; 3];
        }
        let index = 2.0 / (1.0 - (0.08 * self.specular).sqrt()) - 1.0;
        let exact = dielectric(cos_d, index);
        let f0 = ((index - 1.0) / (index + 1.0)).powi(2);
        [0, 1, 2].map(|c| {
            let tinted = schlick(self.tinted(c, 1.0) * f0, cos_d);
            let plain = exact + self.spec_tint * (tinted - exact);
            plain + self.metallic * (schlick(self.base_color[c], cos_d) - plain)
        })
    }

    fn coat(&self, light: Vec3, view: Vec3, h: Vec3, cos_d: f64) -> f64 {
        if self.clearcoat <= 0.0 {
            return 0.0;
        }
        let alpha = 0.1 - 0.099 * self.clearcoat_gloss;
        let a2 = alpha * alpha;
        let d = (a2 - 1.0) / (PI * a2.natural_log() * (1.0 + (a2 - 1.0) * h[2] * h[2]));
        let g = |w: Vec3| smith_over_cosine(w, COAT_SHADOWING, COAT_SHADOWING) * w[2];
        0.25 * self.clearcoat * schlick(COAT_F0, cos_d) * d * g(light) * g(view)
    }

    /// The diffuse base without its colour, and the sheen without its own.
    fn base(&self, cos_i: f64, cos_v: f64, cos_d: f64) -> (f64, f64) {
        let [fi, fv, fd] = [cos_i, cos_v, cos_d].map(|cos| schlick(0.0, cos));
        let r = 2.0 * self.roughness * cos_d * cos_d;
        let diffuse = (1.0 - 0.5 * fi) * (1.0 - 0.5 * fv) + r * (fi + fv + fi * fv * (r - 1.0));
        let through = (1.0 + (0.5 * r - 1.0) * fi) * (1.0 + (0.5 * r - 1.0) * fv);
        let flat = 1.25 * (through * (1.0 / (cos_i + cos_v).max(1e-9) - 0.5) + 0.5);
        let mixed = diffuse + self.flatness * (flat - diffuse);
        (mixed / PI, self.sheen * fd)
    }
}

/// Smith's G of one direction over its cosine, for GGX.
fn smith_over_cosine(w: Vec3, ax: f64, ay: f64) -> f64 {
    let z = w[2].max(1e-9);
    2.0 / (z + ((ax * w[0]).powi(2) + (ay * w[1]).powi(2) + z * z).sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    fn model(specular: f64, metallic: f64) -> Principled {
        Principled {
            base_color: [0.7, 0.4, 0.1],
            roughness: 0.45,
            anisotropic: 0.7,
            metallic,
            specular,
            spec_tint: 0.3,
            sheen: 0.6,
            sheen_tint: 0.5,
            flatness: 0.2,
            clearcoat: 0.8,
            clearcoat_gloss: 0.4,
            azimuth_deg: 31.0,
        }
    }

    #[test]
    fn it_is_positive_and_reciprocal_with_every_lobe() {
        for (specular, metallic) in [(0.5, 0.0), (0.0, 0.0), (0.5, 0.4), (1.0, 1.0)] {
            checks::is_positive_and_reciprocal(&model(specular, metallic));
        }
    }

    #[test]
    fn indices_that_are_alike_leave_no_lobe_and_a_dielectric_has_the_known_reflectance() {
        assert_eq!(model(0.0, 1.0).fresnel(0.7), [0.0; 3]);
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-12);
        assert!((dielectric(0.0, 1.5) - 1.0).abs() < 1e-12);
        // At Brewster's angle only one polarisation comes back: ((n² − 1)/(n² + 1))²/2.
        let brewster = 1.0 / (1.0f64 + 1.5 * 1.5).sqrt();
        let exact = 0.5 * (1.25f64 / 3.25).powi(2);
        assert!((dielectric(brewster, 1.5) - exact).abs() < 1e-12);
    }
}
