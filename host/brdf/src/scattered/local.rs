//! A kriging system through the data around a place, in double precision.

use super::data::Datum;
use super::narrow::Narrow;
use super::nugget::{largest_nugget, likely_nugget};
use super::places::Near;
use super::wide::{Axes, Correlations, Covariance, Factor, Noise, covariances, dot};
use super::{Response, Settings};
use crate::elementary::Elementary;
use crate::interpolate::coordinates::Pair;
use pulp::Arch;

/// Ordinary kriging (constant unknown mean) of three channels with one factorisation.
pub(super) struct Local {
    arch: Arch,
    response: Response,
    at: Axes,
    covariance: Covariance,
    factor: Factor,
    /// `L⁻¹ 1` and the square of its length.
    ones: Vec<f64>,
    ones2: f64,
    /// Those of one channel, or of all: what stands in all three is worked on once.
    channels: Vec<Channel>,
    nugget: f64,
    /// Mean variance of a datum's noise over that of one sample.
    shares: f64,
    /// See [`Settings::hidden`].
    hidden: f64,
}

/// One channel of a system.
struct Channel {
    /// `K⁻¹ (y − μ)`.
    weights: Vec<f64>,
    mean: f64,
    /// Variance of the process, by maximum likelihood.
    signal: f64,
    limits: (f64, f64),
}

impl Channel {
    /// What is kriged, from the sum of covariances by their weights.
    fn within(&self, sum: f64) -> f64 {
        (self.mean + sum).clamp(self.limits.0, self.limits.1)
    }
}

/// Memory for the covariances of a place.
pub(super) type Work = Vec<f64>;

/// A value and what is known of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Predicted {
    /// Value per channel, positive.
    pub value: [f64; 3],
    /// Standard error over the value, per channel, not calibrated.
    pub relative: [f64; 3],
    /// Variance of one sample over the value's square, per channel.
    pub noise: [f64; 3],
}

impl Predicted {
    /// Of no data.
    pub const NOTHING: Self = Self {
        value: [1e-30; 3],
        relative: [f64::INFINITY; 3],
        noise: [0.0; 3],
    };

    /// Whether it was predicted at all: values are positive.
    pub fn is_known(&self) -> bool {
        self.value[0] > 0.0
    }
}

/// A value may lie beyond those around by this share of their range …
const BEYOND_SHARE: f64 = 0.5;
/// … and by this in any case, but never by more than that, in natural logarithms.
const BEYOND: (f64, f64) = (0.1, 1.0);
/// Of noise about zero, a value is this share of its standard error at least.
const ABOVE_ZERO: f64 = 0.1;
/// Of more noise than this (its relative variance), half of it is not what logarithms lie lower by.
const NOISE_MAX: f64 = 0.25;

/// Which of the data near a place are images of one.
fn same_datum(near: &[Near]) -> Vec<(usize, usize)> {
    let later = |(i, a): (usize, &Near)| {
        let datum = a.datum;
        let same = near.iter().enumerate().skip(i + 1);
        same.filter(move |(_, b)| b.datum == datum)
            .map(move |(j, _)| (i, j))
    };
    near.iter().enumerate().flat_map(later).collect()
}

impl Local {
    /// `None` of no data. The range is in radii of the usual number of data, however many there are.
    pub fn fit(data: &[Datum], near: &[Near], settings: &Settings) -> Option<Self> {
        let here: Vec<&Datum> = near.iter().map(|n| &data[n.datum as usize]).collect();
        Self::fit_to(&here, near, settings)
    }

