//! Samples as they are measured, those of one place merged.

use crate::direction::{Direction, Vec3};
use crate::elementary::Elementary;
use crate::sample::Sample;

/// Samples whose angles agree within this are of one place, degrees.
const SAME_DEG: f64 = 1e-3;
/// What is not positive counts as this share of the median at least, where logarithms are taken.
const FLOOR_SHARE: f64 = 1e-4;

/// One place, and what was measured there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Datum<const N: usize = 3> {
    pub light: Vec3,
    pub view: Vec3,
    /// Mean of the samples, per channel.
    pub value: [f64; N],
    /// Natural logarithm of the value, per channel.
    pub log: [f64; N],
    /// Number of samples.
    pub count: f64,
    /// What cross-validation leaves out together: the frame, or the place alone.
    pub group: u32,
}

/// All places.
pub(super) struct Data<const N: usize = 3> {
    pub places: Vec<Datum<N>>,
    /// What counts for less, per channel, where logarithms are taken.
    floors: [f64; N],
}

impl<const N: usize> Data<N> {
    pub fn new(samples: &[Sample<N>]) -> Self {
        let mut places = places(samples);
        let floors = std::array::from_fn(|c| floor(places.iter().map(|d| d.value[c])));
        let mut data = Self {
            places: Vec::new(),
            floors,
        };
        for datum in &mut places {
            datum.log = data.logs(datum.value);
        }
        data.places = places;
        data
    }

    pub fn logs(&self, value: [f64; N]) -> [f64; N] {
        std::array::from_fn(|c| value[c].max(self.floors[c]).natural_log())
    }
}

/// The places, in an order that depends on the samples alone, without their logarithms.
fn places<const N: usize>(samples: &[Sample<N>]) -> Vec<Datum<N>> {
    let key = |s: &Sample<N>| {
        [s.theta_i_deg, s.phi_i_deg, s.theta_v_deg, s.phi_v_deg]
            .map(|angle| (f64::from(angle) / SAME_DEG).round() as i64)
    };
    let mut sorted: Vec<([i64; 4], &Sample<N>)> = samples
        .iter()
        .filter(|s| s.rgb.iter().all(|v| v.is_finite()))
        .map(|s| (key(s), s))
        .collect();
    sorted.sort_by_key(|(key, _)| *key);
    let framed = samples.iter().any(|s| s.frame != Sample::NO_FRAME);
    sorted
        .chunk_by(|a, b| a.0 == b.0)
        .enumerate()
        .map(|(number, same)| {
            let count = same.len() as f64;
            let s = same[0].1;
            let value = std::array::from_fn(|c| {
                same.iter().map(|(_, s)| f64::from(s.rgb[c])).sum::<f64>() / count
            });
            let direction =
                |theta: f32, phi: f32| Direction::from_deg(theta.into(), phi.into()).to_vec3();
            Datum {
                light: direction(s.theta_i_deg, s.phi_i_deg),
                view: direction(s.theta_v_deg, s.phi_v_deg),
                value,
                log: [0.0; N],
                count,
                group: if framed { s.frame } else { number as u32 },
            }
        })
        .collect()
}

/// How many places samples have.
pub(super) fn count_places<const N: usize>(samples: &[Sample<N>]) -> usize {
    places(samples).len()
}

fn floor(values: impl Iterator<Item = f64>) -> f64 {
    let mut positive: Vec<f64> = values.filter(|v| *v > 0.0).collect();
    positive.sort_by(f64::total_cmp);
    let smallest = positive.first().copied().unwrap_or(1.0);
    let median = positive.get(positive.len() / 2).copied().unwrap_or(1.0);
    // What was measured above zero stands, however dark.
    smallest
        .min(FLOOR_SHARE * median)
        .max(f64::from(f32::MIN_POSITIVE))
}
