//! The microcylinder model of cloth: Sadeghi, Bisker, De Deken and Jensen (2013).
//!
//! Each of two threads is a row of cylinders whose tangents t tilt out of the cloth. With θ the
//! angle of a direction above the plane normal to t, φ its azimuth around t and ψ that around the
//! binormal b, θh = (θi + θr)/2 and θd = (θi − θr)/2, a thread scatters
//!
//! * `fs = (S + V)/cos²θd`, at its surface `S = Fr(η, cos θd cos(φd/2)) cos(φd/2) g(γs, θh)`, and in
//!   its volume `V = A (1 − Fr)² ((1 − kd) g(γv, θh) + kd)/(cos θi + cos θr)`, where g is a Gaussian
//!   of unit area;
//! * shadowed by its neighbours: `M = (1 − u) Mi Mr + u min(Mi, Mr)`, `Mx = max(cos φx, 0)`,
//!   `u = exp(−φd²/(2·(20°)²))`; and P the same of ψ.
//!
//! `f = (a1 L1 + a2 L2)/(Q n·ωi)`, `Lj = mean over tangents of P M fs cos θi`,
//! `Q = Σ aj mean(P) + (1 − a1 − a2)(ωr·n)`.

use super::Brdf;
use crate::direction::{Vec3, dot};
use crate::elementary::Elementary;
use std::f64::consts::PI;

/// Width of the transition from uncorrelated to correlated shadowing, radians: 20°.
const SHADOW_WIDTH: f64 = PI / 9.0;

/// One thread of the weave.
#[derive(Clone, Debug, PartialEq)]
pub struct Thread {
    /// Index of refraction η, > 1.
    pub index: f64,
    /// Colour A of the volume, per channel, ≥ 0.
    pub albedo: [f64; 3],
    /// Share kd of the volume's light that is scattered evenly, 0 ..= 1.
    pub isotropic: f64,
    /// Width γs of the surface's highlight, degrees.
    pub surface_width_deg: f64,
    /// Width γv of the volume's, degrees.
    pub volume_width_deg: f64,
    /// Share a of the cloth that it covers; both shares together at most 1.
    pub cover: f64,
    /// Azimuth of the thread, degrees.
    pub azimuth_deg: f64,
    /// Tilts of its tangents about the binormal, degrees, each counted alike; at least one.
    pub tilts_deg: Vec<f64>,
}

/// Two threads across each other, by the published formula. Not reciprocal: what a thread receives
/// counts by cos θi, and Q by the view only. See [`Reciprocal`]. Not negative, but zero where all
/// tangents are turned away from light or view.
#[derive(Clone, Debug)]
pub struct Microcylinder {
    threads: [Prepared; 2],
    /// The share of the cloth that no thread covers.
    bare: f64,
}

/// The mean of a microcylinder model's two values for swapped light and view, as the paper enforces
/// reciprocity. What is measured on a rig is reciprocal, so this is what is simulated and fitted.
#[derive(Clone, Debug)]
pub struct Reciprocal(pub Microcylinder);

#[derive(Clone, Debug)]
struct Prepared {
    index: f64,
    albedo: [f64; 3],
    isotropic: f64,
    surface: Gaussian,
    volume: Gaussian,
    cover: f64,
    binormal: Vec3,
    /// Tangent and normal of each tilt.
    frames: Vec<(Vec3, Vec3)>,
}

/// A Gaussian of unit area over an angle.
#[derive(Clone, Copy, Debug)]
struct Gaussian {
    scale: f64,
    peak: f64,
}

impl Gaussian {
    fn new(width_deg: f64) -> Self {
        let width = width_deg.to_radians();
        Self {
            scale: -0.5 / (width * width),
            peak: 1.0 / (width * (2.0 * PI).sqrt()),
        }
    }

    fn at(self, angle: f64) -> f64 {
        self.peak * (self.scale * angle * angle).exponential()
    }
}

impl Microcylinder {
    /// The cloth of two threads.
    pub fn new(threads: &[Thread; 2]) -> Self {
        let covered: f64 = threads.iter().map(|thread| thread.cover).sum();
        Self {
            threads: [0, 1].map(|k: usize| Prepared::new(&threads[k])),
            bare: (1.0 - covered).max(0.0),
        }
    }

