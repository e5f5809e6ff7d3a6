//! Whether the reference's radiance is proportional to the light that falls on it.
//!
//! At the target's centre a known reference over ideal irradiance, I/E over its ρ/π, is the same in every
//! frame. An offset of b (a black level that is wrong, stray light) adds b/E, which grows as the light
//! sinks; so does a tone curve. A line through I/E over 1/E tells how much.

use crate::process::reference::ReferenceFrame;
use crate::process::reflectance::KnownReference;
use gonia_imaging::IdealLight;
use gonia_rig::{Remark, Rig};

/// Fewer frames tell nothing, nor do lights that differ less than this in irradiance.
const LEAST_FRAMES: usize = 4;
const LEAST_RANGE: f64 = 1.5;
/// An offset below this share of the brightest frame is nothing to speak of: real references depart from
/// their reflectance by as much.
const LEAST_OFFSET: f64 = 0.03;
/// An offset must explain this much of the differences between frames, or they are something else's.
const LEAST_EXPLAINED: f64 = 0.9;

/// What speaks against radiance that is proportional to light. `centre` is the grid's middle point.
pub fn warning(
    rig: &Rig,
    frames: &[ReferenceFrame],
    reference: &KnownReference,
    centre: usize,
) -> Option<Remark> {
    let points: Vec<[f64; 2]> = frames
        .iter()
        .filter_map(|frame| {
            let light = IdealLight::new(rig, frame.reading.light);
            let irradiance = light.irradiance([0.0; 2]);
            let known = reference.at(frame.pose.light.to_vec3(), frame.pose.view.to_vec3());
            let seen = frame.relative.get(centre)?;
            let ratio: f64 = (0..3).map(|c| f64::from(seen[c] / known[c])).sum();
            (ratio.is_finite() && irradiance > 0.0).then(|| [1.0 / irradiance, ratio])
        })
        .collect();
    let offset = offset(&points)?;
    let darkest = points.iter().map(|p| p[0]).fold(0.0, f64::max);
    let brightest = points.iter().map(|p| p[0]).fold(f64::INFINITY, f64::min);
    let range = (1.0 + offset * darkest) / (1.0 + offset * brightest) - 1.0;
    Some(Remark::new(
        "reference",
        format_args!(
            "under the weakest light it is {:+.0} % brighter, against the strongest, than its reflectance says, as an offset of {:+.1} % of the brightest frame (or counts that are not linear) would make it",
            100.0 * range,
            100.0 * offset * brightest
        ),
        "check black_counts in rig.toml, stray light, that values are linear, and that the reference reflects alike under all lights (else give its table)",
    ))
}

/// The offset over what is proportional, where it is large and explains the points (1/E, I/E).
fn offset(points: &[[f64; 2]]) -> Option<f64> {
    let n = points.len() as f64;
    let (least, most) = points
        .iter()
        .fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), p| {
            (l.min(p[0]), m.max(p[0]))
        });
    if points.len() < LEAST_FRAMES || most < LEAST_RANGE * least {
        return None;
    }
    let mean = |of: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p[0]), mean(&|p| p[1]));
    let xx = mean(&|p| (p[0] - x).powi(2));
    let xy = mean(&|p| (p[0] - x) * (p[1] - y));
    let yy = mean(&|p| (p[1] - y).powi(2));
    let slope = xy / xx;
    let constant = y - slope * x;
    let explained = xy * xy / (xx * yy);
    let offset = slope / constant;
    // Written so that what is not a number is no offset.
    let is_clear =
        constant > 0.0 && (offset * least).abs() > LEAST_OFFSET && explained > LEAST_EXPLAINED;
    is_clear.then_some(offset)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Elementary;

    /// I/E of frames under these irradiances, with an offset, a power and some noise.
    fn points(offset: f64, power: f64, noise: f64) -> Vec<[f64; 2]> {
        let lights = [1.0, 0.97, 0.87, 0.71, 0.5, 0.26, 0.9, 0.6];
        let point = |(k, e): (usize, &f64)| {
            let wobble = 1.0 + noise * (((k * 37) % 11) as f64 / 5.0 - 1.0);
            [1.0 / e, (e.power(power) + offset) / e * wobble]
        };
        lights.iter().enumerate().map(point).collect()
    }

    #[test]
    fn an_offset_and_a_tone_curve_are_found_and_noise_is_not() {
        for (true_offset, noise) in [(0.05, 0.005), (0.2, 0.02), (-0.05, 0.005)] {
            let found = offset(&points(true_offset, 1.0, noise)).unwrap();
            assert!((found - true_offset).abs() < 0.02, "{true_offset} {found}");
        }
        assert!(offset(&points(0.0, 0.45, 0.01)).is_some());
        for noise in [0.0, 0.01, 0.1, 0.3] {
            assert_eq!(offset(&points(0.0, 1.0, noise)), None, "{noise}");
        }
        assert_eq!(offset(&points(0.01, 1.0, 0.001)), None);
        assert_eq!(offset(&points(0.2, 1.0, 0.0)[..3]), None);
        assert_eq!(offset(&points(0.2, 1.0, 0.0)[..2].repeat(4)), None);
    }
}
