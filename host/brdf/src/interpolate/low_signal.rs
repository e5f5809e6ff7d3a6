//! Values below their noise. The logarithm of a single one says little: its mean lies far below the logarithm
//! of the truth, and half of the values may have none at all.
//!
//! Where values at or below zero show that the noise is as large as the signal, a datum's logarithm is
//! replaced by ln m + (v − m) / m, with the mean m of so many neighbours that it is well above zero: the
//! working response of a generalised linear model with logarithmic link (McCullagh and Nelder, *Generalized
//! Linear Models*, section 2.5). It is linear in v, and so its mean is that of the truth. Data without such values
//! around them stay as they are.

use super::datum::Datum;
use crate::bins::Bins;
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
}

impl Sums {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        values.fold(Self::default(), |sums, v| Self {
            count: sums.count + 1.0,
            value: sums.value + v,
            square: sums.square + v * v,
            not_positive: sums.not_positive + f64::from(u8::from(v <= 0.0)),
            square_below: sums.square_below + v.min(0.0).powi(2),
        })
    }

    fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            value: self.value + other.value,
            square: self.square + other.square,
            not_positive: self.not_positive + other.not_positive,
            square_below: self.square_below + other.square_below,
        }
    }

    fn mean(&self) -> f64 {
        self.value / self.count.max(1.0)
    }

    /// Standard deviation of the noise, as far as values below zero show it: they reach about half of it below zero
    /// where the signal is as large. Of values that were clipped at zero, it is that of all.
    fn noise(&self) -> f64 {
        if self.square_below > 0.0 {
            return 2.0 * (self.square_below / self.not_positive).sqrt();
        }
        (self.square / self.count.max(1.0) - self.mean().powi(2)).max(0.0).sqrt()
    }
}

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
                    let signal = around.mean.map_or(value(datum).abs(), |(mean, _)| mean);
                    let own = (around.noise / signal.max(1e-3 * around.noise)).powi(2) as f32;
                    *variance += own.max(sound) - sound;
                    if let Some((mean, bias)) = around.mean {
                        datum.log_value[c] = (mean.ln() + value(datum) / mean - 1.0 + bias) as f32;
                    }
                }
                let (mean, _) = around.mean?;
                let squares = (around.noise / mean).powi(2) * leaf.len() as f64;
                Some((leaf.len(), squares))
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
        Sums::of(leaf.iter().map(&value))
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

/// What values at or below zero around a leaf tell.
struct Around {
    /// Standard deviation of the noise.
    noise: f64,
    /// The mean around the leaf, and by how much its logarithm is too low in the mean; `None` where the leaf's own
    /// logarithms are sound, or there is no mean to take.
    mean: Option<(f64, f64)>,
}

/// `None` where no value is at or below zero.
fn around(levels: &[Vec<Sums>], number: usize) -> Option<Around> {
    let at = |level: usize| levels[level][number >> level];
    let top = levels.len() - 1;
    let (leaf, window) = (at(0), at(WINDOW.min(top)));
    let noise = window.noise();
    if window.not_positive == 0.0 {
        return None;
    }
    if leaf.mean() >= SOUND * noise {
        return Some(Around { noise, mean: None });
    }
    // As the window says, not as the leaf does: a leaf that is high by chance would be taken for its mean.
    let wanted = (WELL_ABOVE * noise / window.mean().max(1e-12 * noise)).powi(2);
    let enough = (0..=top).find(|level| at(*level).count >= wanted);
    let mean = (0..=enough.unwrap_or(top)).rev().find_map(|level| {
        let sums = at(level);
        let mean = sums.mean();
        let same = (leaf.mean() - mean).abs() <= SAME * noise / leaf.count.max(1.0).sqrt();
        let variance = (sums.square / sums.count - mean * mean).max(0.0) / sums.count;
        (mean > 0.0 && same).then(|| (mean, 0.5 * variance / (mean * mean)))
    });
    Some(Around { noise, mean })
}

#[cfg(test)]
mod tests {
    use super::super::{Data, FillSettings, fill, select};
    use crate::bins::Bins;
    use crate::direction::{Direction, dot};
    use crate::grid::Grid;
    use crate::progress::silent;
    use crate::random::Random;
    use crate::sample::Sample;

    /// Samples all over both hemispheres, of a lobe of so much over a constant, with noise.
    fn samples(constant: f64, lobe: f64, noise: f64, n: usize) -> Vec<Sample> {
        let mut random = Random::new(5);
        let mut direction = || {
            let theta = random.between(84f64.to_radians().cos(), 1.0).acos();
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
            assert!((median / 0.001 - 1.0).abs() < 0.04, "{noise}: median {median}");
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
        let logs: Vec<f32> = bright.map(|(noisy, clean)| (noisy / clean).ln()).collect();
        let mean = logs.iter().sum::<f32>() / logs.len() as f32;
        assert!(logs.len() > 1000 && mean.abs() < 0.05, "{mean} of {}", logs.len());
    }
}
