//! Standard errors: the variance of the blocks, calibrated by cross-validation. The value of a measured
//! cell is a block's too, which its samples take part in by their number and their spread, so that its
//! standard error is found in the same way.
//!
//! A block's own variance is a guess: it rests on one kernel and on few data. How far off it is,
//! is measured on frames that were left out, class by class (polar angle, brightness, and size of the
//! guess): of the mean residual of a frame's bins in one block, because noise averages out of it and the block's error
//! does not. Each class gets the factor with which 95 % of these means lie within 1.96 standard errors, the
//! bins' own noise included. Where that noise hides the error even so, the block's own variance stands.

use super::FillSettings;
use super::block::kernel::{AnyKernel, NewBlock};
use super::cross_validation::{Fold, MeanPrediction, Prediction, TESTS_MIN};
use super::data::Data;
use super::datum::SIGMA_PER_MAD;
use crate::bins::{Bin, variance_of_median};
use crate::dense::DenseBrdf;
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::quantile::{quantile, weighted_quantile};

/// Half the width of a 95 % interval, in standard errors of a normal distribution.
pub const Z95: f32 = 1.96;
/// Means of left-out bins that are predicted, at most.
const TESTS: usize = 12_000;
/// A fold leaves out one frame in so many.
const ONE_IN: u32 = 24;
/// A class by size of the guess holds one in so many means of a part of the domain, at most …
const SIZES: usize = 8;
/// … and bins at least: fewer do not determine a 95th percentile …
const CLASS_MIN: usize = 100;
/// … and is no wider than by this factor where there are enough: cells of a sparse plan lie where few
/// of its own bins do.
const CLASS_SPAN: f32 = 2.0;
/// Polar angles above this are a class of their own: views end there, degrees.
const GRAZING_DEG: f64 = 75.0;
/// The factor where noise alone makes the error: what the block itself says …
const USUAL_FACTOR: f32 = 1.0;
/// … give or take this share of its square.
const USUAL_SPREAD: f32 = 0.5;
/// Standard deviation of a 95th percentile of squares of normal values over their 95th percentile,
/// times the root of their number: `2 √(0.05 · 0.95) / (1.96 · 2 φ(1.96))`, φ the normal density.
const PERCENTILE_SPREAD: f32 = 1.9;
/// So well is the variance of the bins' noise data, as a share.
const NOISE_SPREAD: f32 = 0.1;
/// A bin whose predicted variance is less than this share of its noise's shows the noise alone.
const NOISE_ALONE: f32 = 0.1;
/// Values beyond the first of these shares of the tested ones are bright, beyond the second very bright: half of what is
/// tested is of the brightest tenth of all.
const BRIGHT: [f32; 2] = [0.5, 0.9];

/// Standard errors of a dense BRDF.
#[derive(Clone, Debug)]
pub struct ErrorBars<const N: usize = 3> {
    /// Standard error per channel, in the unit of the values, cell by cell.
    pub standard_error: [Vec<f32>; N],
    /// An [`Origin`](super::Origin) a cell.
    pub origin: Vec<u8>,
}

impl<const N: usize> ErrorBars<N> {
    /// Standard errors as shares of the values they belong to, mean over the channels, cell by cell.
    pub fn relative(&self, values: &DenseBrdf<N>) -> Vec<f32> {
        let planes = values.planes();
        (0..self.origin.len())
            .map(|cell| {
                let of_channel = |c: usize| self.standard_error[c][cell] / planes[c][cell];
                (0..N).map(of_channel).sum::<f32>() / N as f32
            })
            .collect()
    }
}

/// What turns a block's variance into a standard error.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// By [`Calibration::part`]: interior and grazing, each of usual brightness, bright and very bright.
    parts: [Classes; 6],
    /// Mean logarithms over the channels above which a value is bright, and very bright.
    bright: [f32; 2],
    noise: BinNoise,
}

/// The noise of bins: how far a bin's median lies from the true value at its mean direction.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BinNoise {
    /// Variance of the logarithm of one sample.
    variance: f32,
    /// What bins show of it in fact, over what their samples' number and spread say.
    factor: f32,
}

#[derive(Clone, Debug, PartialEq)]
struct Classes {
    /// Upper limits of the guessed standard deviation, ascending, of all classes but the last.
    limits: Vec<f32>,
    /// By what the guess is multiplied.
    factors: Vec<f32>,
}

