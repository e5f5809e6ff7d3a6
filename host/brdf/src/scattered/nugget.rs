//! The nugget of a neighbourhood: where the noise of a sample is known, what is noise there follows from how far values
//! spread.

use super::Settings;
use super::places::Near;
use super::wide::{Axes, Correlations, Covariance, Noise, dot};
use crate::elementary::Elementary;
use pulp::Arch;

/// So many of the data say how far values spread.
const SUBSET: usize = 28;
/// Nuggets that are tried, as powers of ten: from the first up or down, as long as data are likelier.
const FIRST: i32 = -2;
const EXPONENTS: std::ops::RangeInclusive<i32> = -6..=3;

/// The same where the noise is not known.
const SUBSET_UNKNOWN: usize = 48;
const EXPONENTS_UNKNOWN: std::ops::RangeInclusive<i32> = -2..=3;
/// Of nuggets with which values are hardly less likely than with the best, by the logarithm, the largest is taken where
/// the noise is not known: what may be noise is not signal.
const HARDLY: f64 = 1.0;

/// Some of the data of a neighbourhood.
struct Subset {
    arch: Arch,
    correlations: Correlations,
    values: Vec<f64>,
    noise: Noise,
    /// The nugget in any case.
    least: f64,
}

impl Subset {
    fn new(
        arch: Arch,
        near: &[Near],
        (values, noise): (&[f64], &Noise),
        covariance: Covariance,
        settings: &Settings,
        every: usize,
    ) -> Self {
        let at = Axes::of(near.iter().step_by(every).map(|n| n.pair));
        Self {
            arch,
            correlations: Correlations::new(arch, &at, covariance),
            values: values.iter().step_by(every).copied().collect(),
            noise: noise.step_by(every),
            least: settings.nugget,
        }
    }

    /// Logarithm of how likely the values are, with noise of a known variance, or the likeliest one.
    fn log_likelihood(&self, nugget: f64, noise_variance: Option<f64>) -> f64 {
        let correlations = &self.correlations;
        let Some(factor) = correlations.factor(self.arch, self.least + nugget, &self.noise) else {
            return f64::NEG_INFINITY;
        };
        let (mut ones, mut y) = (vec![1.0; self.values.len()], self.values.clone());
        factor.forward(self.arch, &mut [&mut ones[..], &mut y[..]]);
        let ones2 = dot(self.arch, &ones, &ones);
        let along = dot(self.arch, &y, &ones);
        let squares = (dot(self.arch, &y, &y) - along * along / ones2).max(1e-300);
        let n = (self.values.len() as f64 - 1.0).max(1.0);
        let signal = noise_variance.map_or(squares / n, |variance| variance / nugget);
        let determinants = factor.log_determinant() + ones2.natural_log();
        -0.5 * (n * signal.natural_log() + determinants + squares / signal)
    }
}

/// The variance of a sample's noise, which is known, over that of the process with which values are likeliest.
pub(super) fn likely_nugget(
    arch: Arch,
    near: &[Near],
    data: (&[f64], &Noise),
    covariance: Covariance,
    settings: &Settings,
) -> f64 {
    let every = near.len().div_ceil(SUBSET);
    let subset = Subset::new(arch, near, data, covariance, settings, every);
    let at =
        |exponent: i32| subset.log_likelihood(10f64.powi(exponent), Some(settings.noise_variance));
    let mut found = (FIRST, at(FIRST));
    let mut sides = [f64::NEG_INFINITY; 2];
    for (side, step) in [-1, 1].into_iter().enumerate() {
        let start = found.0;
        while EXPONENTS.contains(&(found.0 + step)) {
            let likelihood = at(found.0 + step);
            if likelihood <= found.1 {
                sides[side] = likelihood;
                break;
            }
            sides[1 - side] = found.1;
            found = (found.0 + step, likelihood);
        }
        if found.0 != start {
            break;
        }
    }
    // The top of the parabola through the three.
    let [below, above] = sides.map(|side| found.1 - side);
    let offset = 0.5 * (below - above) / (below + above);
    let offset = if offset.is_finite() {
        offset.clamp(-0.5, 0.5)
    } else {
        0.0
    };
    10f64.power(f64::from(found.0) + offset)
}

/// The same where the noise is not known: values about zero have one of their own.
pub(super) fn largest_nugget(
    arch: Arch,
    near: &[Near],
    data: (&[f64], &Noise),
    covariance: Covariance,
    settings: &Settings,
) -> f64 {
    let every = near.len().div_ceil(SUBSET_UNKNOWN);
    let subset = Subset::new(arch, near, data, covariance, settings, every);
    let likelihoods: Vec<(f64, f64)> = EXPONENTS_UNKNOWN
        .map(|exponent| 10f64.powi(exponent))
        .map(|nugget| (nugget, subset.log_likelihood(nugget, None)))
        .collect();
    let most = likelihoods
        .iter()
        .map(|l| l.1)
        .fold(f64::NEG_INFINITY, f64::max);
    let hardly_less = likelihoods.iter().rev().find(|l| l.1 >= most - HARDLY);
    hardly_less.map_or(0.0, |l| l.0)
}
