//! A sphere covered with the material.

use crate::{Light, Picture, TangentFrame};
use gonia_brdf::Brdf;
use gonia_brdf::Elementary;
use gonia_brdf::direction::Vec3;

/// Radius in the picture, whose half side is 1.
const RADIUS: f64 = 0.96;

/// Draws a sphere, `px` × `px` pixels of `side`² points. The material's x axis runs along the
/// parallels towards the right, its y axis along the meridians towards the north pole, which is
/// straight up; so threads show as on a globe wound around.
pub fn sphere(brdf: &dyn Brdf, lights: &[Light], px: usize, side: usize) -> Picture {
    Picture::draw(brdf, lights, (px, px), side, |x, y| {
        let (x, y) = (x / RADIUS, y / RADIUS);
        let z2 = 1.0 - x * x - y * y;
        (z2 > 0.0).then(|| frame_at([x, y, z2.sqrt()]))
    })
}

/// The frame at a point of the unit sphere that is not a pole.
fn frame_at(normal: Vec3) -> TangentFrame {
    let [x, y, z] = normal;
    // up × normal, and normal × tangent.
    let s = 1.0 / x.hypotenuse(z).max(1e-12);
    let tangent = [z * s, 0.0, -x * s];
    let bitangent = [-x * y * s, (x * x + z * z) * s, -y * z * s];
    TangentFrame {
        tangent,
        bitangent,
        normal,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::single;
    use gonia_brdf::direction::dot;
    use std::f64::consts::PI;

    struct Lambert;
    impl Brdf for Lambert {
        fn eval(&self, _: Vec3, _: Vec3) -> [f64; 3] {
            [1.0 / PI; 3]
        }
    }

    /// Bright where the half vector leans along the material's x axis.
    struct Brushed;
    impl Brdf for Brushed {
        fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
            let h = [light[0] + view[0], light[1] + view[1], light[2] + view[2]];
            [(-(h[1] / h[2]).powi(2) / 0.02).exponential(); 3]
        }
    }

    #[test]
    fn the_frame_is_right_handed_and_points_right_and_up_in_front() {
        for normal in [[0.0, 0.0, 1.0], [0.6, 0.48, 0.64], [-0.6, -0.64, 0.48]] {
            let TangentFrame {
                tangent: t,
                bitangent: b,
                normal: n,
            } = frame_at(normal);
            for (u, v) in [(t, b), (b, n), (n, t)] {
                assert!(dot(u, v).abs() < 1e-12 && (dot(u, u) - 1.0).abs() < 1e-12);
            }
            let cross = [
                t[1] * b[2] - t[2] * b[1],
                t[2] * b[0] - t[0] * b[2],
                t[0] * b[1] - t[1] * b[0],
            ];
            assert!(dot(cross, n) > 0.999_999);
        }
        let front = frame_at([0.0, 0.0, 1.0]);
        assert_eq!(
            (front.tangent, front.bitangent),
            ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        );
    }

    #[test]
    fn a_white_sphere_shows_the_cosine_of_its_light() {
        let light = Light {
            towards: [0.0, 0.0, 1.0],
            irradiance: [PI; 3],
        };
        let picture = sphere(&Lambert, &[light], 101, 1);
        let at = |x: usize, y: usize| picture.rgb[y * 101 + x][0];
        assert!((at(50, 50) - 1.0).abs() < 1e-3);
        let x = (2.0 * 75.5 / 101.0 - 1.0) / RADIUS;
        assert!((f64::from(at(75, 50)) - (1.0 - x * x).sqrt()).abs() < 1e-3);
        assert_eq!(picture.cover[0], 0.0);
        let covered: f32 = sphere(&Lambert, &single(), 100, 3).cover.iter().sum();
        assert!((f64::from(covered) / 1e4 - PI * RADIUS * RADIUS / 4.0).abs() < 2e-3);
    }

    #[test]
    fn an_anisotropic_highlight_lies_along_its_parallel() {
        let picture = sphere(
            &Brushed,
            &[Light {
                towards: [0.0, 0.0, 1.0],
                irradiance: [1.0; 3],
            }],
            101,
            1,
        );
        let at = |x: usize, y: usize| picture.rgb[y * 101 + x][0];
        assert!(at(75, 50) > 10.0 * at(50, 75));
    }
}