impl Calibration {
    /// Calibrates by cross-validation. `None` when there are too few frames (or clusters of directions)
    /// for a fold.
    pub fn new<const N: usize>(data: &Data<N>, settings: &FillSettings) -> Option<Self>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let bins = data.bins();
        let sorted = data.sorted_for(settings.coordinates);
        let data = sorted.as_ref().unwrap_or(data);
        let folds = Fold::number_of_many_groups(bins, ONE_IN);
        let mut means = Vec::new();
        for number in 0..folds {
            let number = ONE_IN - 1 - number;
            let fold = Fold::one_of_many(bins, number, ONE_IN, TESTS / folds as usize);
            if let Some(fold) = fold {
                means.extend(fold.predict_means(data, settings));
            }
        }
        let noise_variance = settings.noise_variance;
        (means.len() >= TESTS_MIN).then(|| Self::from_means(&means, noise_variance))
    }

    /// Calibrates on predictions of bins that took no part in the fit.
    fn from_means<const N: usize>(means: &[MeanPrediction<N>], noise_variance: f32) -> Self {
        let mut logs: Vec<f32> = means.iter().map(|m| mean(m.first.log)).collect();
        logs.sort_by(f32::total_cmp);
        let at = |share: f32| logs.get((share * logs.len() as f32) as usize);
        let bright = BRIGHT.map(|share| at(share).copied().unwrap_or(0.0));
        let noise = BinNoise::new(means, noise_variance);
        let mut calibration = Self {
            parts: [(); 6].map(|()| Classes::new::<N>(&[], &noise)),
            bright,
            noise,
        };
        let all: Vec<&MeanPrediction<N>> = means.iter().collect();
        for part in 0..6 {
            let of_part = |m: &&MeanPrediction<N>| {
                let bin = m.first.bin;
                let (light, view) = (bin.light.map(f64::from), bin.view.map(f64::from));
                calibration.part(light, view, m.first.log) == part
            };
            let own: Vec<&MeanPrediction<N>> = all.iter().copied().filter(of_part).collect();
            calibration.parts[part] = match own.len() >= CLASS_MIN {
                true => Classes::new(&own, &noise),
                false => Classes::of_rare(&own, &Classes::new(&all, &noise), &noise),
            };
        }
        calibration
    }

    /// Whether a mean of left-out bins is at grazing angles, and whether it is very bright.
    pub(super) fn place_of<const N: usize>(&self, of: &MeanPrediction<N>) -> (bool, bool) {
        let bin = of.first.bin;
        let (light, view) = (bin.light.map(f64::from), bin.view.map(f64::from));
        let part = self.part(light, view, of.first.log);
        (part >= 3, part % 3 == 2)
    }

    /// The variance that the noise of its bins gives such a mean, of one channel.
    pub(super) fn noise_of<const N: usize>(&self, of: &MeanPrediction<N>, channel: usize) -> f32 {
        self.noise.of_mean(of, channel)
    }

    fn part<const N: usize>(&self, light: Vec3, view: Vec3, log: [f32; N]) -> usize {
        let grazing = light[2].min(view[2]) < GRAZING_DEG.to_radians().cosine();
        let brighter = self.bright.iter().filter(|bright| mean(log) > **bright);
        3 * usize::from(grazing) + brighter.count()
    }

    /// Standard error of the logarithm, per channel, from a block's logarithm and its variance.
    pub fn standard_error<const N: usize>(
        &self,
        light: Vec3,
        view: Vec3,
        log: [f32; N],
        variance: [f32; N],
    ) -> [f32; N] {
        let factor = self.parts[self.part(light, view, log)].factor(size(variance));
        variance.map(|v| factor * v.max(0.0).sqrt())
    }

    /// Whether a left-out bin lies within the 95 % interval of its prediction, the noise of its own
    /// samples included; of the channels that have a residual.
    pub fn covers<'a, const N: usize>(
        &'a self,
        prediction: &'a Prediction<'a, N>,
    ) -> impl Iterator<Item = bool> + 'a {
        let bin = prediction.bin;
        let (light, view) = (bin.light.map(f64::from), bin.view.map(f64::from));
        let error = self.standard_error(light, view, prediction.log, prediction.variance);
        (0..N).filter_map(move |c| {
            let noise = self.noise.of(bin, c);
            let residual = Residual::new(prediction.residual[c], (1.0, noise), 1.0)?;
            Some(residual.limit <= error[c] * error[c] + noise)
        })
    }
}

