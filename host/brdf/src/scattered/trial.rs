//! Settings, and what they predict of places that were left out.

use super::Settings;
use super::local::Predicted;
use super::residual::{RESIDUAL_MAX, loss, size};
use crate::elementary::Elementary;

/// One trial is worse than another where its error is larger by this share …
const WORSE_SHARE: f64 = 0.02;
/// … and by so many standard errors of the difference.
const WORSE_SIGMAS: f64 = 1.5;
/// Half the width of a 95 % interval, in standard errors of a normal distribution.
const Z95: f64 = 1.96;
/// Tested factors lie between these: a system takes its kernel and its nugget for known, which are of the same data, so
/// that its own errors are too small even where tests are nearly all noise.
const FACTORS: (f64, f64) = (1.2, 20.0);
/// One predicts as well as another where its mean error is not larger by this share.
const AS_NEAR: f64 = 0.01;

/// Settings, and what they predict of the tests.
#[derive(Clone)]
pub(super) struct Trial {
    pub settings: Settings,
    pub predictions: Vec<Predicted>,
    /// Logarithm of predicted over measured, per channel.
    pub residuals: Vec<[f64; 3]>,
    pub error: f64,
    /// Sum of those of the systems.
    pub log_likelihood: f64,
}

impl Trial {
    /// What is compared: see [`loss`].
    pub fn level(&self, usual: f64) -> f64 {
        if self.residuals.is_empty() {
            return f64::INFINITY;
        }
        let sum: f64 = self.residuals.iter().map(|r| loss(r, usual)).sum();
        sum / self.residuals.len() as f64
    }

    pub fn median(&self) -> f64 {
        let mut sizes: Vec<f64> = self.residuals.iter().map(size).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or(RESIDUAL_MAX)
    }

    /// How likely the residuals are by the variances that are predicted with them, by Student's distribution with four
    /// degrees of freedom: few that are far off do not outweigh all others.
    pub fn score(&self) -> f64 {
        let pairs = self.residuals.iter().zip(&self.predictions);
        pairs
            .map(|(r, p)| {
                let variance = (p.relative[1].powi(2) + p.noise[1]).max(1e-18);
                let far = 1.0 + r[1] * r[1] / (4.0 * variance);
                -0.5 * variance.natural_log() - 2.5 * far.natural_log()
            })
            .sum()
    }

    /// With which 95 % of the residuals lie within 1.96 standard errors, noise included. A residual counts by the share
    /// of its variance that is not noise: what noise hides says nothing. Where all is noise, the systems' own errors stand.
    pub fn factor(&self) -> f64 {
        let mut shown: Vec<(f64, f64)> = self
            .residuals
            .iter()
            .zip(&self.predictions)
            .flat_map(|(r, p)| {
                [0, 1, 2].map(|c| {
                    let variance = p.relative[c].powi(2).max(1e-18);
                    let ratio = ((r[c] / Z95).powi(2) - p.noise[c]) / variance;
                    (ratio, variance / (variance + p.noise[c]))
                })
            })
            .collect();
        shown.sort_by(|a, b| a.0.total_cmp(&b.0));
        let sum: f64 = shown.iter().map(|(_, share)| share).sum();
        let mut within = 0.0;
        let last = shown.iter().find(|(_, share)| {
            within += share;
            within >= 0.95 * sum
        });
        let ratio = last.map_or(1.0, |(ratio, _)| *ratio);
        ratio.clamp(FACTORS.0.powi(2), FACTORS.1.powi(2)).sqrt()
    }
}

/// Whether the first is worse than the second beyond chance.
pub(super) fn worse(a: &Trial, b: &Trial, usual: f64) -> bool {
    let (difference, chance) = difference(a, b, usual);
    difference > WORSE_SHARE * b.level(usual) && difference > WORSE_SIGMAS * chance
}

/// By how much the first predicts worse than the second, and the standard error of that.
fn difference(a: &Trial, b: &Trial, usual: f64) -> (f64, f64) {
    let n = a.residuals.len().min(b.residuals.len()) as f64;
    let differences = || {
        let pairs = a.residuals.iter().zip(&b.residuals);
        pairs.map(|(a, b)| loss(a, usual) - loss(b, usual))
    };
    let mean = differences().sum::<f64>() / n;
    let variance = differences().map(|d| (d - mean).powi(2)).sum::<f64>() / n;
    (mean, (variance / n).sqrt())
}

/// Whether the first is no worse than the second, even by chance, by either measure.
pub(super) fn is_as_near(a: &Trial, b: &Trial, usual: f64) -> bool {
    let (difference, chance) = difference(a, b, usual);
    difference <= chance && a.error <= (1.0 + AS_NEAR) * b.error
}
