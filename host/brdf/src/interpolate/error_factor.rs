//! The factor with which left-out bins lie within their error bars, and the noise of these bins.

use super::cross_validation::MeanPrediction;
use super::datum::SIGMA_PER_MAD;
use crate::bins::{Bin, variance_of_median};
use crate::elementary::Elementary;
use crate::quantile::{quantile, weighted_quantile};

/// Half the width of a 95 % interval, in standard errors of a normal distribution.
pub const Z95: f32 = 1.96;
/// The square of the factor where noise alone makes the error: what the block itself says …
const USUAL_FACTOR: f32 = 1.0;
/// … give or take this share.
const USUAL_SPREAD: f32 = 0.5;
/// Standard deviation of a 95th percentile of squares of normal values over their 95th percentile,
/// times the root of their number: `2 √(0.05 · 0.95) / (1.96 · 2 φ(1.96))`, φ the normal density.
pub(super) const PERCENTILE_SPREAD: f32 = 1.9;
/// So well is the variance of the bins' noise data, as a share.
const NOISE_SPREAD: f32 = 0.1;
/// A bin whose predicted variance is less than this share of its noise's shows the noise alone.
const NOISE_ALONE: f32 = 0.1;
/// So many bins determine a 95th percentile.
pub(super) const TESTS_OF_CLASS: usize = 100;

/// The noise of bins: how far a bin's median lies from the true value at its mean direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BinNoise {
    /// Variance of the logarithm of one sample.
    variance: f32,
    /// What bins show of it in fact, over what their samples' number and spread say.
    factor: f32,
}

impl BinNoise {
    /// Finds the factor on bins that show noise alone; without enough of them it is 1.
    pub fn new<const N: usize>(means: &[MeanPrediction<N>], variance: f32) -> Self {
        let stated = Self {
            variance,
            factor: 1.0,
        };
        let mut factors: Vec<f32> = means
            .iter()
            .flat_map(|m| {
                let p = m.first;
                (0..N).filter_map(move |c| {
                    Residual::new(p.residual[c], (p.variance[c], stated.of(p.bin, c)), 1.0)
                })
            })
            .map(|r| (r.noise, USUAL_FACTOR * r.variance, r.limit))
            .filter(|(noise, error, _)| *error < NOISE_ALONE * noise)
            .map(|(noise, error, limit)| (limit - error) / noise)
            .collect();
        let enough = factors.len() >= N * TESTS_OF_CLASS;
        let factor = enough.then(|| quantile(&mut factors, 0.95)).flatten();
        Self {
            factor: factor.unwrap_or(1.0).clamp(0.5, 2.0),
            ..stated
        }
    }

    /// The same of the mean of some.
    pub fn of_mean<const N: usize>(&self, mean: &MeanPrediction<N>, channel: usize) -> f32 {
        let sum: f32 = mean.bins.iter().map(|bin| self.of(bin, channel)).sum();
        sum / (mean.bins.len() as f32).powi(2)
    }

    /// Variance of the logarithm of a bin's median about the true value at the mean direction, of one
    /// channel.
    pub fn of<const N: usize>(&self, bin: &Bin<N>, channel: usize) -> f32 {
        let of_median = variance_of_median(bin.count);
        let spread = SIGMA_PER_MAD * bin.mad[channel] / bin.median[channel].abs();
        // What the samples scatter by beyond the noise, they do by their places: the mean of these is the
        // bin's, and a median is only off as far as it is not the mean.
        let slope = (spread * spread - self.variance).max(0.0);
        let slope = if slope.is_finite() { slope } else { 0.0 };
        self.factor * (of_median * self.variance + (of_median - 1.0) * slope)
            / bin.count.max(1) as f32
    }
}

/// A residual of one channel.
pub(super) struct Residual {
    /// How many left-out bins it stands for.
    pub weight: f32,
    /// The variance with which the residual just lies within a 95 % interval.
    pub limit: f32,
    /// That of the prediction, not calibrated.
    variance: f32,
    /// That of the bin.
    noise: f32,
}

impl Residual {
    /// Of a logarithm of predicted over measured. A standard error is a share of the predicted value, so that this share
    /// is compared with it: the logarithm itself would be too little where the prediction is far too small.
    pub fn new(residual: Option<f32>, (variance, noise): (f32, f32), weight: f32) -> Option<Self> {
        let share = (-residual?).exponential() - 1.0;
        Some(Self {
            weight,
            limit: (share / Z95).powi(2),
            variance: variance.max(1e-12),
            noise,
        })
    }

    /// The square of the factor with which it just lies within, the noise aside.
    pub fn beyond_noise(&self) -> f32 {
        (self.limit - self.noise) / self.variance
    }