impl BinNoise {
    /// Finds the factor on bins that show noise alone; without enough of them it is 1.
    fn new<const N: usize>(means: &[MeanPrediction<N>], variance: f32) -> Self {
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
            .map(|r| (r.noise, USUAL_FACTOR.powi(2) * r.variance, r.limit))
            .filter(|(noise, error, _)| *error < NOISE_ALONE * noise)
            .map(|(noise, error, limit)| (limit - error) / noise)
            .collect();
        let enough = factors.len() >= N * CLASS_MIN;
        let factor = enough.then(|| quantile(&mut factors, 0.95)).flatten();
        Self {
            factor: factor.unwrap_or(1.0).clamp(0.5, 2.0),
            ..stated
        }
    }

    /// The same of the mean of some.
    fn of_mean<const N: usize>(&self, mean: &MeanPrediction<N>, channel: usize) -> f32 {
        let sum: f32 = mean.bins.iter().map(|bin| self.of(bin, channel)).sum();
        sum / (mean.bins.len() as f32).powi(2)
    }

    /// Variance of the logarithm of a bin's median about the true value at the mean direction, of one
    /// channel.
    fn of<const N: usize>(&self, bin: &Bin<N>, channel: usize) -> f32 {
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
struct Residual {
    /// How many left-out bins it stands for.
    weight: f32,
    /// The variance with which the residual just lies within a 95 % interval.
    limit: f32,
    /// That of the prediction, not calibrated.
    variance: f32,
    /// That of the bin.
    noise: f32,
}

impl Residual {
    /// Of a logarithm of predicted over measured. A standard error is a share of the predicted value, so that this share
    /// is compared with it: the logarithm itself would be too little where the prediction is far too small.
    fn new(residual: Option<f32>, (variance, noise): (f32, f32), weight: f32) -> Option<Self> {
        let share = (-residual?).exponential() - 1.0;
        Some(Self {
            weight,
            limit: (share / Z95).powi(2),
            variance: variance.max(1e-12),
            noise,
        })
    }

    /// The square of the factor with which it just lies within, the noise aside.
    fn beyond_noise(&self) -> f32 {
        (self.limit - self.noise) / self.variance
    }

    /// Those of the channels of a mean.
    fn of_mean<'a, const N: usize>(
        mean: &'a MeanPrediction<'a, N>,
        noise: &'a BinNoise,
    ) -> impl Iterator<Item = Self> + 'a {
        (0..N).filter_map(move |c| {
            let variances = (mean.variance[c], noise.of_mean(mean, c));
            Self::new(mean.residual[c], variances, mean.first.weight)
        })
    }
}

impl Classes {
    fn new<const N: usize>(means: &[&MeanPrediction<N>], noise: &BinNoise) -> Self {
        let size = |m: &MeanPrediction<N>| size(m.first.variance);
        let mut sorted: Vec<&MeanPrediction<N>> = means.to_vec();
        sorted.sort_by(|a, b| size(a).total_cmp(&size(b)));
        let length = sorted.len().div_ceil(SIZES).max(CLASS_MIN);
        let mut limits = Vec::new();
        let mut factors = Vec::new();
        let mut rest = &sorted[..];
        while let Some(first) = rest.first() {
            let within = CLASS_SPAN * size(first);
            let near = rest.partition_point(|m| size(m) <= within);
            let mut n = near.clamp(CLASS_MIN, length).min(rest.len());
            if rest.len() - n < CLASS_MIN {
                n = rest.len();
            }
            let (class, others) = rest.split_at(n);
            limits.extend(class.last().map(|last| size(last)));
            factors.push(factor_of(class, noise) * of_few_groups(class));
            rest = others;
        }
        limits.pop();
        // Errors of a frame come together, so that few frames make a class: what its neighbours say
        // steadies it.
        let squares = factors.clone();
        let square = |k: usize| squares[k.min(squares.len() - 1)].powi(2);
        for (k, factor) in factors.iter_mut().enumerate() {
            let around = square(k.saturating_sub(1)) + 2.0 * square(k) + square(k + 1);
            *factor = (0.25 * around).sqrt();
        }
        if factors.is_empty() {
            factors.push(USUAL_FACTOR);
        }
        Self { limits, factors }
    }

