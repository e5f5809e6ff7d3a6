//! The light: a point source with a beam that is neither uniform nor centred.

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot};
use gonia_rig::Placement;

/// A smooth beam, Gaussian in the tangent of the angle off its own axis, which does not quite point
/// at the target's centre. Relative to its value at the centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Standard deviation, as an angle in degrees.
    pub width_deg: f64,
    /// Where the beam's axis points, right and up of the centre as the light sees it, degrees.
    pub axis_deg: [f64; 2],
}

impl Default for Beam {
    /// About 15 % darker at the far edge of the disc than at the centre.
    fn default() -> Self {
        Self {
            width_deg: 26.0,
            axis_deg: [2.0, -1.5],
        }
    }
}

/// The irradiance over the target.
pub struct LightField {
    at_m: Vec3,
    placement: Placement,
    distance_m: f64,
    beam: Option<PreparedBeam>,
}

struct PreparedBeam {
    axis: [f64; 2],
    scale: f64,
    at_centre: f64,
}

impl LightField {
    pub fn new(distance_m: f64, light: &Placement, beam: Option<Beam>) -> Self {
        Self {
            at_m: light.at_mm.map(|c| c * 1e-3),
            placement: *light,
            distance_m,
            beam: beam.map(|b| {
                let axis = b.axis_deg.map(|a| a.to_radians().tangent());
                let scale = -0.5 / b.width_deg.to_radians().tangent().powi(2);
                PreparedBeam {
                    axis,
                    scale,
                    at_centre: scale * (axis[0] * axis[0] + axis[1] * axis[1]),
                }
            }),
        }
    }

    /// The unit vector towards the light and the irradiance at a point of the target (metres).
    pub fn at(&self, point_m: [f64; 2]) -> (Vec3, f64) {
        let to = [
            self.at_m[0] - point_m[0],
            self.at_m[1] - point_m[1],
            self.at_m[2],
        ];
        let inverse2 = 1.0 / dot(to, to);
        let inverse = inverse2.sqrt();
        let unit = to.map(|c| c * inverse);
        let fall_off = self.distance_m * self.distance_m * inverse2;
        let beam = match &self.beam {
            Some(beam) => self.beam_at(beam, to),
            None => 1.0,
        };
        (unit, beam * unit[2].max(0.0) * fall_off)
    }

    fn beam_at(&self, beam: &PreparedBeam, to_light: Vec3) -> f64 {
        let depth = dot(to_light, self.placement.back);
        let u = -dot(to_light, self.placement.right) / depth - beam.axis[0];
        let v = -dot(to_light, self.placement.up) / depth - beam.axis[1];
        (beam.scale * (u * u + v * v) - beam.at_centre).exponential()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;
    use gonia_rig::{ArmGeometry, TargetPlace};

    #[test]
    fn irradiance_is_one_at_the_centre_and_falls_with_distance_and_cosine() {
        let at = |theta| {
            let (arm, target) = (ArmGeometry::default(), TargetPlace::default());
            arm.placement(Direction::from_deg(theta, 0.0), 1100.0, &target)
        };
        let normal = LightField::new(1.1, &at(0.0), Some(Beam::default()));
        assert!((normal.at([0.0; 2]).1 - 1.0).abs() < 1e-12);
        let point = LightField::new(1.1, &at(60.0), None);
        assert!((point.at([0.0; 2]).1 - 0.5).abs() < 1e-12);
        // Straight below the light: closer and at normal incidence.
        let below = 1.1 * 60f64.to_radians().sine();
        assert!((point.at([below, 0.0]).1 - 4.0).abs() < 1e-9);
    }
}
