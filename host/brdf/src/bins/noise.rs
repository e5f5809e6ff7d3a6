//! The noise of one sample, from what samples of one cell scatter by about a plane through them.
//!
//! Their scatter about the median would hold the material's slope too, which is several times the noise
//! where highlights are narrow: a material of nothing but narrow highlights would seem to be noisy.

use crate::direction::Direction;
use crate::elementary::Elementary;
use crate::quantile::quantile;
use crate::sample::Sample;

/// Directions of light and view, one after the other.
const COLUMNS: usize = 6;
/// Light and view have two angles each.
const RANK_MAX: usize = 4;
/// Samples of one frame lie on a sheet in these: directions in which they spread less than this share of their
/// largest spread are none.
const SPREAD_MIN: f64 = 0.1;
/// Radians; spreads below are those of rounding.
const ROUNDING: f64 = 1e-5;

/// Variances of the logarithm, per channel, of the samples of one cell about the plane that fits them best, each
/// over the first quartile of what a variance of one would show; `None` where a plane takes all they
/// tell, or a value has no logarithm.
pub fn variances_about_plane<const N: usize>(group: &[Sample<N>]) -> Option<[f32; N]> {
    if group.len() < 2 || group.iter().any(|s| s.rgb.iter().any(|v| *v <= 0.0)) {
        return None;
    }
    let angles = |s: &Sample<N>| {
        let light = Direction::from_deg(s.theta_i_deg.into(), s.phi_i_deg.into()).to_vec3();
        let view = Direction::from_deg(s.theta_v_deg.into(), s.phi_v_deg.into()).to_vec3();
        [light[0], light[1], light[2], view[0], view[1], view[2]]
    };
    let places: Vec<[f64; COLUMNS]> = group.iter().map(angles).collect();
    let mut columns: Vec<Vec<f64>> = (0..COLUMNS)
        .map(|k| centred(places.iter().map(|p| p[k])))
        .collect();
    let mut values: [Vec<f64>; N] =
        std::array::from_fn(|c| centred(group.iter().map(|s| f64::from(s.rgb[c]).natural_log())));
    // Gram and Schmidt, the widest direction first.
    let mut freedom = group.len() - 1;
    let mut widest = ROUNDING / SPREAD_MIN;
    for _ in 0..RANK_MAX {
        columns.sort_by(|a, b| norm(a).total_cmp(&norm(b)));
        let Some(axis) = columns.pop() else { break };
        let length = norm(&axis);
        widest = widest.max(length);
        if length < SPREAD_MIN * widest {
            break;
        }
        freedom = freedom.checked_sub(1).filter(|left| *left > 0)?;
        for column in columns.iter_mut().chain(&mut values) {
            let along = dot(&axis, column) / (length * length);
            column
                .iter_mut()
                .zip(&axis)
                .for_each(|(v, a)| *v -= along * a);
        }
    }
    let usual = freedom as f64 * first_quartile(freedom);
    Some(values.map(|v| (dot(&v, &v) / usual) as f32))
}

/// The first quartile of all estimates; `None` of none. Where the material bends within a cell, or samples are far
/// off, it is not noise that shows: the quarter that scatters least decides.
pub fn usual(mut variances: Vec<f32>) -> Option<f32> {
    variances.retain(|v| v.is_finite() && *v > 0.0);
    quantile(&mut variances, 0.25)
}

/// First quartile of χ² with so many degrees of freedom, over their number; beyond a few by Wilson and Hilferty's
/// approximation, within 1 %.
fn first_quartile(freedom: usize) -> f64 {
    const OF_FEW: [f64; 3] = [0.1015, 0.2877, 0.4042];
    if let Some(known) = OF_FEW.get(freedom - 1) {
        return *known;
    }
    let spread = 2.0 / (9.0 * freedom as f64);
    (1.0 - spread - 0.6745 * spread.sqrt()).powi(3)
}

fn centred(values: impl ExactSizeIterator<Item = f64> + Clone) -> Vec<f64> {
    let mean = values.clone().sum::<f64>() / values.len().max(1) as f64;
    values.map(|v| v - mean).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Samples on the sheet of one frame, their logarithms with a slope, so much a degree, and so much noise.
    fn group(random: &mut Random, slope: f32, noise: f32, count: usize) -> Vec<Sample> {
        (0..count)
            .map(|_| {
                let [x, y] = [(); 2].map(|()| random.between(-1.0, 1.0) as f32);
                let rgb = [0, 1, 2].map(|_| {
                    (slope * (x + 0.5 * y) + noise * random.normal() as f32).exponential()
                });
                Sample {
                    theta_i_deg: 40.0 + x,
                    phi_i_deg: 100.0 + 1.5 * y,
                    theta_v_deg: 30.0 - 0.6 * x,
                    phi_v_deg: 200.0 + 1.2 * y,
                    rgb,
                    frame: 0,
                }
            })
            .collect()
    }

    #[test]
    fn noise_is_found_whatever_the_slope_and_the_number_of_samples() {
        let mut random = Random::new(1);
        for (slope, noise) in [(0.0, 0.02), (0.3, 0.02), (0.3, 0.2)] {
            for count in [4, 5, 6, 9, 30] {
                let variances = (0..6000)
                    .filter_map(|_| variances_about_plane(&group(&mut random, slope, noise, count)))
                    .flatten();
                let sigma = usual(variances.collect()).unwrap().sqrt();
                assert!(
                    (sigma / noise - 1.0).abs() < 0.04,
                    "slope {slope}, {count} samples: {sigma}, not {noise}"
                );
            }
        }
    }

    #[test]
    fn samples_of_one_place_tell_noise_too_and_too_few_nothing() {
        let mut random = Random::new(7);
        let repeated = (0..6000).filter_map(|_| {
            let mut group = group(&mut random, 0.0, 0.05, 3);
            let first = group[0];
            for sample in &mut group {
                let rgb = sample.rgb;
                *sample = Sample { rgb, ..first };
            }
            variances_about_plane(&group)
        });
        let sigma = usual(repeated.flatten().collect()).unwrap().sqrt();
        assert!((sigma - 0.05).abs() < 0.002, "{sigma}");

        let few = group(&mut random, 0.0, 0.05, 3);
        assert_eq!(variances_about_plane(&few), None);
        let mut dark = group(&mut random, 0.0, 0.05, 9);
        dark[4].rgb[1] = -0.001;
        assert_eq!(variances_about_plane(&dark), None);
        assert_eq!(usual(Vec::new()), None);
        assert_eq!(usual(vec![0.0, f32::NAN]), None);
    }
}
