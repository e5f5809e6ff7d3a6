//! Directional lights.

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, normalize};
use gonia_brdf::model::shading::Light;
use std::f64::consts::PI;

/// A single light from above the camera, 40° from the line of sight.
pub fn single() -> Vec<Light> {
    from_above(40.0, 0.0)
}

/// A single light, so many degrees above the line of sight and to the right of it.
pub fn from_above(up_deg: f64, right_deg: f64) -> Vec<Light> {
    let (up_sin, up_cos) = up_deg.to_radians().sine_cosine();
    let (right_sin, right_cos) = right_deg.to_radians().sine_cosine();
    vec![Light {
        towards: [up_cos * right_sin, up_sin, up_cos * right_cos],
        irradiance: [PI; 3],
    }]
}

/// A key light from the upper left, a fill from the right, a rim from behind, and a soft dome.
pub fn studio() -> Vec<Light> {
    let light = |towards: Vec3, white: f64| Light {
        towards: normalize(towards),
        irradiance: [white * PI; 3],
    };
    let mut lights = vec![
        light([-0.55, 0.60, 0.65], 0.75),
        light([0.80, 0.10, 0.55], 0.22),
        light([0.35, 0.75, -0.45], 0.45),
    ];
    lights.extend(dome(DOME_LIGHTS, 0.25));
    lights
}

const DOME_LIGHTS: usize = 20;

/// Lights spread evenly over the upper half of space (a Fibonacci spiral), brighter towards the
/// zenith; together they give a surface that faces up about `white` of a white one.
fn dome(n: usize, white: f64) -> Vec<Light> {
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..n)
        .map(|k| {
            let y = (k as f64 + 0.5) / n as f64;
            let r = (1.0 - y * y).sqrt();
            let (s, c) = (golden * k as f64).sine_cosine();
            let share = (0.4 + 0.6 * y) / n as f64 / 0.4;
            Light {
                towards: [r * c, y, r * s],
                irradiance: [white * PI * share; 3],
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_light_is_a_unit_vector_and_the_dome_keeps_its_promise() {
        for light in studio().iter().chain(&single()) {
            let [x, y, z] = light.towards;
            assert!((x * x + y * y + z * z - 1.0).abs() < 1e-12);
        }
        let up: f64 = dome(400, 0.25)
            .iter()
            .map(|l| l.irradiance[0] * l.towards[1])
            .sum();
        assert!((up / PI - 0.25).abs() < 1e-3, "{}", up / PI);
    }
}
