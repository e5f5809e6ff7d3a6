//! Warnings about a cosine: values that are not reciprocal, but would be without a factor.
//!
//! A BRDF has the same value with light and view exchanged. Of f·cosᵖθv·cosᵠθi the logarithms of two such
//! values differ by (p − q)·(ln cos θv − ln cos θi): a line through the origin, whose slope is p − q. What
//! is symmetric, f·cosθi·cosθv or a constant factor, cannot be told from a BRDF in this way.

use super::{SAMPLES, some};
use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::quantile::median;
use gonia_brdf::{Bins, Direction, Sample};
use gonia_rig::Remark;
use rayon::prelude::*;

/// Bins that a reciprocal one is looked for.
const BINS: usize = 400_000;
/// Fewer pairs of bins than this are too few, and pairs of single samples are looked for.
const FEW_PAIRS: usize = 200;
/// Single samples among which pairs are looked for.
const SAMPLES_MAX: usize = 4000;
/// Fewer pairs than this say nothing.
const PAIRS_MIN: usize = 30;
/// Squared chords between the place of one value and the reciprocal place of the other: of bins about 3°, of
/// samples about 15°.
const NEAR_BINS: f64 = 0.003;
const NEAR_SAMPLES: f64 = 0.07;
/// Pairs of nearly the same polar angles have no say.
const LEVER_MIN: f64 = 0.05;
/// The slope is a factor of a cosine where it is beyond this …
const SLOPE_MIN: f64 = 0.5;
/// … by so many standard errors …
const SURE: f64 = 5.0;
/// … leaves less than this share of the pairs' disagreement …
const LEFT_MAX: f64 = 0.75;
/// … and is no steeper than a squared cosine, which nobody exceeds by mistake: a peak that is narrower than the
/// pairs are apart makes any slope.
const SLOPE_MAX: f64 = 2.5;

/// The logarithms of two values, and of the cosines, as differences: (ln cosθv/cosθi, ln f).
type Pair = (f64, f64);

/// Looks for a factor of cosθv or cosθi in the values.
pub(super) fn cosine_factor(samples: &[Sample], bins: &Bins) -> Option<Remark> {
    let mut pairs = pairs_of_bins(bins);
    let mut isotropic = "";
    if pairs.len() < FEW_PAIRS {
        let turned = super::layout::one_azimuth(samples).is_some();
        if turned {
            isotropic = ", if the material is isotropic,";
        }
        pairs = pairs_of_samples(samples, turned);
    }
    let slope = slope(&pairs)?;
    let (factor, remedy) = if slope.value > 0.0 {
        ("f cos(theta_v)", "divide them by cos(theta_v)")
    } else {
        ("f cos(theta_i)", "divide them by cos(theta_i)")
    };
    Some(Remark::new(
        SAMPLES,
        format_args!(
            "in {} pairs with light and view exchanged{isotropic} values differ as the ratio of their cosines to the power {:.2} ± {:.2}, and those of a BRDF do not: they look like {factor}",
            pairs.len(),
            slope.value.abs(),
            slope.error
        ),
        remedy,
    ))
}

fn pairs_of_bins(bins: &Bins) -> Vec<Pair> {
    let (grid, all) = (bins.grid(), bins.bins());
    let step = all.len().div_ceil(BINS).max(1);
    all.par_iter()
        .step_by(step)
        .filter_map(|bin| {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            let mirrored = grid.cell(view, light) as u64;
            // Each pair once, unless only one of its bins is looked at.
            if mirrored == bin.cell || (step == 1 && mirrored < bin.cell) {
                return None;
            }
            let found = all.binary_search_by_key(&mirrored, |b| b.cell).ok()?;
            let other = &all[found];
            let places = [bin, other].map(|b| [b.light, b.view].map(|d| d.map(f64::from)));
            let values = [bin, other].map(|b| b.median.iter().sum::<f32>());
            pair(places, values, NEAR_BINS)
        })
        .collect()
}

