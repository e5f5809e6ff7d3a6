//! A warning about where polar angles are measured from: the surface, in place of the normal.
//!
//! Values are smooth over the right directions, and a highlight depends on little but the half vector. With
//! the angles' complements what is one direction, the pole, is torn into a ring, and a ring is drawn together. So
//! of both readings that one is right in which values that are near in some respect differ less: in the angle
//! from the mirror direction, in that of the half vector, in that between light and view, in either polar angle or in
//! their sum. Where directions lie so densely that neighbours in all four angles speak for the first reading, as
//! they do of any material, these decide.
//!
//! Reciprocity cannot tell the two readings apart, nor can the place of a highlight, which stays in the mirror
//! direction. Where values hardly change there is nothing to see, and nothing is said.

use super::{SAMPLES, some};
use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{Direction, Sample};
use gonia_rig::Remark;
use rayon::prelude::*;

/// Samples that are compared with their neighbours.
const ASKED: usize = 1000;
/// Samples among which these are looked for.
const AMONG: usize = 10_000;
/// Standard errors that the difference of the two readings must exceed.
const SURE: f64 = 6.0;
/// Share of the neighbours' disagreement that may be left in the other reading.
const LEFT_MAX: f64 = 0.75;
/// Neighbours in all four angles that speak for the first reading by so many standard errors decide.
const DENIED: f64 = 3.0;
/// Natural logarithms: more counts as this, so that outliers do not decide.
const DIFFERENCE_MAX: f64 = 1.0;
/// Fewer samples than this say nothing.
const FEW: usize = 50;

/// Light and view, unit vectors.
type Place = [Vec3; 2];

/// Looks for polar angles measured from the surface.
pub(super) fn remark(samples: &[Sample]) -> Option<Remark> {
    let positive: Vec<&Sample> = some(samples, AMONG)
        .into_iter()
        .filter(|s| brightness(s) > 0.0)
        .collect();
    if positive.len() < FEW {
        return None;
    }
    let logs: Vec<f64> = positive
        .iter()
        .map(|s| brightness(s).natural_log())
        .collect();
    let step = positive.len().div_ceil(ASKED);
    let asked: Vec<usize> = (0..positive.len()).step_by(step).collect();
    let [(read, near_read), (other, near_other)] = [false, true].map(|complement| {
        let places: Vec<Place> = positive.iter().map(|s| place(s, complement)).collect();
        (
            least_disagreement(&places, &logs, &asked),
            in_direction(&places, &logs, &asked),
        )
    });
    let (near_gain, near_error) = gain(&near_read, &near_other);
    let (gain, error) = gain(&read, &other);
    let (as_read, _) = mean(&read);
    let as_other = as_read - gain;
    let denied = near_gain < -DENIED * near_error;
    (gain > SURE * error && as_other < LEFT_MAX * as_read && !denied).then(|| {
        Remark::new(
            SAMPLES,
            format_args!(
                "values of like directions differ by {:.1} %, and by {:.1} % with 90 degrees minus each polar angle: the angles look measured from the surface, not from its normal",
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

fn place(s: &Sample, complement: bool) -> Place {
    [(s.theta_i_deg, s.phi_i_deg), (s.theta_v_deg, s.phi_v_deg)].map(|(theta, phi)| {
        let theta = if complement { 90.0 - theta } else { theta };
        Direction::from_deg(theta.into(), phi.into()).to_vec3()
    })
}

/// How far the logarithms that are asked for are from those of their neighbours, in that respect in which they
/// are nearest.
fn least_disagreement(places: &[Place], logs: &[f64], asked: &[usize]) -> Vec<f64> {
    let respects: [fn(&Place) -> f64; 6] = [
        |[l, v]| {
            (l[0] + v[0])
                .hypotenuse(l[1] + v[1])
                .hypotenuse(l[2] - v[2])
        },
        |[l, v]| (l[0] + v[0]).hypotenuse(l[1] + v[1]) / (2.0 + 2.0 * dot(*l, *v)).max(1e-9).sqrt(),
        |[l, v]| dot(*l, *v),
        |[l, v]| l[2].min(1.0).arc_cosine() + v[2].min(1.0).arc_cosine(),
        |[l, _]| l[2],
        |[_, v]| v[2],
    ];
    respects
        .map(|respect| in_one_respect(places, logs, asked, respect))
        .into_iter()
        .min_by(|a, b| mean(a).0.total_cmp(&mean(b).0))
        .unwrap_or_default()
}

fn in_one_respect(
    places: &[Place],
    logs: &[f64],
    asked: &[usize],
    respect: fn(&Place) -> f64,
) -> Vec<f64> {
    let mut order: Vec<(f64, usize)> = places.iter().map(respect).zip(0..).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut differences = vec![0.0; places.len()];
    for (at, (_, number)) in order.iter().enumerate() {
        let near = [at.checked_sub(1), Some(at + 1)];
        let near = near.into_iter().flatten().filter_map(|k| order.get(k));
        let (mut sum, mut count) = (0.0, 0.0f64);
        for (_, other) in near {
            sum += difference(logs[*number], logs[*other]);
            count += 1.0;
        }
        differences[*number] = sum / count.max(1.0);
    }
    asked.iter().map(|k| differences[*k]).collect()
}

/// The same places twice tell nothing of angles: these are passed over.
fn in_direction(places: &[Place], logs: &[f64], asked: &[usize]) -> Vec<f64> {
    asked
        .par_iter()
        .map(|&k| {
            let [light, view] = places[k];
            let mut nearest = (f64::NEG_INFINITY, k);
            for (other, [l, v]) in places.iter().enumerate() {
                let closeness = dot(light, *l) + dot(view, *v);
                if closeness > nearest.0 && closeness < 2.0 - 1e-9 {
                    nearest = (closeness, other);
                }
            }
            difference(logs[k], logs[nearest.1])
        })
        .collect()
}

fn difference(a: f64, b: f64) -> f64 {
    (a - b).abs().min(DIFFERENCE_MAX)
}

/// By how much two readings differ in the mean, and the standard error of that.
fn gain(read: &[f64], other: &[f64]) -> (f64, f64) {
    let gains: Vec<f64> = read.iter().zip(other).map(|(r, o)| r - o).collect();
    mean(&gains)
}

/// Mean and its standard error.
fn mean(values: &[f64]) -> (f64, f64) {
    let n = values.len().max(2) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, (squares / (n * (n - 1.0))).sqrt())
}
