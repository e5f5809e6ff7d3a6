//! The directions that the paper measures from (Section III, after Sattler et al. 2003).

use crate::direction::Direction;

/// A ring of directions: polar angle in degrees and number of equal azimuthal steps from φ = 0.
pub type Ring = (f64, usize);

/// The 81 directions of views and lights: rings of 15° in polar angle.
pub const UNIFORM_RINGS: [Ring; 6] = [
    (0.0, 1),
    (15.0, 6),
    (30.0, 12),
    (45.0, 18),
    (60.0, 20),
    (75.0, 24),
];

/// The oblique lights: 24 azimuths at 85°. The paper's "azimuthal step 24°" must be their number,
/// since 1944 = 81 × 24.
pub const OBLIQUE_LIGHTS: Ring = (85.0, 24);

/// All directions of some rings, ring by ring.
pub fn directions(rings: &[Ring]) -> Vec<Direction> {
    rings
        .iter()
        .flat_map(|(theta, n)| {
            (0..*n).map(move |k| Direction::from_deg(*theta, 360.0 * k as f64 / *n as f64))
        })
        .collect()
}

/// The paper's 81 views.
pub fn paper_views() -> Vec<Direction> {
    directions(&UNIFORM_RINGS)
}

/// The paper's 105 lights: the same 81, and 24 oblique ones.
pub fn paper_lights() -> Vec<Direction> {
    let mut lights = paper_views();
    lights.extend(directions(&[OBLIQUE_LIGHTS]));
    lights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_measures_8505_images() {
        assert_eq!(paper_views().len(), 81);
        assert_eq!(paper_lights().len() * paper_views().len(), 8505);
        let last = paper_views()[80];
        assert!((last.theta_deg() - 75.0).abs() < 1e-9 && (last.phi_deg() - 345.0).abs() < 1e-9);
    }
}
