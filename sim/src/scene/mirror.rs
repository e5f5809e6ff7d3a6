//! A plane mirror in the sample's place: dark, but for the lamp that it reflects.

use super::SceneGeometry;
use super::optics::Optics;
use super::target::disc;
use gonia_brdf::Elementary;
use gonia_brdf::direction::{dot, normalize};
use gonia_rig::{OrientationMark, Placement};
use std::f64::consts::PI;

/// A mirror, and the lamp that it reflects: a ball that shines the same everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorPlate {
    /// How far its surface lies above the target's, mm.
    pub height_mm: f64,
    /// Its tilt against the target about x and y, degrees.
    pub tilt_deg: [f64; 2],
    /// What it reflects; black glass 0.04.
    pub reflectance: f64,
    /// The lamp's radius, mm.
    pub lamp_radius_mm: f64,
}

impl Default for MirrorPlate {
    fn default() -> Self {
        Self {
            height_mm: 0.0,
            tilt_deg: [0.0; 2],
            reflectance: 0.04,
            lamp_radius_mm: 15.0,
        }
    }
}

/// The lamp's image in a frame.
pub struct LampImage {
    disc: OrientationMark,
    sigma_px: f64,
    radiance: f64,
}

impl LampImage {
    /// `None` where the camera is below the mirror.
    pub fn new(
        mirror: &MirrorPlate,
        light: &Placement,
        geometry: &SceneGeometry,
        optics: &Optics,
    ) -> Option<Self> {
        let [x, y] = mirror.tilt_deg.map(|t| t.to_radians().tangent());
        let normal = normalize([y, -x, 1.0]);
        let above = dot(light.at_mm, normal) - mirror.height_mm * normal[2];
        let image = [0, 1, 2].map(|i| 1e-3 * (light.at_mm[i] - 2.0 * above * normal[i]));
        let (at, px_per_m) = optics.project(image)?;
        // At the centre of the target and at normal incidence the irradiance is 1.
        let radius_m = 1e-3 * mirror.lamp_radius_mm;
        let radiance = geometry.light_distance_m.powi(2) / (PI * radius_m * radius_m);
        Some(Self {
            disc: OrientationMark {
                at_mm: at,
                radius_mm: radius_m * px_per_m,
            },
            sigma_px: optics.sigma_px(),
            radiance: mirror.reflectance * radiance,
        })
    }

    /// Radiance that a pixel sees of it.
    pub fn radiance(&self, pixel: [f64; 2]) -> f64 {
        self.radiance * disc(self.disc, pixel, [self.sigma_px; 2])
    }
}
