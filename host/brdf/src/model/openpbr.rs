//! OpenPBR Surface 1.1 without transmission, subsurface and thin film: what artists' programs are agreeing on.
//!
//! Layers from below, each a weight of the whole with the albedo of what lies on it taken away (*albedo scaling*): an
//! energy-preserving Oren–Nayar base under a dielectric GGX lobe, mixed with a metal's lobe; a coat of index 1.6 with its
//! darkening of the base and its roughening of the lobe; fuzz (Zeltner et al. 2022). Where the specification leaves the
//! form open, it is that of MaterialX 1.39's `open_pbr_surface` (directional albedos by its rational fits, multiple
//! scattering by Turquin's factor), but for the lobes' shadowing, which is anisotropic. As albedo scaling by the viewer
//! alone is not reciprocal, this is the mean of both orders of light and view.

use super::{Brdf, dielectric, ggx, half_vector, schlick, turned};
use crate::direction::{Vec3, dot};
use crate::elementary::Elementary;
use std::f64::consts::{PI, TAU};

/// The model's parameters under OpenPBR's names; those that are not here have their defaults, and `specular_color` and
/// `specular_weight` are 1. Positive and reciprocal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenPbr {
    /// Colour of the diffuse base and of a metal.
    pub base_color: [f64; 3],
    /// Roughness of the diffuse base, 0 ..= 1.
    pub base_diffuse_roughness: f64,
    /// Share of a metal, 0 ..= 1.
    pub base_metalness: f64,
    /// Index of the dielectric base, at least 1.
    pub specular_ior: f64,
    /// Square root of the lobe's GGX width, 0 ..= 1.
    pub specular_roughness: f64,
    /// Widths across the tangent are smaller by 1 minus this, 0 ..= 1.
    pub specular_roughness_anisotropy: f64,
    /// Share of the surface that the coat covers.
    pub coat_weight: f64,
    /// The same as `specular_roughness`, of the coat.
    pub coat_roughness: f64,
    /// Share of the surface that the fuzz covers.
    pub fuzz_weight: f64,
    /// Its colour.
    pub fuzz_color: [f64; 3],
    /// Its roughness, 0 ..= 1.
    pub fuzz_roughness: f64,
    /// Azimuth of the direction along which the highlight is longer (`geometry_tangent`), degrees.
    pub azimuth_deg: f64,
}

/// Index of the coat.
const COAT_INDEX: f64 = 1.6;
/// Widths below this are a mirror's.
const LEAST_ALPHA: f64 = 1e-3;
/// What the single-scattering lobe of the base loses with its roughness, and its mean (Fujii 2012).
const FUJII: [f64; 2] = [0.5 - 2.0 / (3.0 * PI), 2.0 / 3.0 - 28.0 / (15.0 * PI)];

impl Brdf for OpenPbr {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let (s, c) = self.azimuth_deg.to_radians().sine_cosine();
        let (light, view) = (turned(light, c, s), turned(view, c, s));
        let lobes = self.lobes(light, view);
        let (given, swapped) = (
            self.published(light, view, &lobes),
            self.published(view, light, &lobes),
        );
        [0, 1, 2].map(|c| 0.5 * (given[c] + swapped[c]))
    }
}

/// What is the same in both orders of light and view.
struct Lobes {
    cos_d: f64,
    base: f64,
    base_alpha: f64,
    base_index: f64,
    coat: f64,
    coat_alpha: f64,
}

