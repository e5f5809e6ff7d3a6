//! Made-up materials that nothing in gonia was chosen on, of kinds that the demo's do not have.

use gonia_brdf::direction::{Vec3, normalize};
use gonia_brdf::model::Ggx;
use gonia_brdf::{Brdf, Elementary};
use std::sync::Arc;

/// Their names.
pub const NAMES: [&str; 4] = ["retro", "plastic", "velvet", "twill"];

/// A lobe around the light's own direction over a dull base: the cosine between light and view falls from 1 by
/// `exp(-x²/2)` with x in units of `width_deg`.
struct Retro {
    base: [f64; 3],
    peak: f64,
    width_deg: f64,
}

impl Brdf for Retro {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let apart = (0..3).map(|k| (light[k] - view[k]).powi(2)).sum::<f64>();
        let width = self.width_deg.to_radians();
        let lobe = self.peak * (-0.5 * apart / (width * width)).exponential();
        self.base.map(|base| base + lobe)
    }
}

/// Bright where light or view graze: a dark base, and a rim.
struct Velvet;

impl Brdf for Velvet {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let rim = |d: Vec3| (1.0 - d[2] * d[2]).max(0.0).powi(4);
        [0.02, 0.008, 0.012].map(|base| base * (1.0 + 6.0 * (rim(light) + rim(view))))
    }
}

/// Two lobes whose half vectors lean to either side of the normal, as the faces of a diagonal weave do.
struct Twill;

impl Brdf for Twill {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let h = normalize([0, 1, 2].map(|k| light[k] + view[k]));
        let lobe = |lean_deg: f64, azimuth_deg: f64, sharp: f64| {
            let (lean, azimuth) = (lean_deg.to_radians(), azimuth_deg.to_radians());
            let axis = [
                lean.sine() * azimuth.cosine(),
                lean.sine() * azimuth.sine(),
                lean.cosine(),
            ];
            let cosine: f64 = (0..3).map(|k| h[k] * axis[k]).sum();
            (sharp * (cosine - 1.0)).exponential()
        };
        let (a, b) = (lobe(14.0, 35.0, 120.0), lobe(9.0, 215.0, 60.0));
        [[0.05, 0.2, 0.1], [0.04, 0.18, 0.12], [0.03, 0.1, 0.2]]
            .map(|[base, of_a, of_b]| base + of_a * a + of_b * b)
    }
}

/// The material of one of [`NAMES`]; none of another name.
pub fn named(name: &str) -> Option<Arc<dyn Brdf>> {
    Some(match name {
        // A lobe of 5°, and no arm that hides it.
        "retro" => Arc::new(Retro {
            base: [0.1, 0.09, 0.05],
            peak: 1.0,
            width_deg: 5.0,
        }),
        "plastic" => Arc::new(Ggx {
            diffuse: [0.25, 0.06, 0.04],
            specular: [1.0; 3],
            f0: 0.04,
            alpha_x: 0.06,
            alpha_y: 0.06,
            azimuth_deg: 0.0,
        }),
        "velvet" => Arc::new(Velvet),
        "twill" => Arc::new(Twill),
        _ => return None,
    })
}
