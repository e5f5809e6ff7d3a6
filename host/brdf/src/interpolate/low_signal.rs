//! Values below their noise. The logarithm of a single one says little: its mean lies far below the logarithm
//! of the truth, and half of the values may have none at all.
//!
//! Where values at or below zero show that the noise is as large as the signal, a datum's logarithm is
//! replaced by ln m + (v − m) / m, with the mean m of so many neighbours that it is well above zero: the
//! working response of a generalised linear model with logarithmic link (McCullagh and Nelder, *Generalized
//! Linear Models*, section 2.5). It is linear in v, and so its mean is that of the truth. Data without such values
//! around them stay as they are.

use super::datum::{Datum, SIGMA_PER_MAD};
use crate::bins::Bins;
use crate::elementary::Elementary;
use crate::quantile::median;
use rayon::prelude::*;

/// Leaves, as a power of two, in which values at or below zero are looked for: two or three hundred bins.
const WINDOW: usize = 5;
/// A mean is well above zero at so many standard errors.
const WELL_ABOVE: f64 = 4.0;
/// Data of so many standard deviations of the noise have sound logarithms.
const SOUND: f64 = 5.0;
/// A leaf is of the same signal as a mean that it is within so many standard errors of.
const SAME: f64 = 3.0;

/// What is known of the values of some data, of one channel.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    value: f64,
    square: f64,
    not_positive: f64,
    square_below: f64,
    /// Robust standard deviation within a leaf, times its data.
    spread: f64,
}

impl Sums {
    fn of(values: &[f64]) -> Self {
        let mut near: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        let middle = median(&mut near);
        near.iter_mut().for_each(|v| *v = (*v - middle).abs());
        let count = values.len() as f64;
        let start = Self {
            count,
            spread: count * f64::from(SIGMA_PER_MAD * median(&mut near)),
            ..Self::default()
        };
        values.iter().fold(start, |sums, v| Self {
            value: sums.value + v,
            square: sums.square + v * v,
            not_positive: sums.not_positive + f64::from(u8::from(*v <= 0.0)),
            square_below: sums.square_below + v.min(0.0).powi(2),
            ..sums
        })
    }

    fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            value: self.value + other.value,
            square: self.square + other.square,
            not_positive: self.not_positive + other.not_positive,
            square_below: self.square_below + other.square_below,
            spread: self.spread + other.spread,
        }
    }

    fn mean(&self) -> f64 {
        self.value / self.count.max(1.0)
    }

    /// Standard deviation of the noise: what values of a leaf scatter by, unless a highlight does; values
    /// below zero reach down by half of it where the signal is as large. Where these lie far below what all
    /// scatter by, they are outliers, and there is no noise to see.
    fn noise(&self) -> f64 {
        let spread = self.spread / self.count.max(1.0);
        let depth = (self.square_below / self.not_positive.max(1.0)).sqrt();
        if depth > OUTLIER * spread {
            0.0
        } else {
            // Zeros alone may stand for what was not measured.
            spread.min(2.0 * depth)
        }
    }
}

/// Values below zero by so many standard deviations, in the mean of squares, are no noise: that of noise alone
/// is one.
const OUTLIER: f64 = 1.5;