impl OpenPbr {
    fn lobes(&self, light: Vec3, view: Vec3) -> Lobes {
        let h = half_vector(light, view);
        let cos_d = dot(light, h).clamp(0.0, 1.0);
        let mix = |a: f64, b: f64| a + self.coat_weight * (b - a);
        let coated = 2.0 * self.coat_roughness.powi(4) + self.specular_roughness.powi(4);
        let roughness = mix(self.specular_roughness, coated.min(1.0).sqrt().sqrt());
        let across = 1.0 - self.specular_roughness_anisotropy;
        let along = roughness * roughness * (2.0 / (1.0 + across * across)).sqrt();
        let [ax, ay] = [along, along * across].map(|alpha| alpha.clamp(LEAST_ALPHA, 1.0));
        let coat_alpha = self.coat_roughness.powi(2).max(LEAST_ALPHA);
        let ratio = self.specular_ior / COAT_INDEX;
        Lobes {
            cos_d,
            base: ggx::lobe(light, view, h, [ax, ay]),
            base_alpha: (ax * ay).sqrt(),
            base_index: mix(self.specular_ior, ratio.max(1.0 / ratio)),
            coat: ggx::lobe(light, view, h, [coat_alpha; 2]),
            coat_alpha,
        }
    }

    /// The model as published, whose layers are scaled by the viewer's side.
    fn published(&self, light: Vec3, view: Vec3, lobes: &Lobes) -> [f64; 3] {
        let cos_v = view[2].clamp(1e-6, 1.0);
        let base_albedo = ggx_albedo(cos_v, lobes.base_alpha);
        let (specular, below) = layer(lobes.cos_d, base_albedo, lobes.base_index);
        let coat_albedo = ggx_albedo(cos_v, lobes.coat_alpha);
        let (coat, below_coat) = layer(lobes.cos_d, coat_albedo, COAT_INDEX);
        let coat_f0 = normal_reflectance(COAT_INDEX);
        let inside = 1.0 - (1.0 - coat_f0) / (COAT_INDEX * COAT_INDEX);
        let (fuzz, fuzz_albedo) = fuzz(light, view, self.fuzz_roughness.max(0.01));
        let retro = dot(light, view) - light[2] * view[2];
        let fujii = self.fujii(light[2], cos_v, retro);
        [0, 1, 2].map(|c| {
            let colour = self.base_color[c];
            let diffuse = fujii.of(colour);
            let dielectric = specular * lobes.base + below * diffuse;
            let many = multiple(base_albedo, mean_schlick(colour));
            let metal = schlick(colour, lobes.cos_d) * lobes.base * many;
            let base = dielectric + self.base_metalness * (metal - dielectric);
            let darker = (1.0 - inside) / (1.0 - colour * inside);
            let base = base * (1.0 + self.coat_weight * (darker - 1.0));
            let through = 1.0 - self.coat_weight * (1.0 - below_coat);
            let coated = self.coat_weight * coat * lobes.coat + through * base;
            let fuzzy = self.fuzz_weight * self.fuzz_color[c] * fuzz;
            fuzzy + (1.0 - self.fuzz_weight * fuzz_albedo) * coated
        })
    }

    /// What is the same in all channels of the energy-preserving Oren–Nayar base; `retro` is the cosine between the
    /// directions less the product of theirs with the normal.
    fn fujii(&self, cos_i: f64, cos_v: f64, retro: f64) -> Fujii {
        let r = self.base_diffuse_roughness;
        let over = if retro > 0.0 {
            retro / cos_i.max(cos_v).max(1e-6)
        } else {
            retro
        };
        let a = 1.0 / (1.0 + FUJII[0] * r);
        let mean = a * (1.0 + FUJII[1] * r);
        let lost = |cos: f64| (1.0 - fujii_albedo(cos.clamp(1e-6, 1.0), r, a)).max(1e-9);
        Fujii {
            single: a * (1.0 + r * over),
            many: lost(cos_i) * lost(cos_v) / (1.0 - mean).max(1e-9),
            mean,
        }
    }
}

/// The base of a white surface: scattered once, more than once, and the mean albedo of the first.
struct Fujii {
    single: f64,
    many: f64,
    mean: f64,
}

impl Fujii {
    /// The base of a colour.
    fn of(&self, colour: f64) -> f64 {
        let again = colour * colour * self.mean / (1.0 - colour * (1.0 - self.mean).max(0.0));
        (colour * self.single + again * self.many) / PI
    }
}