    /// Values for light and view as given, and swapped.
    fn both(&self, light: Vec3, view: Vec3) -> ([f64; 3], [f64; 3]) {
        let mut sums = [[0.0; 3]; 2];
        let mut weight = 0.0;
        for thread in &self.threads {
            let seen = thread.seen(light, view);
            weight += thread.cover * seen.weight;
            for c in 0..3 {
                sums[0][c] += thread.cover * seen.scattered[0][c];
                sums[1][c] += thread.cover * seen.scattered[1][c];
            }
        }
        let (cos_i, cos_r) = (light[2].max(1e-9), view[2].max(1e-9));
        let value = |sum: [f64; 3], cos_i: f64, cos_r: f64| {
            let whole = (weight + self.bare * cos_r).max(1e-9) * cos_i;
            sum.map(|s| s / whole)
        };
        (value(sums[0], cos_i, cos_r), value(sums[1], cos_r, cos_i))
    }
}

impl Brdf for Microcylinder {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        self.both(light, view).0
    }
}

impl Brdf for Reciprocal {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let (given, swapped) = self.0.both(light, view);
        [0, 1, 2].map(|c| 0.5 * (given[c] + swapped[c]))
    }
}

/// What a thread shows of itself.
struct Seen {
    /// Mean of P M fs cos θ, with θ of the light and of the view.
    scattered: [[f64; 3]; 2],
    /// Mean of P.
    weight: f64,
}

impl Prepared {
    fn new(thread: &Thread) -> Self {
        let (s, c) = thread.azimuth_deg.to_radians().sine_cosine();
        let frames = thread.tilts_deg.iter().map(|tilt| {
            let (up, along) = tilt.to_radians().sine_cosine();
            ([c * along, s * along, up], [-c * up, -s * up, along])
        });
        Self {
            index: thread.index,
            albedo: thread.albedo,
            isotropic: thread.isotropic,
            surface: Gaussian::new(thread.surface_width_deg),
            volume: Gaussian::new(thread.volume_width_deg),
            cover: thread.cover,
            binormal: [-s, c, 0.0],
            frames: frames.collect(),
        }
    }

    fn seen(&self, light: Vec3, view: Vec3) -> Seen {
        let between = dot(light, view);
        let (bi, br) = (dot(light, self.binormal), dot(view, self.binormal));
        let (around_i, around_r) = (from_sine(bi), from_sine(br));
        let tilt_d = angle_between(between - bi * br, around_i * around_r);
        let mut seen = Seen {
            scattered: [[0.0; 3]; 2],
            weight: 0.0,
        };
        for (tangent, normal) in &self.frames {
            let (ni, nr) = (dot(light, *normal).max(0.0), dot(view, *normal).max(0.0));
            let p = shadowing(ni / around_i, nr / around_r, tilt_d);
            seen.weight += p;
            if p == 0.0 {
                continue;
            }
            let (si, sr) = (dot(light, *tangent), dot(view, *tangent));
            let (ci, cr) = (from_sine(si), from_sine(sr));
            let phi_d = angle_between(between - si * sr, ci * cr);
            let m = shadowing(ni / ci, nr / cr, phi_d);
            let theta_h = 0.5 * (si.clamp(-1.0, 1.0).arc_sine() + sr.clamp(-1.0, 1.0).arc_sine());
            let cos2_d = (0.5 * (1.0 + ci * cr + si * sr)).max(1e-9);
            let cos_half = (0.5 * phi_d).cosine();
            let reflected = fresnel(self.index, cos2_d.sqrt() * cos_half);
            let surface = reflected * cos_half * self.surface.at(theta_h);
            let volume = (1.0 - reflected).powi(2)
                * ((1.0 - self.isotropic) * self.volume.at(theta_h) + self.isotropic)
                / (ci + cr);
            let factor = p * m / cos2_d;
            for c in 0..3 {
                let value = factor * (surface + self.albedo[c] * volume);
                seen.scattered[0][c] += value * ci;
                seen.scattered[1][c] += value * cr;
            }
        }
        let tangents = self.frames.len().max(1) as f64;
        Seen {
            scattered: seen.scattered.map(|sum| sum.map(|v| v / tangents)),
            weight: seen.weight / tangents,
        }
    }
}

