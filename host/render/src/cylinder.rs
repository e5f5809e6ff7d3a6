//! An upright cylinder with the material draped around it: flat at the top, in folds below.

use crate::{Light, Picture, TangentFrame};
use gonia_brdf::Brdf;
use gonia_brdf::Elementary;
use gonia_brdf::direction::{dot, normalize};

/// Radius without folds, and half the height, in the picture, whose half side is 1.
const RADIUS: f64 = 0.66;
const HALF_HEIGHT: f64 = 0.94;
/// Depth of the folds at the bottom, as a share of the radius.
const DEPTH: f64 = 0.075;
/// Folds around the whole cylinder.
const FOLDS: f64 = 9.0;

/// Draws a draped cylinder, `px` × `px` pixels of `side`² points. The material's x axis runs around
/// the cylinder towards the right, its y axis upwards along it.
pub fn cylinder(brdf: &dyn Brdf, lights: &[Light], px: usize, side: usize) -> Picture {
    Picture::draw(brdf, lights, (px, px), side, |x, y| {
        if y.abs() > HALF_HEIGHT {
            return None;
        }
        let azimuth = front_azimuth(x, y)?;
        Some(frame_at(azimuth, y))
    })
}

/// Radius at an azimuth (0 towards the viewer, to the right positive) and height, with its
/// derivatives by both.
fn radius(azimuth: f64, y: f64) -> (f64, f64, f64) {
    // 0 at the top, 1 at the bottom, with a level start.
    let down = (0.5 * (1.0 - y / HALF_HEIGHT)).clamp(0.0, 1.0);
    let depth = DEPTH * RADIUS * down * down;
    let depth_by_y = -DEPTH * RADIUS * down / HALF_HEIGHT;
    // The folds wander a little on their way down.
    let phase = FOLDS * azimuth + 0.5 * y + 0.6;
    let (s, c) = phase.sine_cosine();
    (
        RADIUS + depth * c,
        -FOLDS * depth * s,
        depth_by_y * c - 0.5 * depth * s,
    )
}

/// The azimuth of the surface seen at (x, y): the first one, from the middle outwards, that comes
/// to x; `None` beside the cylinder.
fn front_azimuth(x: f64, y: f64) -> Option<f64> {
    const STEPS: usize = 48;
    let across = |azimuth: f64| radius(azimuth, y).0 * azimuth.sine() - x;
    let outwards = x.signum();
    let step = outwards * std::f64::consts::FRAC_PI_2 / STEPS as f64;
    let last = (0..STEPS).find(|k| across((k + 1) as f64 * step) * outwards >= 0.0)?;
    let (mut inner, mut outer) = (last as f64 * step, (last + 1) as f64 * step);
    for _ in 0..24 {
        let middle = 0.5 * (inner + outer);
        if across(middle) * outwards >= 0.0 {
            outer = middle;
        } else {
            inner = middle;
        }
    }
    Some(0.5 * (inner + outer))
}

/// The frame of the point (r sin α, y, r cos α).
fn frame_at(azimuth: f64, y: f64) -> TangentFrame {
    let (r, r_azimuth, r_y) = radius(azimuth, y);
    let (s, c) = azimuth.sine_cosine();
    let around = normalize([r_azimuth * s + r * c, 0.0, r_azimuth * c - r * s]);
    let up = [r_y * s, 1.0, r_y * c];
    let slant = dot(up, around);
    let bitangent = normalize([
        up[0] - slant * around[0],
        up[1] - slant * around[1],
        up[2] - slant * around[2],
    ]);
    let normal = [
        around[1] * bitangent[2] - around[2] * bitangent[1],
        around[2] * bitangent[0] - around[0] * bitangent[2],
        around[0] * bitangent[1] - around[1] * bitangent[0],
    ];
    TangentFrame {
        tangent: around,
        bitangent,
        normal,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_point_found_is_the_point_seen_and_its_normal_is_square_to_the_surface() {
        for (x, y) in [
            (0.0, 0.9),
            (0.3, 0.2),
            (-0.5, -0.4),
            (0.6, -0.9),
            (-0.62, 0.5),
        ] {
            let azimuth = front_azimuth(x, y).unwrap();
            let point = |a: f64, y: f64| {
                let r = radius(a, y).0;
                [r * a.sine(), y, r * a.cosine()]
            };
            assert!((point(azimuth, y)[0] - x).abs() < 1e-6);
            let frame = frame_at(azimuth, y);
            assert!(frame.normal[2] > 0.0);
            let h = 1e-5;
            for (da, dy) in [(h, 0.0), (0.0, h)] {
                let (p, q) = (point(azimuth - da, y - dy), point(azimuth + da, y + dy));
                let along = normalize([q[0] - p[0], q[1] - p[1], q[2] - p[2]]);
                assert!(dot(along, frame.normal).abs() < 1e-6);
            }
        }
        assert_eq!(front_azimuth(0.9, 0.0), None);
    }
}