/// A dielectric lobe's Fresnel factor with its multiple scattering, and the share that goes through it to what is below;
/// of the lobe's albedo as [`ggx_albedo`] has it.
fn layer(cos_d: f64, [a, b]: [f64; 2], index: f64) -> (f64, f64) {
    let f0 = normal_reflectance(index);
    let many = multiple([a, b], mean_schlick(f0));
    let through = 1.0 - (f0 * a + b) * many;
    (dielectric(cos_d, index) * many, through.max(0.0))
}

fn normal_reflectance(index: f64) -> f64 {
    ((index - 1.0) / (index + 1.0)).powi(2)
}

/// The cosine-weighted mean of Schlick's term.
fn mean_schlick(f0: f64) -> f64 {
    f0 + (1.0 - f0) / 21.0
}

/// Turquin's factor for light that is scattered more than once among the facets.
fn multiple([a, b]: [f64; 2], mean_fresnel: f64) -> f64 {
    let single = (a + b).clamp(1e-3, 1.0);
    1.0 + mean_fresnel * (1.0 - single) / single
}

/// Directional albedo of GGX as `a F0 + b`, by MaterialX's rational fit.
fn ggx_albedo(x: f64, y: f64) -> [f64; 2] {
    const COEFFICIENTS: [[f64; 4]; 9] = [
        [0.1003, 0.9345, 1.0, 1.0],
        [-0.6303, -2.323, -1.765, 0.2281],
        [9.748, 2.229, 8.263, 15.94],
        [-2.038, -3.748, 11.53, -55.83],
        [29.34, 1.424, 28.96, 13.08],
        [-8.245, -0.7684, -7.507, 41.26],
        [-26.44, 1.436, -36.11, 54.9],
        [19.99, 0.2913, 15.86, 300.2],
        [-5.448, 0.6286, 33.37, -285.1],
    ];
    let (x2, y2) = (x * x, y * y);
    let terms = [1.0, x, y, x * y, x2, y2, x2 * y, x * y2, x2 * y2];
    let [p, q, r, s] = [0, 1, 2, 3].map(|k| {
        let each = terms.iter().zip(COEFFICIENTS);
        each.map(|(term, of)| term * of[k]).sum::<f64>()
    });
    [(p / r).clamp(0.0, 1.0), (q / s).clamp(0.0, 1.0)]
}

/// Directional albedo of the single-scattering Oren–Nayar lobe of a white base (Fujii 2012).
fn fujii_albedo(cos: f64, roughness: f64, a: f64) -> f64 {
    let sine = (1.0 - cos * cos).max(0.0).sqrt();
    let g = sine * (cos.arc_cosine() - sine * cos)
        + 2.0 * (sine / cos * (1.0 - sine.powi(3)) - sine) / 3.0;
    a + roughness * a * g / PI
}