/// Replaces logarithms where the signal is below the noise. `data` are in the order of a balanced tree whose
/// leaves, two to some power, begin at `starts`. Noise then differs by orders of magnitude between data: each counts
/// by the inverse of its variance. Returns the variance of a replaced logarithm, which is that of one sample now,
/// where these are more than half of all.
pub(super) fn linearize(data: &mut [Datum], starts: &[u32], bins: &Bins) -> Option<f32> {
    let is_low = |c: usize| bins.bins().par_iter().any(|bin| bin.median[c] <= 0.0);
    let low: Vec<usize> = (0..3).filter(|c| is_low(*c)).collect();
    if low.is_empty() {
        return None;
    }
    let sound = bins.noise_variance().unwrap_or(SOUND_VARIANCE);
    // Of each datum, the sum over the channels.
    let mut variances = vec![3.0 * sound; data.len()];
    let (mut replaced, mut sum) = (0usize, 0.0f64);
    for c in low {
        let value = |datum: &Datum| f64::from(bins.bins()[datum.bin()].median[c]);
        let levels = levels(data, starts, value);
        let found: Vec<(usize, f64)> = leaves(data, &mut variances, starts)
            .into_par_iter()
            .enumerate()
            .filter_map(|(number, (leaf, variances))| {
                let around = around(&levels, number)?;
                for (datum, variance) in leaf.iter_mut().zip(variances) {
                    let log = around.mean.natural_log() + value(datum) / around.mean - 1.0;
                    datum.log_value[c] = (log + around.bias) as f32;
                    *variance += (around.variance as f32).max(sound) - sound;
                }
                Some((leaf.len(), around.variance * leaf.len() as f64))
            })
            .collect();
        replaced += found.iter().map(|f| f.0).sum::<usize>();
        sum += found.iter().map(|f| f.1).sum::<f64>();
    }
    let most = 2 * replaced > 3 * data.len();
    let of_one = if most {
        (sum / replaced as f64) as f32
    } else {
        sound
    };
    for (datum, variance) in data.iter_mut().zip(&variances) {
        datum.count *= 3.0 * of_one / variance;
    }
    most.then_some(of_one)
}

/// Variance of a logarithm that is above the noise, where samples do not tell it.
const SOUND_VARIANCE: f32 = 1e-4;

/// The data of each leaf, with what else is known of each.
fn leaves<'a>(
    mut data: &'a mut [Datum],
    mut other: &'a mut [f32],
    starts: &[u32],
) -> Vec<(&'a mut [Datum], &'a mut [f32])> {
    starts
        .windows(2)
        .map(|w| {
            let size = (w[1] - w[0]) as usize;
            let (leaf, rest) = std::mem::take(&mut data).split_at_mut(size);
            let (of_leaf, others) = std::mem::take(&mut other).split_at_mut(size);
            (data, other) = (rest, others);
            (leaf, of_leaf)
        })
        .collect()
}

/// Sums of the leaves, of pairs of them, and so on to those of all.
fn levels(data: &[Datum], starts: &[u32], value: impl Fn(&Datum) -> f64) -> Vec<Vec<Sums>> {
    let leaves = starts.windows(2).map(|w| {
        let leaf = &data[w[0] as usize..w[1] as usize];
        Sums::of(&leaf.iter().map(&value).collect::<Vec<f64>>())
    });
    let mut levels: Vec<Vec<Sums>> = vec![leaves.collect()];
    while let Some(last) = levels.last().filter(|level| level.len() > 1) {
        let halves = last.chunks(2).map(|pair| {
            pair.iter()
                .fold(Sums::default(), |sums, half| sums.and(*half))
        });
        let next = halves.collect();
        levels.push(next);
    }
    levels
}

/// What is known around a leaf whose signal is below the noise.
struct Around {
    /// The mean.
    mean: f64,
    /// By how much its logarithm is too low in the mean.
    bias: f64,
    /// Variance of a value over the square of the mean.
    variance: f64,
}

