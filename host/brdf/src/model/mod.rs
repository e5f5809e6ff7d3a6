//! Analytic BRDF models: the simulator's materials, and what measurements are compared with and
//! fitted by ([`crate::fit`]).

pub mod ggx;
pub mod gltf;
pub mod kurt;
pub mod lambert;
pub mod material;
pub mod microcylinder;
pub mod openpbr;
pub mod principled;
pub mod shading;
pub mod ward;

pub use ggx::Ggx;
pub use gltf::Gltf;
pub use kurt::{Kurt, KurtLobe};
pub use lambert::Lambert;
pub use material::Material;
pub use microcylinder::{Microcylinder, Reciprocal, Thread};
pub use openpbr::OpenPbr;
pub use principled::Principled;
pub use ward::Ward;

use crate::direction::{Vec3, normalize};
use shading::{Light, TangentFrame, shade_one_by_one};

/// A BRDF in 1/sr, per channel.
pub trait Brdf: Send + Sync {
    /// Value for unit vectors towards the light and the viewer, both with z > 0. The cosine of the
    /// light is not included.
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3];

    /// The radiance towards a viewer, in the direction `viewer`, of each of many points of a surface
    /// under the same lights; none where the viewer is behind the surface.
    fn shade(&self, points: &[TangentFrame], lights: &[Light], viewer: Vec3) -> Vec<[f32; 3]> {
        shade_one_by_one(self, points, lights, viewer)
    }
}

/// The unit vector half-way between two.
fn half_vector(a: Vec3, b: Vec3) -> Vec3 {
    normalize([a[0] + b[0], a[1] + b[1], a[2] + b[2]])
}

/// A vector in a frame whose x axis lies at the azimuth of the given cosine and sine.
fn turned(v: Vec3, cos: f64, sin: f64) -> Vec3 {
    [v[0] * cos + v[1] * sin, v[1] * cos - v[0] * sin, v[2]]
}

/// Schlick's approximation of Fresnel's reflectance.
fn schlick(f0: f64, cos: f64) -> f64 {
    f0 + (1.0 - f0) * (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Fresnel's unpolarised reflectance of a dielectric of this index, at least 1.
fn dielectric(cos: f64, index: f64) -> f64 {
    let cos_t = (1.0 - (1.0 - cos * cos) / (index * index)).max(0.0).sqrt();
    let s = (cos - index * cos_t) / (cos + index * cos_t);
    let p = (cos_t - index * cos) / (cos_t + index * cos);
    0.5 * (s * s + p * p)
}

/// What every model is held to.
#[cfg(test)]
mod checks {
    use super::Brdf;
    use crate::direction::{Direction, Vec3};
    use crate::elementary::Elementary;
    use std::f64::consts::{FRAC_PI_2, TAU};

    /// Pairs of directions all over both hemispheres, the pole and 86° among them.
    pub fn pairs() -> impl Iterator<Item = (Vec3, Vec3)> {
        let at = |k: usize| Direction::from_deg((k * 43 % 87) as f64, (k * 77) as f64).to_vec3();
        (0..60).flat_map(move |i| (0..60).map(move |v| (at(i), at(v))))
    }

    pub fn is_positive_and_reciprocal(model: &dyn Brdf) {
        for (light, view) in pairs() {
            let (f, g) = (model.eval(light, view), model.eval(view, light));
            for c in 0..3 {
                assert!(f[c] > 0.0 && f[c].is_finite(), "{light:?} {view:?}: {f:?}");
                assert!((f[c] - g[c]).abs() <= 1e-9 * f[c], "{f:?} {g:?}");
            }
        }
    }

    /// Directional albedo ∫ f cos θv dω by the midpoint rule.
    pub fn albedo(model: &dyn Brdf, theta_i_deg: f64, phi_i_deg: f64) -> [f64; 3] {
        let light = Direction::from_deg(theta_i_deg, phi_i_deg).to_vec3();
        let (n_theta, n_phi) = (180, 360);
        let mut sum = [0.0; 3];
        for t in 0..n_theta {
            let theta = (t as f64 + 0.5) / n_theta as f64 * FRAC_PI_2;
            for p in 0..n_phi {
                let phi = p as f64 / n_phi as f64 * TAU;
                let view = Direction { theta, phi }.to_vec3();
                let f = model.eval(light, view);
                let projected =
                    theta.sine() * view[2] * (FRAC_PI_2 / n_theta as f64) * (TAU / n_phi as f64);
                for c in 0..3 {
                    sum[c] += f[c] * projected;
                }
            }
        }
        sum
    }
}
