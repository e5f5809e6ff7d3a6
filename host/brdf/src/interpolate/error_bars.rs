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
use super::error_factor::{
    BinNoise, Residual, Squared, TESTS_OF_CLASS, factor_of, of_few_groups, size,
};
use super::obliquity::Obliquity;
use crate::bins::Bin;
use crate::dense::DenseBrdf;
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::quantile::weighted_quantile;

/// Means of left-out bins that are predicted, at most.
const TESTS: usize = 12_000;
/// A fold leaves out one frame in so many.
const ONE_IN: u32 = 24;
/// A class by size of the guess holds one in so many means of a part of the domain, at most …
const SIZES: usize = 8;
/// … has [`TESTS_OF_CLASS`] bins at least, and is no wider than by this factor where there are enough: cells of a sparse plan lie where few
/// of its own bins do.
const CLASS_SPAN: f32 = 2.0;
/// Polar angles above this are grazing: views end there, degrees.
const GRAZING_DEG: f64 = 75.0;
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
    /// Of usual brightness, bright and very bright.
    parts: [Classes; 3],
    /// Mean logarithms over the channels above which a value is bright, and very bright.
    bright: [f32; 2],
    /// How the errors grow towards grazing angles.
    obliquity: Obliquity,
    noise: BinNoise,
}

#[derive(Clone, Debug, PartialEq)]
struct Classes {
    /// Upper limits of the guessed standard deviation, ascending, of all classes but the last.
    limits: Vec<f32>,
    /// By the square of what the guess is multiplied.
    factors: Vec<Squared>,
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
        (means.len() >= TESTS_MIN).then(|| Self::from_means(means, noise_variance))
    }

    /// Calibrates on predictions of bins that took no part in the fit.
    fn from_means<const N: usize>(mut means: Vec<MeanPrediction<N>>, noise_variance: f32) -> Self {
        let mut logs: Vec<f32> = means.iter().map(|m| mean(m.first.log)).collect();
        logs.sort_by(f32::total_cmp);
        let at = |share: f32| logs.get((share * logs.len() as f32) as usize);
        let bright = BRIGHT.map(|share| at(share).copied().unwrap_or(0.0));
        let noise = BinNoise::new(&means, noise_variance);
        let obliquity = Obliquity::new(&means, &noise);
        for of in &mut means {
            let (light, view) = place(of.first.bin);
            let square = obliquity.factor(light, view).powi(2);
            for variance in [&mut of.first.variance, &mut of.variance] {
                variance.iter_mut().for_each(|v| *v *= square);
            }
        }
        let mut calibration = Self {
            parts: [(); 3].map(|()| Classes::new::<N>(&[], &noise)),
            bright,
            obliquity,
            noise,
        };
        let all: Vec<&MeanPrediction<N>> = means.iter().collect();
        for part in 0..3 {
            let of_part = |m: &&MeanPrediction<N>| calibration.part(m.first.log) == part;
            let own: Vec<&MeanPrediction<N>> = all.iter().copied().filter(of_part).collect();
            calibration.parts[part] = match own.len() >= TESTS_OF_CLASS {
                true => Classes::new(&own, &noise),
                false => Classes::of_rare(&own, &Classes::new(&all, &noise), &noise),
            };
        }
        calibration
    }

    /// Whether a mean of left-out bins is at grazing angles.
    pub(super) fn is_grazing<const N: usize>(of: &MeanPrediction<N>) -> bool {
        let (light, view) = place(of.first.bin);
        light[2].min(view[2]) < GRAZING_DEG.to_radians().cosine()
    }

    /// The variance that the noise of its bins gives such a mean, of one channel.
    pub(super) fn noise_of<const N: usize>(&self, of: &MeanPrediction<N>, channel: usize) -> f32 {
        self.noise.of_mean(of, channel)
    }

    fn part<const N: usize>(&self, log: [f32; N]) -> usize {
        let brighter = self.bright.iter().filter(|bright| mean(log) > **bright);
        brighter.count()
    }

    /// Standard error of the logarithm, per channel, from a block's logarithm and its variance.
    pub fn standard_error<const N: usize>(
        &self,
        light: Vec3,
        view: Vec3,
        log: [f32; N],
        variance: [f32; N],
    ) -> [f32; N] {
        let oblique = self.obliquity.factor(light, view);
        let square = self.parts[self.part(log)].square(oblique * size(variance));
        let factor = square.factor(oblique * oblique);
        variance.map(|v| factor * v.max(0.0).sqrt())
    }

    /// Whether a left-out bin lies within the 95 % interval of its prediction, the noise of its own
    /// samples included; of the channels that have a residual.
    pub fn covers<'a, const N: usize>(
        &'a self,
        prediction: &'a Prediction<'a, N>,
    ) -> impl Iterator<Item = bool> + 'a {
        let bin = prediction.bin;
        let (light, view) = place(bin);
        let error = self.standard_error(light, view, prediction.log, prediction.variance);
        (0..N).filter_map(move |c| {
            let noise = self.noise.of(bin, c);
            let residual = Residual::new(prediction.residual[c], (1.0, noise), 1.0)?;
            Some(residual.limit <= error[c] * error[c] + noise)
        })
    }
}

impl Classes {
    fn new<const N: usize>(means: &[&MeanPrediction<N>], noise: &BinNoise) -> Self {
        let size = |m: &MeanPrediction<N>| size(m.first.variance);
        let mut sorted: Vec<&MeanPrediction<N>> = means.to_vec();
        sorted.sort_by(|a, b| size(a).total_cmp(&size(b)));
        let length = sorted.len().div_ceil(SIZES).max(TESTS_OF_CLASS);
        let mut limits = Vec::new();
        let mut factors = Vec::new();
        let mut rest = &sorted[..];
        while let Some(first) = rest.first() {
            let within = CLASS_SPAN * size(first);
            let near = rest.partition_point(|m| size(m) <= within);
            let mut n = near.clamp(TESTS_OF_CLASS, length).min(rest.len());
            if rest.len() - n < TESTS_OF_CLASS {
                n = rest.len();
            }
            let (class, others) = rest.split_at(n);
            limits.extend(class.last().map(|last| size(last)));
            factors.push(factor_of(class, noise).widened(of_few_groups(class)));
            rest = others;
        }
        limits.pop();
        // Errors of a frame come together, so that few frames make a class: what its neighbours say
        // steadies it.
        let found = factors.clone();
        let at = |k: usize| found[k.min(found.len() - 1)];
        for (k, factor) in factors.iter_mut().enumerate() {
            let around = [at(k.saturating_sub(1)), at(k), at(k), at(k + 1)];
            *factor = Squared {
                own: 0.25 * around.iter().map(|of| of.own).sum::<f32>(),
                usual: 0.25 * around.iter().map(|of| of.usual).sum::<f32>(),
            };
        }
        if factors.is_empty() {
            factors.push(Squared::USUAL);
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
        let others = others.factors.iter().map(|of| of.factor(1.0));
        let widest = others.fold(own * of_few_groups(means), f32::max);
        Self {
            limits: Vec::new(),
            factors: vec![Squared {
                own: widest * widest,
                usual: 0.0,
            }],
        }
    }

    fn square(&self, size: f32) -> Squared {
        let class = self.limits.partition_point(|limit| *limit < size);
        self.factors[class.min(self.factors.len() - 1)]
    }
}

fn mean<const N: usize>(log: [f32; N]) -> f32 {
    log.iter().sum::<f32>() / N as f32
}

fn place<const N: usize>(bin: &Bin<N>) -> (Vec3, Vec3) {
    (bin.light.map(f64::from), bin.view.map(f64::from))
}
