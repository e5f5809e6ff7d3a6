//! The geometric model of the light.

use gonia_brdf::Direction;

/// An ideal point light over the target.
pub struct IdealLight {
    at_mm: [f64; 3],
    distance_mm: f64,
}

impl IdealLight {
    /// At a distance from the centre, in a direction.
    pub fn new(light: Direction, distance_m: f64) -> Self {
        let distance_mm = distance_m * 1000.0;
        Self {
            at_mm: light.to_vec3().map(|c| c * distance_mm),
            distance_mm,
        }
    }

    /// Irradiance cos θi · (d0/d)² at a point of the target (mm), 1 below the light at its distance.
    pub fn irradiance(&self, at_mm: [f64; 2]) -> f64 {
        let d = [self.at_mm[0] - at_mm[0], self.at_mm[1] - at_mm[1]];
        let z = self.at_mm[2];
        let inverse2 = 1.0 / (d[0] * d[0] + d[1] * d[1] + z * z);
        z * inverse2.sqrt() * self.distance_mm * self.distance_mm * inverse2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Elementary;

    #[test]
    fn irradiance_follows_cosine_and_distance() {
        let light = IdealLight::new(Direction::from_deg(60.0, 90.0), 1.1);
        assert!((light.irradiance([0.0; 2]) - 0.5).abs() < 1e-12);
        // Straight below the light, at half the distance.
        let below = 1100.0 * 60f64.to_radians().sine();
        assert!((light.irradiance([0.0, below]) - 4.0).abs() < 1e-9);
    }
}
