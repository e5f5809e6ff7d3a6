//! A sensor's raw exposures: counts with black level, shot, read and quantisation noise, and an end.

use super::noise::{mix, normal_quantile};

/// A linear sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawSensor {
    /// Counts without light.
    pub black_counts: f32,
    /// The most counts there are.
    pub white_counts: f32,
    /// Electrons a count.
    pub gain_e_per_count: f32,
    /// Standard deviation of the read noise, electrons.
    pub read_noise_e: f32,
}

impl RawSensor {
    /// Exposes photosites that gather the given counts a second for some time. The noise depends on
    /// the seed alone; that of shots is taken as normal, which it is from some ten electrons on.
    pub fn expose(&self, counts_per_s: &[f32], exposure_s: f64, seed: u64) -> Vec<u16> {
        let key = mix(seed);
        let site = |(i, rate): (usize, &f32)| {
            let electrons = (rate * exposure_s as f32 * self.gain_e_per_count).max(0.0);
            let sigma = (electrons + self.read_noise_e * self.read_noise_e).sqrt();
            let noisy = electrons + sigma * normal_quantile(mix(key.wrapping_add(i as u64)));
            let counts = self.black_counts + noisy / self.gain_e_per_count;
            counts.round().clamp(0.0, self.white_counts) as u16
        };
        counts_per_s.iter().enumerate().map(site).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_have_the_mean_and_variance_of_light_and_sensor_and_end_at_white() {
        let sensor = RawSensor {
            black_counts: 64.0,
            white_counts: 4095.0,
            gain_e_per_count: 2.5,
            read_noise_e: 4.0,
        };
        let counts = sensor.expose(&[1000.0; 40_000], 0.5, 3);
        let n = counts.len() as f64;
        let mean = counts.iter().map(|c| f64::from(*c)).sum::<f64>() / n;
        let variance = counts
            .iter()
            .map(|c| (f64::from(*c) - mean).powi(2))
            .sum::<f64>()
            / n;
        assert!((mean - 564.0).abs() < 0.3, "{mean}");
        let expected = 500.0 / 2.5 + (4.0f64 / 2.5).powi(2) + 1.0 / 12.0;
        assert!(
            (variance / expected - 1.0).abs() < 0.03,
            "{variance} {expected}"
        );
        assert!(sensor.expose(&[1e6; 10], 1.0, 3).iter().all(|c| *c == 4095));
    }
}