    /// Of too few to say much: the widest of what all others say, or wider where its own members are.
    fn of_rare<const N: usize>(
        means: &[&MeanPrediction<N>],
        others: &Self,
        noise: &BinNoise,
    ) -> Self {
        let mut squares: Vec<(f32, f32)> = means
            .iter()
            .flat_map(|mean| Residual::of_mean(mean, noise))
            .map(|r| (r.beyond_noise(), r.weight))
            .collect();
        let own = weighted_quantile(&mut squares, 0.95);
        let own = own.unwrap_or(0.0).max(0.0).sqrt();
        let widest = others
            .factors
            .iter()
            .copied()
            .fold(own * of_few_groups(means), f32::max);
        Self {
            limits: Vec::new(),
            factors: vec![widest],
        }
    }

    fn factor(&self, size: f32) -> f32 {
        let class = self.limits.partition_point(|limit| *limit < size);
        self.factors[class.min(self.factors.len() - 1)]
    }
}

/// The factor with which 95 % of the residuals lie within 1.96 standard errors: of each residual the
/// square of the factor that just reaches it, and of these the 95th percentile, each by how many left-out bins it stands
/// for (bins that were measured bright are tested more often: unweighted, those that are predicted bright and are not
/// would count too little); then the mean of that
/// and of the usual one, weighted by their uncertainties. Of residuals that are nearly all noise, the
/// percentile says nothing.
fn factor_of<const N: usize>(class: &[&MeanPrediction<N>], noise: &BinNoise) -> f32 {
    let all: Vec<Residual> = class
        .iter()
        .flat_map(|mean| Residual::of_mean(mean, noise))
        .collect();
    let mut squares: Vec<(f32, f32)> = all.iter().map(|r| (r.beyond_noise(), r.weight)).collect();
    let usual = USUAL_FACTOR * USUAL_FACTOR;
    let Some(square) = weighted_quantile(&mut squares, 0.95) else {
        return USUAL_FACTOR;
    };
    let sum = |of: fn(&Residual) -> f32| all.iter().map(|r| r.weight * of(r)).sum::<f32>();
    let noise_share = sum(|r| r.noise) / (sum(|r| r.variance) * square.max(usual));
    // The channels of a bin share their error: they count as one. Unequal weights count as fewer equal ones.
    let weights = class.iter().map(|mean| mean.first.weight);
    let (sum, squares) = weights.fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
    let count = sum * sum / squares.max(f32::MIN_POSITIVE);
    let by_chance = PERCENTILE_SPREAD * (1.0 + noise_share) / count.max(1.0).sqrt();
    let by_noise = NOISE_SPREAD * noise_share;
    let uncertainty = (by_chance * by_chance + by_noise * by_noise) / (USUAL_SPREAD * USUAL_SPREAD);
    let weight = 1.0 / (1.0 + uncertainty);
    (weight * square.max(0.0) + (1.0 - weight) * usual).sqrt()
}

/// Errors of a frame (or cluster) come together: of few of them the 95th percentile is that of Student's distribution, over
/// that of a normal one.
fn of_few_groups<const N: usize>(class: &[&MeanPrediction<N>]) -> f32 {
    let mut groups: Vec<u32> = class.iter().map(|mean| mean.group).collect();
    groups.sort_unstable();
    groups.dedup();
    // The first terms of its expansion by the degrees of freedom, above one within 4 % of it.
    let freedom = (groups.len() as f32 - 1.0).max(2.0);
    let z2 = Z95 * Z95;
    let first = (z2 + 1.0) / (4.0 * freedom);
    let second = (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * freedom * freedom);
    let third = (3.0 * z2.powi(3) + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / (384.0 * freedom.powi(3));
    1.0 + first + second + third
}

fn size<const N: usize>(variance: [f32; N]) -> f32 {
    variance.iter().map(|v| v.max(0.0)).sum::<f32>().sqrt()
}

fn mean<const N: usize>(log: [f32; N]) -> f32 {
    log.iter().sum::<f32>() / N as f32
}