    /// The same of data that stand beside their places.
    pub fn fit_to(here: &[&Datum], near: &[Near], settings: &Settings) -> Option<Self> {
        let usual = near.get(settings.neighbours - 1).or(near.last())?;
        let response = Response::of(here);
        let arch = Arch::new();
        let covariance = Covariance {
            kernel: settings.kernel,
            scale: settings.kernel.scale() / (settings.range * usual.distance()),
        };
        let at = Axes::of(near.iter().map(|n| n.pair));
        let noise = Noise {
            variances: here.iter().map(|d| 1.0 / d.count).collect(),
            // Where noise is little, images that agree show how little.
            same: match response {
                Response::Linear => same_datum(near),
                Response::Logarithm => Vec::new(),
            },
        };
        let values = |c: usize| -> Vec<f64> {
            let value = |d: &&Datum| match response {
                Response::Logarithm => d.log[c],
                Response::Linear => d.value[c],
            };
            here.iter().map(value).collect()
        };
        let all = [0, 1, 2].map(values);
        let mut nugget = settings.nugget;
        let of_green = (&all[1][..], &noise);
        if response == Response::Linear {
            nugget += largest_nugget(arch, near, of_green, covariance, settings);
        } else if settings.noise_variance > 0.0 {
            nugget += likely_nugget(arch, near, of_green, covariance, settings);
        }
        let correlations = Correlations::new(arch, &at, covariance);
        let factor = loop {
            match correlations.factor(arch, nugget, &noise) {
                Some(factor) => break factor,
                // Larger than this, the matrix is diagonally dominant.
                None if nugget > 1e6 => return None,
                None => nugget = 10.0 * nugget.max(1e-12),
            }
        };
        let mut local = Self {
            arch,
            response,
            at,
            covariance,
            factor,
            ones: vec![1.0; near.len()],
            ones2: 0.0,
            channels: Vec::new(),
            nugget,
            shares: noise.variances.iter().sum::<f64>() / near.len() as f64,
            hidden: settings.hidden,
        };
        if all[0] == all[1] && all[1] == all[2] {
            let [first, ..] = all;
            local.solve([first]);
        } else {
            local.solve(all);
        }
        Some(local)
    }

    /// Solves for channels of so many values.
    fn solve<const N: usize>(&mut self, all: [Vec<f64>; N]) {
        let (arch, factor) = (self.arch, &self.factor);
        factor.forward(arch, [&mut self.ones[..]]);
        self.ones2 = dot(arch, &self.ones, &self.ones);
        let mut solved = all.clone();
        factor.forward(arch, solved.each_mut().map(|y| &mut y[..]));
        let (mut means, mut squares) = ([0.0; N], [0.0; N]);
        for c in 0..N {
            means[c] = dot(arch, &solved[c], &self.ones) / self.ones2;
            for (y, one) in solved[c].iter_mut().zip(&self.ones) {
                *y -= means[c] * one;
            }
            squares[c] = dot(arch, &solved[c], &solved[c]);
        }
        factor.backward(arch, solved.each_mut());
        let channels = solved.into_iter().zip(&all).enumerate();
        self.channels = channels
            .map(|(c, (weights, values))| Channel {
                weights,
                mean: means[c],
                signal: squares[c] / (values.len().max(2) - 1) as f64,
                limits: self.limits(values),
            })
            .collect();
    }

    /// What a value near these lies between.
    fn limits(&self, values: &[f64]) -> (f64, f64) {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let beyond = match self.response {
            Response::Logarithm => (BEYOND_SHARE * (high - low)).clamp(BEYOND.0, BEYOND.1),
            Response::Linear => 0.0,
        };
        (low - beyond, high + beyond)
    }

    /// Logarithm of how likely the data are, the variance of the process being what makes them most likely; mean over
    /// the channels.
    pub fn log_likelihood(&self) -> f64 {
        let n = self.at.len() as f64 - 1.0;
        let signal = |c: &Channel| c.signal.max(1e-30).natural_log();
        let signals: f64 = self.channels.iter().map(signal).sum();
        let signals = signals / self.channels.len() as f64;
        -0.5 * (n * signals + self.factor.log_determinant() + self.ones2.natural_log())
    }

    /// The value at a place near the data, aligned as they are.
    pub fn at(&self, place: &Pair) -> Predicted {
        self.at_with(place, true, &mut Vec::new())
    }

