//! Shot and read noise of an HDR exposure.

use gonia_brdf::Elementary;
use std::sync::OnceLock;

/// Noise relative to the typical radiance of a frame, for which its exposure is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of the shot noise at the typical radiance, as a fraction of it; it grows
    /// with the root of radiance.
    pub shot: f64,
    /// Standard deviation of the read noise, as a fraction of the typical radiance.
    pub read: f64,
}

impl Default for Noise {
    /// One percent at a typical pixel.
    fn default() -> Self {
        Self {
            shot: 0.01,
            read: 0.002,
        }
    }
}

/// The noise of one frame.
pub struct NoiseField {
    shot_variance: f32,
    read_variance: f32,
    key: u64,
}

impl NoiseField {
    pub fn new(noise: Noise, typical: f64, seed: u64, shot: u64) -> Self {
        Self {
            shot_variance: (noise.shot * noise.shot * typical) as f32,
            read_variance: (noise.read * noise.read * typical * typical) as f32,
            key: mix(seed ^ mix(shot)),
        }
    }

    /// Adds noise to every value; pixel `i` gets the same noise whoever computes it.
    pub fn add_to(&self, rgb: &mut [[f32; 3]]) {
        let table = normal_quantiles();
        for (i, pixel) in rgb.iter_mut().enumerate() {
            let mut bits = mix(self.key.wrapping_add(i as u64));
            for value in pixel {
                let sigma = (self.shot_variance * value.max(0.0) + self.read_variance).sqrt();
                *value += sigma * table[bits as usize % QUANTILES];
                bits >>= 16;
            }
        }
    }
}

/// A normally distributed number of variance one for random bits, of which the lowest 13 count.
pub fn normal_quantile(bits: u64) -> f32 {
    normal_quantiles()[bits as usize % QUANTILES]
}

/// A hash of 64 bits (the finaliser of SplitMix64).
pub fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

const QUANTILES: usize = 1 << 13;

/// Quantiles of the normal distribution at the middles of equally likely bins, scaled to variance
/// one: a look-up instead of a transcendental function for half a million values a frame.
fn normal_quantiles() -> &'static [f32; QUANTILES] {
    static TABLE: OnceLock<Box<[f32; QUANTILES]>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let mut table = Box::new([0.0f32; QUANTILES]);
        // Integrates the density outwards from the middle, by Newton steps on the quantile:
        // dx = dp / density at the middle of the step.
        let dp = 1.0 / QUANTILES as f64;
        let density = |x: f64| (-0.5 * x * x).exponential() / std::f64::consts::TAU.sqrt();
        let half = QUANTILES / 2;
        let mut x = 0.0;
        for i in 0..half {
            let step = if i == 0 { 0.5 * dp } else { dp };
            let middle = x + 0.5 * step / density(x);
            x += step / density(middle);
            table[half + i] = x as f32;
            table[half - 1 - i] = -x as f32;
        }
        let variance = table.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() * dp;
        for x in table.iter_mut() {
            *x /= variance.sqrt() as f32;
        }
        table
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quantiles_are_those_of_the_normal_distribution() {
        let table = normal_quantiles();
        for (p, x) in [(0.975, 1.95996), (0.84134, 1.0), (0.1, -1.28155)] {
            let at = table[(p * QUANTILES as f64) as usize];
            assert!((f64::from(at) - x).abs() < 5e-3, "{p}: {at}");
        }
        assert!(table[QUANTILES - 1] < 5.0);
    }
}
