//! The material bent around an upright cylinder, as it is photographed (the paper's Fig. 6).

use crate::{Light, Picture, TangentFrame};
use gonia_brdf::Brdf;
use gonia_brdf::Elementary;

/// Draws what fills the outline of a smooth upright cylinder seen from the side: the picture's left
/// and right edges are the cylinder's. The material's x axis runs around it towards the right, its
/// y axis up along it, both turned anticlockwise by `turn_deg`.
pub fn bent(brdf: &dyn Brdf, lights: &[Light], size: (usize, usize), turn_deg: f64) -> Picture {
    let (turn_sin, turn_cos) = turn_deg.to_radians().sine_cosine();
    Picture::draw(brdf, lights, size, 1, |x, _| {
        let forwards = (1.0 - x * x).max(0.0).sqrt();
        let (around, up) = ([forwards, 0.0, -x], [0.0, 1.0, 0.0]);
        let mix = |a: f64, b: f64| [0, 1, 2].map(|k| a * around[k] + b * up[k]);
        Some(TangentFrame {
            tangent: mix(turn_cos, turn_sin),
            bitangent: mix(-turn_sin, turn_cos),
            normal: [x, 0.0, forwards],
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::from_above;
    use gonia_brdf::direction::Vec3;
    use gonia_brdf::model::Lambert;

    /// Seen only across the material's x axis.
    struct Striped;
    impl Brdf for Striped {
        fn eval(&self, _: Vec3, view: Vec3) -> [f64; 3] {
            [view[0] * view[0]; 3]
        }
    }

    #[test]
    fn a_diffuse_cylinder_darkens_towards_its_sides_and_the_threads_turn() {
        let grey = Lambert { albedo: [0.5; 3] };
        let lights = from_above(40.0, 0.0);
        let picture = bent(&grey, &lights, (101, 7), 0.0);
        let at = |column: usize| f64::from(picture.rgb[3 * 101 + column][1]);
        let cosine = 40f64.to_radians().cosine();
        assert!((at(50) / (0.5 * cosine) - 1.0).abs() < 1e-3);
        assert!((at(75) / at(50) - (1.0f64 - (50.0f64 / 101.0).powi(2)).sqrt()).abs() < 1e-3);
        let across = bent(&Striped, &lights, (101, 1), 0.0);
        let along = bent(&Striped, &lights, (101, 1), 90.0);
        assert!(across.rgb[80][0] > 0.05 && along.rgb[80][0] < 1e-9);
    }
}