/// The cosine of the angle of this sine, away from zero.
fn from_sine(sine: f64) -> f64 {
    (1.0 - sine * sine).max(1e-12).sqrt()
}

/// The angle, 0 ..= π, between two projected vectors from their product and that of their lengths.
fn angle_between(product: f64, lengths: f64) -> f64 {
    (product / lengths).clamp(-1.0, 1.0).arc_cosine()
}

/// M, or P: two cosines (not negative) as independent, and where the angle between them is small as
/// correlated.
fn shadowing(cos_i: f64, cos_r: f64, difference: f64) -> f64 {
    let u = (-0.5 * (difference / SHADOW_WIDTH).powi(2)).exponential();
    (1.0 - u) * cos_i * cos_r + u * cos_i.min(cos_r)
}

/// Fresnel's reflectance of unpolarised light at a dielectric, from outside.
fn fresnel(index: f64, cos: f64) -> f64 {
    let cos = cos.clamp(0.0, 1.0);
    let inside = (1.0 - (1.0 - cos * cos) / (index * index)).max(0.0).sqrt();
    let s = (cos - index * inside) / (cos + index * inside);
    let p = (index * cos - inside) / (index * cos + inside);
    0.5 * (s * s + p * p)
}

#[cfg(test)]
mod tests {
    use super::super::{Material, checks};
    use super::*;

    #[test]
    fn fresnel_has_its_known_values() {
        assert!((fresnel(1.5, 1.0) - 0.04).abs() < 1e-12);
        assert!((fresnel(1.5, 0.0) - 1.0).abs() < 1e-12);
        // At Brewster's angle half of s is left: ((n² − 1)/(n² + 1))²/2.
        let brewster = 1.5f64.arc_tangent().cosine();
        assert!((fresnel(1.5, brewster) - 0.5 * (1.25f64 / 3.25).powi(2)).abs() < 1e-12);
    }

    #[test]
    fn a_single_flat_thread_has_the_value_worked_out_by_hand() {
        let thread = Thread {
            index: 1.5,
            albedo: [0.5; 3],
            isotropic: 1.0,
            surface_width_deg: 10.0,
            volume_width_deg: 20.0,
            cover: 0.5,
            azimuth_deg: 0.0,
            tilts_deg: vec![0.0],
        };
        let other = Thread {
            azimuth_deg: 90.0,
            ..thread.clone()
        };
        let model = Microcylinder::new(&[thread, other]);
        // Light and view along the normal: φd = θh = θd = 0, M = P = 1, Fr = 0.04.
        let g = 1.0 / (10f64.to_radians() * (2.0 * PI).sqrt());
        let expected = 0.04 * g + 0.5 * 0.96f64.powi(2) / 2.0;
        let found = model.eval([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]);
        assert!((found[1] - expected).abs() < 1e-9, "{found:?} {expected}");
    }

    #[test]
    fn the_published_cloths_are_not_negative_and_their_means_reciprocal() {
        for material in Material::CLOTHS {
            let model = Material::cloth(material).unwrap();
            let mean = Reciprocal(model.clone());
            let mut skew: f64 = 0.0;
            for (light, view) in checks::pairs() {
                let (f, g) = (model.eval(light, view), model.eval(view, light));
                let (m, n) = (mean.eval(light, view), mean.eval(view, light));
                for c in 0..3 {
                    assert!(f[c] >= 0.0 && f[c].is_finite(), "{light:?} {view:?} {f:?}");
                    assert!((m[c] - 0.5 * (f[c] + g[c])).abs() <= 1e-9 * (1.0 + m[c]));
                    assert!((m[c] - n[c]).abs() <= 1e-9 * (1.0 + m[c]));
                    skew = skew.max((f[c] - g[c]).abs() / (f[c] + g[c] + 1e-12));
                }
            }
            assert!(skew > 0.1, "the formula itself is not reciprocal: {skew}");
        }
    }
}