    /// Those of the channels of a mean.
    pub fn of_mean<'a, const N: usize>(
        mean: &'a MeanPrediction<'a, N>,
        noise: &'a BinNoise,
    ) -> impl Iterator<Item = Self> + 'a {
        (0..N).filter_map(move |c| {
            let variances = (mean.variance[c], noise.of_mean(mean, c));
            Self::new(mean.residual[c], variances, mean.first.weight)
        })
    }
}

/// The square of a factor: the share of it that residuals show, and the rest, which is the usual one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Squared {
    pub own: f32,
    pub usual: f32,
}

impl Squared {
    /// Of no residuals.
    pub const USUAL: Self = Self {
        own: 0.0,
        usual: USUAL_FACTOR,
    };

    /// The factor itself, where the residuals' variances were multiplied by a square that another one's is: where noise hides
    /// the error, a block's own variance stands as it is.
    pub fn factor(self, square: f32) -> f32 {
        (self.own * square + self.usual).sqrt()
    }

    /// So many times as large a factor.
    pub fn widened(self, by: f32) -> Self {
        Self {
            own: by * by * self.own,
            usual: by * by * self.usual,
        }
    }
}

/// The factor with which 95 % of the residuals lie within 1.96 standard errors: of each residual the
/// square of the factor that just reaches it, and of these the 95th percentile, each by how many left-out bins it stands
/// for (bins that were measured bright are tested more often: unweighted, those that are predicted bright and are not
/// would count too little); then the mean of that
/// and of the usual one, weighted by their uncertainties. Of residuals that are nearly all noise, the
/// percentile says nothing.
pub(super) fn factor_of<const N: usize>(class: &[&MeanPrediction<N>], noise: &BinNoise) -> Squared {
    let all: Vec<Residual> = class
        .iter()
        .flat_map(|mean| Residual::of_mean(mean, noise))
        .collect();
    let mut squares: Vec<(f32, f32)> = all.iter().map(|r| (r.beyond_noise(), r.weight)).collect();
    let Some(square) = weighted_quantile(&mut squares, 0.95) else {
        return Squared::USUAL;
    };
    let sum = |of: fn(&Residual) -> f32| all.iter().map(|r| r.weight * of(r)).sum::<f32>();
    let noise_share = sum(|r| r.noise) / (sum(|r| r.variance) * square.max(USUAL_FACTOR));
    // The channels of a bin share their error: they count as one. Unequal weights count as fewer equal ones.
    let weights = class.iter().map(|mean| mean.first.weight);
    let (sum, squares) = weights.fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
    let count = sum * sum / squares.max(f32::MIN_POSITIVE);
    let by_chance = PERCENTILE_SPREAD * (1.0 + noise_share) / count.max(1.0).sqrt();
    let by_noise = NOISE_SPREAD * noise_share;
    let uncertainty = (by_chance * by_chance + by_noise * by_noise) / (USUAL_SPREAD * USUAL_SPREAD);
    let weight = 1.0 / (1.0 + uncertainty);
    // What the number of tests leaves open is drawn to the usual one of the variances as they come here, what noise hides to that
    // of the block's own.
    let few = PERCENTILE_SPREAD * PERCENTILE_SPREAD / count.max(1.0);
    let by_few = few / (by_chance * by_chance + by_noise * by_noise);
    let open = (1.0 - weight) * USUAL_FACTOR;
    Squared {
        own: weight * square.max(0.0) + by_few * open,
        usual: (1.0 - by_few) * open,
    }
}

/// Errors of a frame (or cluster) come together: of few of them the 95th percentile is that of Student's distribution, over
/// that of a normal one.
pub(super) fn of_few_groups<const N: usize>(class: &[&MeanPrediction<N>]) -> f32 {
    // The first terms of its expansion by the degrees of freedom, above one within 4 % of it.
    let freedom = (groups_of(class) as f32 - 1.0).max(2.0);
    let z2 = Z95 * Z95;
    let first = (z2 + 1.0) / (4.0 * freedom);
    let second = (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * freedom * freedom);
    let third = (3.0 * z2.powi(3) + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / (384.0 * freedom.powi(3));
    1.0 + first + second + third
}

/// How many frames (or clusters) are in a class.
pub(super) fn groups_of<const N: usize>(class: &[&MeanPrediction<N>]) -> usize {
    let mut groups: Vec<u32> = class.iter().map(|mean| mean.group).collect();
    groups.sort_unstable();
    groups.dedup();
    groups.len()
}

/// The guessed standard deviation by which bins are sorted into classes.
pub(super) fn size<const N: usize>(variance: [f32; N]) -> f32 {
    variance.iter().map(|v| v.max(0.0)).sum::<f32>().sqrt()
}
