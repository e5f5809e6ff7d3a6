//! How errors of interpolation grow towards grazing angles, beyond what the blocks' own variances say.
//!
//! A kernel is the same in all of the domain, but materials vary faster where light and view graze, and data lie on one side
//! only there. Few frames are at grazing angles, too few for classes of their own. So the factor of all left-out bins is
//! followed over the product of both cosines, `f ∝ (cos θi · cos θv)^p`, by a line through the logarithms.

use super::cross_validation::MeanPrediction;
use super::error_factor::{
    BinNoise, PERCENTILE_SPREAD, TESTS_OF_CLASS, Z95, factor_of, groups_of, of_few_groups,
};
use crate::direction::Vec3;
use crate::elementary::Elementary;

/// The most oblique zone holds so many tests, or one in [`ZONES`] of all; each further one holds twice as many.
const FIRST: usize = 2 * TESTS_OF_CLASS;
const ZONES: usize = 8;

/// By what the blocks' own standard deviations are multiplied by obliquity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Obliquity {
    /// The exponent p.
    exponent: f32,
    /// The standard uncertainty of p, by the number of frames.
    uncertainty: f32,
    /// The mean logarithm of the product of cosines …
    mean: f32,
    /// … and of the factor there.
    level: f32,
    /// The least logarithm of a test: of cells beyond it nothing is known.
    least: f32,
}

/// What the tests of a zone show.
struct Zone {
    /// Mean logarithm of the product of the cosines.
    log_product: f32,
    /// Logarithm of the factor.
    log_factor: f32,
    /// One over the variance of this logarithm.
    weight: f32,
}

impl Obliquity {
    /// No change by angle.
    pub const NONE: Self = Self {
        exponent: 0.0,
        uncertainty: 0.0,
        mean: 0.0,
        level: 0.0,
        least: 0.0,
    };

    /// Of the means of left-out bins, the variances as the blocks say them.
    pub fn new<const N: usize>(means: &[MeanPrediction<N>], noise: &BinNoise) -> Self {
        let log = |of: &MeanPrediction<N>| log_product(of.first.bin.light, of.first.bin.view);
        let mut sorted: Vec<&MeanPrediction<N>> = means.iter().collect();
        sorted.sort_by(|a, b| log(a).total_cmp(&log(b)));
        let Some(least) = sorted.first().map(|first| log(first)) else {
            return Self::NONE;
        };
        let mut zones = Vec::new();
        let mut rest = &sorted[..];
        let mut n = (rest.len() / ZONES).clamp(1, FIRST);
        while !rest.is_empty() {
            if rest.len() < 2 * n {
                n = rest.len();
            }
            let (zone, others) = rest.split_at(n);
            let factor = factor_of(zone, noise).factor(1.0) * of_few_groups(zone);
            let weights = zone.iter().map(|of| of.first.weight);
            let sum: f32 = weights.clone().sum();
            let logs = zone.iter().zip(weights).map(|(of, w)| w * log(of));
            zones.push(Zone {
                log_product: logs.sum::<f32>() / sum,
                log_factor: factor.natural_log(),
                // A standard deviation is known twice as well as its square.
                weight: groups_of(zone) as f32 / (0.5 * PERCENTILE_SPREAD).powi(2),
            });
            (rest, n) = (others, 2 * n);
        }
        Self::through(&zones, least)
    }

    /// The line through zones by least squares.
    fn through(zones: &[Zone], least: f32) -> Self {
        let sum = |of: &dyn Fn(&Zone) -> f32| zones.iter().map(|z| z.weight * of(z)).sum::<f32>();
        let all = sum(&|_| 1.0);
        let mean = sum(&|z| z.log_product) / all;
        let level = sum(&|z| z.log_factor) / all;
        let square = sum(&|z| (z.log_product - mean).powi(2));
        let product = sum(&|z| (z.log_product - mean) * (z.log_factor - level));
        let exponent = product / square;
        if !exponent.is_finite() {
            return Self::NONE;
        }
        Self {
            exponent,
            uncertainty: square.sqrt().recip(),
            mean,
            level,
            least,
        }
    }

    /// The factor at a pair of directions.
    pub fn factor(&self, light: Vec3, view: Vec3) -> f32 {
        let log = log_product(light.map(|k| k as f32), view.map(|k| k as f32));
        let beyond = log.max(self.least) - self.mean;
        // A standard deviation that is known to a share τ only takes Student's distribution of 1/2τ² degrees of freedom: the
        // first term of its expansion.
        let unknown = (self.uncertainty * beyond).powi(2);
        let widened = 1.0 + 0.5 * (Z95 * Z95 + 1.0) * unknown;
        (self.level + self.exponent * beyond).exponential() * widened
    }
}

/// The logarithm of the product of both cosines.
fn log_product(light: [f32; 3], view: [f32; 3]) -> f32 {
    (light[2] * view[2]).max(f32::MIN_POSITIVE).natural_log()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(product: f32, factor: f32, groups: f32) -> Zone {
        Zone {
            log_product: product.natural_log(),
            log_factor: factor.natural_log(),
            weight: groups,
        }
    }

    fn at(cosine: f64) -> Vec3 {
        [(1.0 - cosine * cosine).sqrt(), 0.0, cosine]
    }

    #[test]
    fn the_factor_follows_the_tests_and_stays_where_they_end() {
        let zones = [0.6f32, 0.3, 0.15].map(|p| zone(p, 1.2 * p.power(-0.8), 1e6));
        let of = Obliquity::through(&zones, 0.1f32.natural_log());
        for cosine in [0.2f32, 0.4] {
            let ratio = of.factor(at(cosine.into()), at(1.0)) / (1.2 * cosine.power(-0.8));
            assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
        }
        assert_eq!(
            of.factor(at(0.05), at(0.05)),
            of.factor(at(0.1), at(1.0 - 1e-9))
        );
    }

    #[test]
    fn of_few_frames_the_factor_is_wider_where_they_do_not_reach() {
        let of = |groups: f32| {
            let zones = [0.6f32, 0.3, 0.15].map(|p| zone(p, 1.0, groups));
            Obliquity::through(&zones, 0.02f32.natural_log())
        };
        let (few, many) = (of(4.0), of(400.0));
        let [middle, far] = [at(0.3), at(0.02)].map(|light| few.factor(light, at(1.0)));
        assert!((middle - 1.0).abs() < 0.05 && far > 1.5, "{middle} {far}");
        assert!(many.factor(at(0.02), at(1.0)) < 1.05);
        // One zone alone says nothing of a change.
        let alone = Obliquity::through(&[zone(0.3, 2.0, 9.0)], 0.0);
        assert_eq!(alone, Obliquity::NONE);
    }
}
