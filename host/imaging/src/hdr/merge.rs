//! The weighted mean of a photosite's exposures.
//!
//! An exposure of t seconds with c counts tells the rate (c − black)/t with variance
//! (e/g + r² + 1/12)/t², e the counts *expected* of the rate that the longest usable exposure tells
//! (weights from each exposure's own noisy count would favour the dark ones), g electrons a count,
//! r the read noise in counts, 1/12 the quantisation.

use gonia_rig::Sensor;

/// Weights fall to zero over this share of the range below saturation. A sharp limit would keep the
/// exposures whose noise is negative and drop the others; so would a weight by an exposure's own
/// counts, and one by the other exposures' the other way about. The weighted mean of all says nothing
/// of their differences, so weights by it favour none.
const TAPER: f32 = 0.1;
/// The linearity check looks at every so many photosites,
const CHECK_STEP: usize = 5;
/// at those whose longer exposure has counts within these shares of the range,
const CHECK_RANGE: [f32; 2] = [0.1, 0.75];
/// whose shorter one is expected to have this many times the read noise,
const CHECK_SIGNAL: f32 = 10.0;
/// and needs this many of them.
const CHECK_COUNT: u32 = 400;

/// How far two exposures are from telling the same radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearity {
    /// The shorter exposure, seconds.
    pub shorter_s: f64,
    /// The longer one.
    pub longer_s: f64,
    /// Radiance by the longer one over radiance by the shorter one, minus one.
    pub deviation: f64,
}

/// Values and variances in the order of the photosites.
pub struct Merged {
    pub value: Vec<f32>,
    pub variance: Vec<f32>,
    pub linearity: Option<Linearity>,
}

/// The sensor in counts.
struct Noise {
    black: f32,
    saturation: f32,
    counts_per_electron: f32,
    read: f32,
    fixed_variance: f32,
}

/// Merges exposures in the order of their times.
pub fn merge(exposures: &[(f64, &[u16])], sensor: &Sensor) -> Merged {
    let read = (sensor.read_noise_e / sensor.gain_e_per_count) as f32;
    let noise = Noise {
        black: sensor.black_counts as f32,
        saturation: sensor.saturation_counts as f32,
        counts_per_electron: (1.0 / sensor.gain_e_per_count) as f32,
        read,
        fixed_variance: read * read + 1.0 / 12.0,
    };
    let n = exposures.iter().map(|e| e.1.len()).min().unwrap_or(0);
    let (mut value, mut variance) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for i in 0..n {
        let (v, var) = noise.site(exposures.iter().map(|(t, counts)| (*t as f32, counts[i])));
        value.push(v);
        variance.push(var);
    }
    let pairs = exposures
        .windows(2)
        .filter_map(|pair| noise.check(pair[0], pair[1]));
    Merged {
        value,
        variance,
        linearity: pairs.max_by(|a, b| a.deviation.abs().total_cmp(&b.deviation.abs())),
    }
}

impl Noise {
    /// Rate and variance of one photosite from its exposures, shortest first.
    fn site(&self, exposures: impl DoubleEndedIterator<Item = (f32, u16)> + Clone) -> (f32, f32) {
        let usable = |(_, counts): &(f32, u16)| f32::from(*counts) < self.saturation;
        let Some((longest, counts)) = exposures.clone().rfind(usable) else {
            return (f32::INFINITY, f32::INFINITY);
        };
        let rate = ((f32::from(counts) - self.black) / longest).max(0.0);
        let range = self.saturation - self.black;
        // Rate, its time and its variance.
        let told = exposures.filter(usable).filter_map(|(time, counts)| {
            let expected = rate * time;
            // Beside a longer exposure, one that drowns in read noise says nothing.
            if time < longest && expected < self.read {
                return None;
            }
            let variance = expected * self.counts_per_electron + self.fixed_variance;
            let told = (f32::from(counts) - self.black) / time;
            Some((told, time, variance / (time * time)))
        });
        let (all, spread) = mean(told.clone().map(|(told, _, v)| (told, v, 1.0 / v)));
        let tapered = told.map(|(told, time, v)| {
            let below = (range - all * time) / (TAPER * range);
            (told, v, below.clamp(0.0, 1.0) / v)
        });
        // Nothing is left where the only exposure that is not saturated nearly is.
        match mean(tapered) {
            (value, variance) if value.is_finite() => (value, variance),
            _ => (all, spread),
        }
    }

    /// Compares two exposures over the photosites that both show well, chosen by the longer one.
    fn check(&self, shorter: (f64, &[u16]), longer: (f64, &[u16])) -> Option<Linearity> {
        let ratio = (shorter.0 / longer.0) as f32;
        let range = self.saturation - self.black;
        let bounds = CHECK_RANGE.map(|share| share * range);
        let (mut sums, mut count) = ([0.0f64; 2], 0u32);
        for (a, b) in shorter.1.iter().zip(longer.1).step_by(CHECK_STEP) {
            let [short, long] = [a, b].map(|counts| f32::from(*counts) - self.black);
            if long > bounds[0] && long < bounds[1] && long * ratio > CHECK_SIGNAL * self.read {
                sums[0] += f64::from(short);
                sums[1] += f64::from(long);
                count += 1;
            }
        }
        (count >= CHECK_COUNT).then(|| Linearity {
            shorter_s: shorter.0,
            longer_s: longer.0,
            deviation: sums[1] / longer.0 / (sums[0] / shorter.0) - 1.0,
        })
    }
}

/// Mean and its variance of values with variances and weights; not a number without weight.
fn mean(values: impl Iterator<Item = (f32, f32, f32)>) -> (f32, f32) {
    let (mut sum, mut total, mut spread) = (0.0, 0.0, 0.0);
    for (value, variance, weight) in values {
        sum += weight * value;
        total += weight;
        spread += weight * weight * variance;
    }
    (sum / total, spread / (total * total))
}