    /// Logarithms of the values there alone, channel by channel: of data of one channel the first.
    pub fn logs_at(&self, place: &Pair, work: &mut Work) -> [f64; 3] {
        if self.response == Response::Linear {
            return self.at_with(place, false, work).value.map(f64::natural_log);
        }
        covariances(self.arch, &self.at, self.covariance, place, work);
        let mut logs = [0.0; 3];
        for (log, channel) in logs.iter_mut().zip(&self.channels) {
            *log = self.fitted(channel, work) + self.below(channel);
        }
        logs
    }

    /// [`Self::logs_at`] in single precision for places within a distance from a middle; `None` where they may be off by
    /// more than this.
    pub fn narrow(&self, around: (Pair, f64), off: f64) -> Option<Narrow> {
        if self.response == Response::Linear {
            return None;
        }
        let places = (0..self.at.len()).map(|k| self.at.place(k));
        let weights = self.channels.iter().map(|c| &c.weights[..]);
        Narrow::new(self.arch, self.covariance, places, weights, around, off)
    }

    /// [`Self::logs_at`] of the sums of covariances by their weights.
    pub fn logs_of(&self, sums: [f64; 3]) -> [f64; 3] {
        let mut logs = sums;
        for (log, channel) in logs.iter_mut().zip(&self.channels) {
            *log = channel.within(*log) + self.below(channel);
        }
        logs
    }

    /// What is kriged, at the place with these covariances.
    fn fitted(&self, channel: &Channel, covariances: &[f64]) -> f64 {
        channel.within(dot(self.arch, covariances, &channel.weights))
    }

    /// Noise that is as much above as below lies lower in logarithms, by half its variance.
    fn below(&self, channel: &Channel) -> f64 {
        0.5 * (self.nugget * channel.signal * self.shares).min(NOISE_MAX)
    }

    /// The same; without its error, which takes most of the time, that is 0.
    pub fn at_with(&self, place: &Pair, with_error: bool, work: &mut Work) -> Predicted {
        covariances(self.arch, &self.at, self.covariance, place, work);
        let fitted = self.channels.iter().map(|c| self.fitted(c, work));
        let mut predicted = Predicted {
            value: [0.0; 3],
            relative: [0.0; 3],
            noise: [0.0; 3],
        };
        for (value, fitted) in predicted.value.iter_mut().zip(fitted) {
            *value = fitted;
        }
        // The least value of noise about zero is a share of its error.
        let unit = if with_error || self.response == Response::Linear {
            self.unit_variance(work)
        } else {
            0.0
        };
        for (c, channel) in self.channels.iter().enumerate() {
            let fitted = predicted.value[c];
            let error = (unit * channel.signal).sqrt();
            match self.response {
                Response::Logarithm => {
                    let noise = self.nugget * channel.signal;
                    predicted.noise[c] = (1.0 - self.hidden) * noise;
                    predicted.value[c] = (fitted + self.below(channel)).exponential();
                    predicted.relative[c] = (error * error + self.hidden * noise).sqrt();
                }
                Response::Linear => {
                    let value = fitted.max(ABOVE_ZERO * error).max(1e-30);
                    predicted.value[c] = value;
                    predicted.relative[c] = error / value;
                    predicted.noise[c] = self.nugget * channel.signal / (value * value);
                }
            }
        }
        if self.channels.len() == 1 {
            predicted.value = [predicted.value[0]; 3];
            predicted.relative = [predicted.relative[0]; 3];
            predicted.noise = [predicted.noise[0]; 3];
        }
        predicted
    }

    /// Kriging variance over that of the process, of the covariances `k` of a place with the data, which are
    /// spoilt.
    fn unit_variance(&self, k: &mut [f64]) -> f64 {
        self.factor.forward(self.arch, [&mut *k]);
        let squares = dot(self.arch, k, k);
        let along = dot(self.arch, k, &self.ones);
        (1.0 - squares + (1.0 - along).powi(2) / self.ones2).max(1e-12)
    }
}