/// `None` where logarithms are sound, or there is no mean to take.
fn around(levels: &[Vec<Sums>], number: usize) -> Option<Around> {
    let at = |level: usize| levels[level][number >> level];
    let top = levels.len() - 1;
    let (leaf, window) = (at(0), at(WINDOW.min(top)));
    let noise = window.noise();
    if window.not_positive == 0.0 || noise == 0.0 || leaf.mean() >= SOUND * noise {
        return None;
    }
    // As the window says, not as the leaf does: a leaf that is high by chance would be taken for its mean.
    let wanted = (WELL_ABOVE * noise / window.mean().max(1e-12 * noise)).powi(2);
    let enough = (0..=top).find(|level| at(*level).count >= wanted);
    (0..=enough.unwrap_or(top)).rev().find_map(|level| {
        let sums = at(level);
        let mean = sums.mean();
        let same = (leaf.mean() - mean).abs() <= SAME * noise / leaf.count.max(1.0).sqrt();
        let of_mean = (sums.square / sums.count - mean * mean).max(0.0) / sums.count;
        (mean > 0.0 && same).then(|| Around {
            mean,
            bias: 0.5 * of_mean / (mean * mean),
            variance: (noise / mean).powi(2),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Data, FillSettings, fill, select};
    use crate::bins::Bins;
    use crate::direction::{Direction, dot};
    use crate::elementary::Elementary;
    use crate::grid::Grid;
    use crate::progress::silent;
    use crate::random::Random;
    use crate::sample::Sample;

    /// Samples all over both hemispheres, of a lobe of so much over a constant, with noise.
    fn samples(constant: f64, lobe: f64, noise: f64, n: usize) -> Vec<Sample> {
        let mut random = Random::new(5);
        let mut direction = || {
            let theta = random
                .between(84f64.to_radians().cosine(), 1.0)
                .arc_cosine();
            Direction::from_deg(theta.to_degrees(), random.between(0.0, 360.0))
        };
        let places: Vec<_> = (0..n).map(|_| (direction(), direction())).collect();
        places
            .into_iter()
            .map(|(light, view)| {
                let [l, v] = [light, view].map(Direction::to_vec3);
                let aspecular = dot([-l[0], -l[1], l[2]], v).max(0.0);
                let value = constant + lobe * aspecular.powi(40) + noise * random.normal();
                Sample::new(light, view, [value as f32; 3])
            })
            .collect()
    }

    fn filled(samples: &[Sample]) -> crate::DenseBrdf {
        let bins = Bins::new(Grid::with_step_deg(10.0).unwrap(), samples);
        let data = Data::new(&bins);
        let base = FillSettings {
            block_deg: 20.0,
            ..FillSettings::DEFAULT
        };
        fill(&data, &select(&data, base).settings, &silent).unwrap()
    }

    #[test]
    fn a_constant_below_its_noise_comes_out_as_it_is() {
        for noise in [0.0005, 0.001, 0.003] {
            let dense = filled(&samples(0.001, 0.0, noise, 20_000));
            let plane = &dense.planes()[1];
            let mut sorted = plane.clone();
            let median = crate::quantile::median(&mut sorted);
            let mean = plane.iter().sum::<f32>() / plane.len() as f32;
            assert!(
                (median / 0.001 - 1.0).abs() < 0.04,
                "{noise}: median {median}"
            );
            assert!((mean / 0.001 - 1.0).abs() < 0.06, "{noise}: mean {mean}");
        }
    }

    #[test]
    fn a_highlight_over_noise_keeps_its_height() {
        let dense = filled(&samples(0.001, 1.0, 0.001, 20_000));
        let clean = filled(&samples(0.001, 1.0, 0.0, 20_000));
        let bright = dense.planes()[0]
            .iter()
            .zip(&clean.planes()[0])
            .filter(|(_, clean)| **clean > 0.1);
        let logs: Vec<f32> = bright
            .map(|(noisy, clean)| (noisy / clean).natural_log())
            .collect();
        let mean = logs.iter().sum::<f32>() / logs.len() as f32;
        assert!(
            logs.len() > 1000 && mean.abs() < 0.05,
            "{mean} of {}",
            logs.len()
        );
    }

    #[test]
    fn signs_that_were_flipped_do_not_make_sound_values_noise() {
        let sound = samples(0.1, 1.0, 0.0, 20_000);
        let mut flipped = sound.clone();
        for s in flipped.iter_mut().step_by(50) {
            s.rgb = s.rgb.map(|v| -v);
        }
        let bins = Bins::new(Grid::with_step_deg(10.0).unwrap(), &flipped);
        let data = Data::new(&bins);
        assert_eq!(data.hierarchy().noise_variance(), None);
        let (with, without) = (filled(&flipped), filled(&sound));
        let logs = with.planes()[0].iter().zip(&without.planes()[0]);
        let logs: Vec<f32> = logs.map(|(a, b)| (a / b).natural_log().abs()).collect();
        let mean = logs.iter().sum::<f32>() / logs.len() as f32;
        assert!(mean < 0.02, "{mean}");
    }
}
