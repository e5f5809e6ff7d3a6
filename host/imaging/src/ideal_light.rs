//! The geometric model of the light.

use gonia_brdf::direction::dot;
use gonia_brdf::{Direction, Elementary, Vec3};
use gonia_rig::{Placement, Rig};

/// The rig's light over the target: a point with a smooth beam.
#[derive(Clone, Copy, Debug)]
pub struct IdealLight {
    placement: Placement,
    distance_mm: f64,
    /// As in `rig.toml`; `None` where it is the same in all directions.
    beam: Option<[f64; 5]>,
}

impl IdealLight {
    /// The light of a rig when its arm reads `reading`.
    pub fn new(rig: &Rig, reading: Direction) -> Self {
        let beam = rig.light.beam;
        Self {
            placement: rig.light_at(reading),
            distance_mm: 1000.0 * rig.light.distance_m,
            beam: (beam != [0.0; 5]).then_some(beam),
        }
    }

    /// The unit vector towards it from a point of the target (mm): eq. (1) of the paper.
    pub fn direction_from(&self, at_mm: [f64; 2]) -> Vec3 {
        self.placement.direction_from(at_mm)
    }

    /// Irradiance cos θi · (d0/d)² times the beam at a point of the target (mm): 1 straight below the light
    /// at its distance d0, in the middle of its beam.
    pub fn irradiance(&self, at_mm: [f64; 2]) -> f64 {
        let light = self.placement.at_mm;
        let d = [light[0] - at_mm[0], light[1] - at_mm[1], light[2]];
        let inverse2 = 1.0 / dot(d, d);
        let irradiance = d[2] * inverse2.sqrt() * self.distance_mm * self.distance_mm * inverse2;
        match &self.beam {
            Some(beam) => irradiance * self.beam_towards(beam, d),
            None => irradiance,
        }
    }

    /// The logarithm of [`Self::irradiance`], for less; −∞ where the light is below the horizon.
    pub fn ln_irradiance(&self, at_mm: [f64; 2]) -> f64 {
        let light = self.placement.at_mm;
        let d = [light[0] - at_mm[0], light[1] - at_mm[1], light[2]];
        let inverse2 = 1.0 / dot(d, d);
        let even = d[2] * inverse2.sqrt() * self.distance_mm * self.distance_mm * inverse2;
        let ln_beam = self.beam.map_or(0.0, |beam| self.ln_beam_towards(&beam, d));
        even.max(0.0).natural_log() + ln_beam
    }

    /// The beam towards a point from which the light is `to_light` away (mm), relative to its centre's.
    fn beam_towards(&self, beam: &[f64; 5], to_light: Vec3) -> f64 {
        self.ln_beam_towards(beam, to_light).exponential()
    }

    fn ln_beam_towards(&self, beam: &[f64; 5], to_light: Vec3) -> f64 {
        let depth = dot(to_light, self.placement.back);
        let u = -dot(to_light, self.placement.right) / depth;
        let v = -dot(to_light, self.placement.up) / depth;
        let [a, b, aa, ab, bb] = beam;
        a * u + b * v + aa * u * u + ab * u * v + bb * v * v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn irradiance_follows_cosine_and_distance() {
        let light = IdealLight::new(&Rig::paper(400), Direction::from_deg(60.0, 90.0));
        assert!((light.irradiance([0.0; 2]) - 0.5).abs() < 1e-12);
        // Straight below the light, at half the distance.
        let below = 1100.0 * 60f64.to_radians().sine();
        assert!((light.irradiance([0.0, below]) - 4.0).abs() < 1e-9);
    }

    #[test]
    fn the_beam_is_brighter_where_it_points() {
        let mut rig = Rig::paper(400);
        let at = Direction::from_deg(0.0, 0.0);
        let even = IdealLight::new(&rig, at);
        rig.light.beam = [0.5, -0.25, 0.0, 0.0, -2.0];
        let beam = IdealLight::new(&rig, at);
        let factor = |at_mm| beam.irradiance(at_mm) / even.irradiance(at_mm);
        assert!((factor([0.0; 2]) - 1.0).abs() < 1e-12);
        // At φ = 0 the light's right is +y, and up is −x.
        assert!((factor([0.0, 220.0]) - (0.5f64 * 0.2).exponential()).abs() < 1e-12);
        let ln = beam.ln_irradiance([50.0, 220.0]);
        assert!((ln - beam.irradiance([50.0, 220.0]).natural_log()).abs() < 1e-12);
        let up = -0.25 * 0.2 - 2.0 * 0.04;
        assert!((factor([-220.0, 0.0]) - up.exponential()).abs() < 1e-12);
    }
}