/// Pairs of a sample and of that which is nearest to its reciprocal place. `turned`: about the normal too, so that
/// the light has azimuth 0, and to one side of the plane of incidence.
fn pairs_of_samples(samples: &[Sample], turned: bool) -> Vec<Pair> {
    let some = some(samples, SAMPLES_MAX);
    let places: Vec<[Vec3; 2]> = some.iter().map(|s| place(s, turned)).collect();
    let mut pairs: Vec<[usize; 2]> = (0..places.len())
        .into_par_iter()
        .map(|k| {
            let [light, view] = if turned {
                place(&exchanged(some[k]), true)
            } else {
                [places[k][1], places[k][0]]
            };
            let closeness = |p: &[Vec3; 2]| dot(p[0], light) + dot(p[1], view);
            let nearest = (0..places.len())
                .map(|other| (closeness(&places[other]), other))
                .fold((f64::NEG_INFINITY, k), |a, b| if b.0 > a.0 { b } else { a });
            [k.min(nearest.1), k.max(nearest.1)]
        })
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
        .into_iter()
        .filter_map(|[a, b]| {
            let mut places = [places[a], places[b]];
            if turned {
                // As the pair would lie if it were not turned.
                places[1] = place(&exchanged(some[b]), true);
                places[1].swap(0, 1);
            }
            pair(
                places,
                [a, b].map(|k| some[k].rgb.iter().sum::<f32>()),
                NEAR_SAMPLES,
            )
        })
        .collect()
}

fn exchanged(s: &Sample) -> Sample {
    Sample {
        theta_i_deg: s.theta_v_deg,
        phi_i_deg: s.phi_v_deg,
        theta_v_deg: s.theta_i_deg,
        phi_v_deg: s.phi_i_deg,
        ..*s
    }
}

fn place(s: &Sample, turned: bool) -> [Vec3; 2] {
    let (mut phi_i, mut phi_v) = (s.phi_i_deg, s.phi_v_deg);
    if turned {
        let difference = (phi_v - phi_i).rem_euclid(360.0);
        (phi_i, phi_v) = (0.0, difference.min(360.0 - difference));
    }
    [(s.theta_i_deg, phi_i), (s.theta_v_deg, phi_v)]
        .map(|(theta, phi)| Direction::from_deg(theta.into(), phi.into()).to_vec3())
}

/// `None` of two that are too far from reciprocal, hold no positive value, or tell no cosine.
fn pair(places: [[Vec3; 2]; 2], values: [f32; 2], near: f64) -> Option<Pair> {
    let [[light, view], [other_light, other_view]] = places;
    let apart = 4.0 - 2.0 * (dot(light, other_view) + dot(view, other_light));
    let log_ratio = |[light, view]: [Vec3; 2]| (view[2] / light[2]).natural_log();
    // Half of the difference: with exact reciprocity both ratios are each other's inverse.
    let lever = 0.5 * (log_ratio(places[0]) - log_ratio(places[1]));
    let sound = apart <= near
        && values.iter().all(|v| *v > 0.0)
        && lever.is_finite()
        && lever.abs() >= LEVER_MIN;
    sound.then(|| {
        (
            lever,
            f64::from(values[0]).natural_log() - f64::from(values[1]).natural_log(),
        )
    })
}

/// A slope that no BRDF has.
struct Slope {
    value: f64,
    error: f64,
}

/// The line through the origin that most pairs lie on, where it is surely none of a BRDF.
fn slope(pairs: &[Pair]) -> Option<Slope> {
    if pairs.len() < PAIRS_MIN {
        return None;
    }
    let mut value = weighted_median(pairs);
    let mut error = f64::INFINITY;
    for _ in 0..20 {
        let mut sizes = residuals(pairs, value);
        let scale = (1.4826 * f64::from(median(&mut sizes))).max(1e-4);
        let (mut xx, mut xy, mut noise) = (0.0, 0.0, 0.0);
        for (x, y) in pairs {
            let residual = y - value * x;
            // Cauchy's weights: highlights that a pair's distance spoils have no say.
            let weight = 1.0 / (1.0 + (residual / (2.385 * scale)).powi(2));
            xx += weight * x * x;
            xy += weight * x * y;
            noise += (weight * x * residual).powi(2);
        }
        value = xy / xx;
        error = noise.sqrt() / xx;
    }
    let (mut before, mut after) = (residuals(pairs, 0.0), residuals(pairs, value));
    let explained = f64::from(median(&mut after)) < LEFT_MAX * f64::from(median(&mut before));
    let is_cosine = value.abs() - SURE * error > SLOPE_MIN && value.abs() < SLOPE_MAX;
    (explained && is_cosine).then_some(Slope { value, error })
}

fn residuals(pairs: &[Pair], slope: f64) -> Vec<f32> {
    pairs
        .iter()
        .map(|(x, y)| (y - slope * x).abs() as f32)
        .collect()
}

/// The slope of least absolute residuals.
fn weighted_median(pairs: &[Pair]) -> f64 {
    let mut slopes: Vec<(f64, f64)> = pairs.iter().map(|(x, y)| (y / x, x.abs())).collect();
    slopes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * slopes.iter().map(|s| s.1).sum::<f64>();
    let mut sum = 0.0;
    for (slope, weight) in &slopes {
        sum += weight;
        if sum >= half {
            return *slope;
        }
    }
    0.0
}