/// The fuzz without its colour, and its directional albedo: a linearly transformed cosine, by Zeltner et al.'s fits.
fn fuzz(light: Vec3, view: Vec3, y: f64) -> (f64, f64) {
    let x = view[2].clamp(1e-6, 1.0);
    let s = y * (0.0206607 + 1.58491 * y) / (0.0379424 + y * (1.32227 + y));
    let m = y * (-0.193854 + y * (-1.14885 + y * (1.7932 - 0.95943 * y * y))) / (0.046391 + y);
    let o = y * (0.000654023 + (-0.0207818 + 0.119681 * y) * y) / (1.26264 + y * (-1.92021 + y));
    let bell = (-0.5 * ((x - m) / s).powi(2)).exponential() / (s * TAU.sqrt());
    let albedo = (bell + o).clamp(0.0, 1.0);
    let a = (2.58126 * x + 0.813703 * y) * y / (1.0 + 0.310327 * x * x + 2.60994 * x * y);
    let b = (1.0 - x).sqrt() * (y - 1.0) * y.powi(3)
        / (0.0000254053 + 1.71228 * x - 1.71506 * x * y + 1.34174 * y * y);
    // The light in a frame whose x axis lies below the view.
    let sine = view[0].hypotenuse(view[1]);
    let (cos, sin) = if sine > 0.0 {
        (view[0] / sine, view[1] / sine)
    } else {
        (1.0, 0.0)
    };
    let w = turned(light, cos, sin);
    let o = [a * w[0] + b * w[2], a * w[1], w[2]];
    let length2 = dot(o, o).max(1e-12);
    // The transformed cosine over π, without the cosine of the light; o is not of unit length.
    (albedo / PI * (a / length2).powi(2), albedo)
}

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    fn model(metalness: f64, coat: f64, fuzz: f64) -> OpenPbr {
        OpenPbr {
            base_color: [0.7, 0.4, 0.1],
            base_diffuse_roughness: 0.4,
            base_metalness: metalness,
            specular_ior: 1.5,
            specular_roughness: 0.5,
            specular_roughness_anisotropy: 0.6,
            coat_weight: coat,
            coat_roughness: 0.3,
            fuzz_weight: fuzz,
            fuzz_color: [0.9, 0.5, 0.3],
            fuzz_roughness: 0.5,
            azimuth_deg: 31.0,
        }
    }

    #[test]
    fn it_is_positive_and_reciprocal_and_loses_energy() {
        for (metalness, coat, fuzz) in [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.3, 0.7, 0.6)] {
            let model = model(metalness, coat, fuzz);
            checks::is_positive_and_reciprocal(&model);
            for theta_i in [0.0, 40.0, 70.0] {
                let albedo = checks::albedo(&model, theta_i, 50.0);
                assert!(
                    albedo[0] < 1.02,
                    "{metalness} {coat} {fuzz} {theta_i}: {albedo:?}"
                );
            }
        }
    }

    /// A white base of any roughness under nothing gives back all; with a dielectric lobe of index 1 there is no lobe.
    #[test]
    fn the_bases_energy_is_preserved() {
        for roughness in [0.0, 0.5, 1.0] {
            let model = OpenPbr {
                base_color: [1.0, 0.5, 0.5],
                base_diffuse_roughness: roughness,
                ..model(0.0, 0.0, 0.0)
            };
            let light = [0.6, 0.0, 0.8];
            let n = 200;
            let mut sum = 0.0;
            for t in 0..n {
                let theta = (t as f64 + 0.5) / n as f64 * PI / 2.0;
                for p in 0..n {
                    let phi = p as f64 / n as f64 * TAU;
                    let view = crate::direction::Direction { theta, phi }.to_vec3();
                    let retro = dot(light, view) - light[2] * view[2];
                    let f = model.fujii(light[2], view[2], retro).of(1.0);
                    sum += f * view[2] * theta.sine() * PI / 2.0 * TAU / (n * n) as f64;
                }
            }
            assert!((sum - 1.0).abs() < 2e-3, "{roughness}: {sum}");
        }
    }

    /// The transformed cosine is a density: with the light's cosine it integrates to the albedo.
    #[test]
    fn the_fuzz_has_its_albedo() {
        for (view, y) in [([0.6, 0.0, 0.8], 0.5), ([0.0, 0.8, 0.6], 0.8)] {
            let n = 400;
            let mut sum = 0.0;
            for t in 0..n {
                let theta = (t as f64 + 0.5) / n as f64 * PI / 2.0;
                for p in 0..n {
                    let phi = p as f64 / n as f64 * TAU;
                    let light = crate::direction::Direction { theta, phi }.to_vec3();
                    let (f, _) = fuzz(light, view, y);
                    sum += f * light[2] * theta.sine() * PI / 2.0 * TAU / (n * n) as f64;
                }
            }
            let (_, albedo) = fuzz(view, view, y);
            assert!(
                (sum / albedo - 1.0).abs() < 5e-3,
                "{view:?} {y}: {sum} {albedo}"
            );
        }
    }
}
