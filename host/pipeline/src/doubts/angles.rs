//! Doubts about angles: radians for degrees, angles from the surface for angles from the normal.

use super::{SAMPLES, some};
use crate::Error;
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{Direction, Sample};
use gonia_rig::Remark;
use rayon::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Room for rounding in a file, radians.
const ROUNDING: f32 = 1e-3;
/// So many different angles are no few that happen to be small.
const MANY_ANGLES: usize = 6;

/// Looks for angles in radians. A remark where only the azimuths seem to be.
///
/// Polar angles all within π/2 degrees of the normal, and many of them, are nothing that anyone measures: nearly
/// all of a dense BRDF would be extrapolated from them. Azimuths that keep within 2π degrees, and come
/// near 2π or −π, may be a narrow scan: they are only remarked on.
///
/// # Errors
/// Polar angles in radians.
pub(super) fn in_radians(samples: &[Sample]) -> Result<Option<Remark>, Error> {
    let largest = |angle: fn(&Sample) -> f32| {
        samples
            .par_iter()
            .map(angle)
            .reduce(|| 0.0f32, f32::max)
    };
    let polar = largest(|s| s.theta_i_deg.max(s.theta_v_deg));
    if polar <= FRAC_PI_2 + ROUNDING {
        let count = different(samples, |s| [s.theta_i_deg, s.theta_v_deg]);
        if count < MANY_ANGLES {
            return Ok(None);
        }
        return Err(Error::Contradicted {
            what: format!(
                "no polar angle is above {polar:.4} and there are {count} different ones: they are radians, not degrees"
            ),
            remedy: "multiply the angles by 180/pi".into(),
        });
    }
    // Azimuths were wrapped as degrees.
    let azimuth = largest(|s| size(s.phi_i_deg).max(size(s.phi_v_deg)));
    let count = different(samples, |s| [s.phi_i_deg, s.phi_v_deg]);
    if azimuth > TAU + ROUNDING || azimuth < PI - 0.2 || count < 2 * MANY_ANGLES {
        return Ok(None);
    }
    Ok(Some(Remark::new(
        SAMPLES,
        format_args!(
            "polar angles reach {polar:.1} degrees, but of {count} different azimuths none is beyond {azimuth:.4}: they look like radians"
        ),
        "if they are, multiply the azimuths by 180/pi",
    )))
}

fn size(phi_deg: f32) -> f32 {
    phi_deg.min(360.0 - phi_deg).abs()
}

/// How many different angles some thousand samples have.
fn different(samples: &[Sample], angles: fn(&Sample) -> [f32; 2]) -> usize {
    let mut all: Vec<f32> = some(samples, 5000)
        .into_iter()
        .flat_map(angles)
        .collect();
    all.sort_by(f32::total_cmp);
    all.dedup();
    all.len()
}

/// Samples whose nearest neighbours are looked for.
const ASKED: usize = 400;
/// Samples among which they are looked for.
const AMONG: usize = 20_000;
/// Standard errors that the difference of the two readings must exceed.
const SURE: f64 = 5.0;
/// Share of the disagreement between neighbours that may be left in the other reading.
const SMOOTHER: f64 = 0.6;
/// Natural logarithms; outliers must not decide.
const DIFFERENCE_MAX: f64 = 1.0;
/// Neighbours that disagree by less than this tell nothing of the material.
const DIFFERENCE_MIN: f64 = 0.01;
/// Fewer samples than this are too few to say anything.
const FEW: usize = 50;

/// Looks for polar angles measured from the surface. Values are smooth over directions; where angles are
/// complements, what is one direction (the pole) is torn into a ring, and a ring is drawn together. So
/// neighbours disagree less with the angles' complements than with the angles.
///
/// Reciprocity cannot tell the two apart, nor can the place of a highlight, which stays in the mirror direction. Where
/// values hardly change there is nothing to see, and nothing is said.
pub(super) fn from_the_surface(samples: &[Sample]) -> Option<Remark> {
    let positive: Vec<Sample> = some(samples, AMONG)
        .into_iter()
        .filter(|s| brightness(s) > 0.0)
        .copied()
        .collect();
    if positive.len() < FEW {
        return None;
    }
    let logs: Vec<f64> = positive.iter().map(|s| brightness(s).ln()).collect();
    let step = positive.len().div_ceil(ASKED);
    let asked: Vec<usize> = (0..positive.len()).step_by(step).collect();
    let [read, other] = [false, true].map(|complement| {
        let places: Vec<[Vec3; 2]> = positive.iter().map(|s| place(s, complement)).collect();
        disagreements(&places, &logs, &asked)
    });
    let gains: Vec<f64> = read.iter().zip(&other).map(|(r, o)| r - o).collect();
    let (gain, error) = mean(&gains);
    let (as_read, _) = mean(&read);
    let as_other = as_read - gain;
    let sure = gain > SURE * error && gain > DIFFERENCE_MIN && as_other < SMOOTHER * as_read;
    sure.then(|| {
        Remark::new(
            SAMPLES,
            format_args!(
                "neighbouring directions differ by {:.1} % in value, and by {:.1} % with 90 degrees minus the polar angles: these look measured from the surface",
                100.0 * as_read,
                100.0 * as_other
            ),
            "if they are, give 90 - theta",
        )
    })
}

fn brightness(s: &Sample) -> f64 {
    s.rgb.iter().map(|v| f64::from(*v)).sum()
}

fn place(s: &Sample, complement: bool) -> [Vec3; 2] {
    [(s.theta_i_deg, s.phi_i_deg), (s.theta_v_deg, s.phi_v_deg)].map(|(theta, phi)| {
        let theta = if complement { 90.0 - theta } else { theta };
        Direction::from_deg(theta.into(), phi.into()).to_vec3()
    })
}

/// How far the logarithm of each value that is asked for is from that of the nearest place. The same places twice
/// tell nothing of angles: these are passed over.
fn disagreements(places: &[[Vec3; 2]], logs: &[f64], asked: &[usize]) -> Vec<f64> {
    asked
        .par_iter()
        .map(|&k| {
            let [light, view] = places[k];
            let mut nearest = (f64::NEG_INFINITY, k);
            for (other, [l, v]) in places.iter().enumerate() {
                let closeness = dot(light, *l) + dot(view, *v);
                if closeness > nearest.0 && closeness < 2.0 - 1e-9 && other != k {
                    nearest = (closeness, other);
                }
            }
            (logs[k] - logs[nearest.1]).abs().min(DIFFERENCE_MAX)
        })
        .collect()
}

/// Mean and its standard error.
fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len().max(2) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, (squares / (n * (n - 1.0))).sqrt())
}
