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

/// Ordinary kriging (constant unknown mean) of `N` channels with one factorisation: with two where some are noise about
/// zero and others are not.
pub(super) struct Local<const N: usize = 3> {
    arch: Arch,
    at: Axes,
    covariance: Covariance,
    /// One for all channels that respond alike.
    systems: Vec<System>,
    /// Those of one channel, or of all: what stands in all is worked on once.
    channels: Vec<Channel>,
    /// See [`Settings::hidden`].
    hidden: f64,
}

/// What some channels have in common.
struct System {
    response: Response,
    factor: Factor,
    /// `L⁻¹ 1` and the square of its length.
    ones: Vec<f64>,
    ones2: f64,
    nugget: f64,
    /// Mean variance of a datum's noise over that of one sample.
    shares: f64,
}

/// One channel.
struct Channel {
    /// Number of its system.
    system: usize,
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
pub(super) struct Predicted<const N: usize = 3> {
    /// Value per channel, positive.
    pub value: [f64; N],
    /// Standard error over the value, per channel, not calibrated.
    pub relative: [f64; N],
    /// Variance of one sample over the value's square, per channel.
    pub noise: [f64; N],
}

impl<const N: usize> Predicted<N> {
    /// Of no data.
    pub const NOTHING: Self = Self {
        value: [1e-30; N],
        relative: [f64::INFINITY; N],
        noise: [0.0; N],
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

/// The places of a neighbourhood, and how their values are kriged.
struct Surroundings<'a> {
    arch: Arch,
    near: &'a [Near],
    at: &'a Axes,
    covariance: Covariance,
    settings: &'a Settings,
}

impl Surroundings<'_> {
    /// The system of channels that respond alike, and what is solved with it: their weights.
    fn solved(
        &self,
        response: Response,
        variances: Vec<f64>,
        values: &[&[f64]],
    ) -> Option<(System, Vec<Channel>)> {
        let &Self { arch, near, .. } = self;
        let noise = Noise {
            variances,
            // Where noise is little, images that agree show how little.
            same: match response {
                Response::Linear => same_datum(near),
                Response::Logarithm => Vec::new(),
            },
        };
        let of_middle = (values[values.len() / 2], &noise);
        let (covariance, settings) = (self.covariance, self.settings);
        let mut nugget = settings.nugget;
        if response == Response::Linear {
            nugget += largest_nugget(arch, near, of_middle, covariance, settings);
        } else if settings.noise_variance > 0.0 {
            nugget += likely_nugget(arch, near, of_middle, covariance, settings);
        }
        let factor = loop {
            let correlations = Correlations::new(arch, self.at, covariance);
            match correlations.into_factor(arch, nugget, &noise) {
                Some(factor) => break factor,
                // Larger than this, the matrix is diagonally dominant.
                None if nugget > 1e6 => return None,
                None => nugget = 10.0 * nugget.max(1e-12),
            }
        };
        let mut solved: Vec<Vec<f64>> = values.iter().map(|y| y.to_vec()).collect();
        let mut ones = vec![1.0; near.len()];
        let mut sides: Vec<&mut [f64]> = solved.iter_mut().map(|y| &mut y[..]).collect();
        sides.push(&mut ones);
        factor.forward(arch, &mut sides);
        let ones2 = dot(arch, &ones, &ones);
        let mut found = Vec::with_capacity(values.len());
        for y in &mut solved {
            let mean = dot(arch, y, &ones) / ones2;
            for (y, one) in y.iter_mut().zip(&ones) {
                *y -= mean * one;
            }
            let signal = dot(arch, y, y) / (near.len().max(2) - 1) as f64;
            found.push((mean, signal));
        }
        factor.backward(arch, &mut solved);
        let channels = solved.into_iter().zip(values).zip(found);
        let channels = channels.map(|((weights, values), (mean, signal))| Channel {
            system: 0,
            weights,
            mean,
            signal,
            limits: limits(response, values),
        });
        let channels = channels.collect();
        let system = System {
            response,
            factor,
            ones,
            ones2,
            nugget,
            shares: noise.variances.iter().sum::<f64>() / near.len() as f64,
        };
        Some((system, channels))
    }
}

/// What a value near these lies between.
fn limits(response: Response, values: &[f64]) -> (f64, f64) {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let beyond = match response {
        Response::Logarithm => (BEYOND_SHARE * (high - low)).clamp(BEYOND.0, BEYOND.1),
        Response::Linear => 0.0,
    };
    (low - beyond, high + beyond)
}

impl<const N: usize> Local<N> {
    /// `None` of no data. The range is in radii of the usual number of data, however many there are.
    pub fn fit(data: &[Datum<N>], near: &[Near], settings: &Settings) -> Option<Self> {
        let here: Vec<&Datum<N>> = near.iter().map(|n| &data[n.datum as usize]).collect();
        Self::fit_to(&here, near, settings)
    }

    /// The same of data that stand beside their places.
    pub fn fit_to(here: &[&Datum<N>], near: &[Near], settings: &Settings) -> Option<Self> {
        let usual = near.get(settings.neighbours - 1).or(near.last())?;
        let arch = Arch::new();
        let covariance = Covariance {
            kernel: settings.kernel,
            scale: settings.kernel.scale() / (settings.range * usual.distance()),
        };
        let at = Axes::of(near.iter().map(|n| n.pair));
        let responses = Response::of(here);
        let values = |c: usize| -> Vec<f64> {
            let value = |d: &&Datum<N>| match responses[c] {
                Response::Logarithm => d.log[c],
                Response::Linear => d.value[c],
            };
            here.iter().map(value).collect()
        };
        let mut all: Vec<Vec<f64>> = (0..N).map(values).collect();
        if all.iter().all(|values| *values == all[0]) {
            all.truncate(1);
        }
        let around = Surroundings {
            arch,
            near,
            at: &at,
            covariance,
            settings,
        };
        let mut systems = Vec::new();
        let mut channels: Vec<Option<Channel>> = all.iter().map(|_| None).collect();
        for response in [Response::Logarithm, Response::Linear] {
            let alike: Vec<usize> = (0..all.len())
                .filter(|c| responses[*c] == response)
                .collect();
            if alike.is_empty() {
                continue;
            }
            let values: Vec<&[f64]> = alike.iter().map(|c| &all[*c][..]).collect();
            let variances = here.iter().map(|d| 1.0 / d.count).collect();
            let (system, solved) = around.solved(response, variances, &values)?;
            for (c, channel) in alike.into_iter().zip(solved) {
                channels[c] = Some(Channel {
                    system: systems.len(),
                    ..channel
                });
            }
            systems.push(system);
        }
        Some(Self {
            arch,
            at,
            covariance,
            systems,
            channels: channels.into_iter().flatten().collect(),
            hidden: settings.hidden,
        })
    }

    /// Logarithm of how likely the data are, the variance of the process being what makes them most likely; mean over
    /// the channels.
    pub fn log_likelihood(&self) -> f64 {
        let n = self.at.len() as f64 - 1.0;
        let count = self.channels.len() as f64;
        let signal = |c: &Channel| c.signal.max(1e-30).natural_log();
        let signals = self.channels.iter().map(signal).sum::<f64>() / count;
        let determinant = |c: &Channel| {
            let system = &self.systems[c.system];
            system.factor.log_determinant() + system.ones2.natural_log()
        };
        let determinants = match self.systems.len() {
            1 => determinant(&self.channels[0]),
            _ => self.channels.iter().map(determinant).sum::<f64>() / count,
        };
        -0.5 * (n * signals + determinants)
    }

    /// Whether logarithms are kriged of all channels.
    fn is_of_logarithms(&self) -> bool {
        let is = |system: &System| system.response == Response::Logarithm;
        self.systems.iter().all(is)
    }

    /// The value at a place near the data, aligned as they are.
    pub fn at(&self, place: &Pair) -> Predicted<N> {
        self.at_with(place, true, &mut Vec::new())
    }

    /// Logarithms of the values there alone, channel by channel: of data of one channel the first.
    pub fn logs_at(&self, place: &Pair, work: &mut Work) -> [f64; N] {
        if !self.is_of_logarithms() {
            return self.at_with(place, false, work).value.map(f64::natural_log);
        }
        covariances(self.arch, &self.at, self.covariance, place, work);
        let mut logs = [0.0; N];
        for (log, channel) in logs.iter_mut().zip(&self.channels) {
            *log = self.fitted(channel, work) + self.below(channel);
        }
        logs
    }

    /// [`Self::logs_at`] in single precision for places within a distance from a middle; `None` where they may be off by
    /// more than this.
    pub fn narrow(&self, around: (Pair, f64), off: f64) -> Option<Narrow<N>> {
        if !self.is_of_logarithms() {
            return None;
        }
        let places = (0..self.at.len()).map(|k| self.at.place(k));
        let weights = self.channels.iter().map(|c| &c.weights[..]);
        Narrow::new(self.arch, self.covariance, places, weights, around, off)
    }

    /// [`Self::logs_at`] of the sums of covariances by their weights.
    pub fn logs_of(&self, sums: [f64; N]) -> [f64; N] {
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
        let System { nugget, shares, .. } = self.systems[channel.system];
        0.5 * (nugget * channel.signal * shares).min(NOISE_MAX)
    }

    /// The same; without its error, which takes most of the time, that is 0.
    pub fn at_with(&self, place: &Pair, with_error: bool, work: &mut Work) -> Predicted<N> {
        covariances(self.arch, &self.at, self.covariance, place, work);
        let fitted = self.channels.iter().map(|c| self.fitted(c, work));
        let mut predicted = Predicted {
            value: [0.0; N],
            relative: [0.0; N],
            noise: [0.0; N],
        };
        for (value, fitted) in predicted.value.iter_mut().zip(fitted) {
            *value = fitted;
        }
        let mut units = [0.0; 2];
        for (unit, system) in units.iter_mut().zip(&self.systems) {
            // The least value of noise about zero is a share of its error.
            if with_error || system.response == Response::Linear {
                *unit = match self.systems.len() {
                    1 => self.unit_variance(system, work),
                    _ => self.unit_variance(system, &mut work.clone()),
                };
            }
        }
        for (c, channel) in self.channels.iter().enumerate() {
            let System {
                response, nugget, ..
            } = self.systems[channel.system];
            let fitted = predicted.value[c];
            let error = (units[channel.system] * channel.signal).sqrt();
            match response {
                Response::Logarithm => {
                    let noise = nugget * channel.signal;
                    predicted.noise[c] = (1.0 - self.hidden) * noise;
                    predicted.value[c] = (fitted + self.below(channel)).exponential();
                    predicted.relative[c] = (error * error + self.hidden * noise).sqrt();
                }
                Response::Linear => {
                    let value = fitted.max(ABOVE_ZERO * error).max(1e-30);
                    predicted.value[c] = value;
                    predicted.relative[c] = error / value;
                    predicted.noise[c] = nugget * channel.signal / (value * value);
                }
            }
        }
        if self.channels.len() == 1 {
            predicted.value = [predicted.value[0]; N];
            predicted.relative = [predicted.relative[0]; N];
            predicted.noise = [predicted.noise[0]; N];
        }
        predicted
    }

    /// Kriging variance over that of the process, of the covariances `k` of a place with the data, which are
    /// spoilt.
    fn unit_variance(&self, system: &System, k: &mut [f64]) -> f64 {
        system.factor.forward(self.arch, &mut [&mut *k]);
        let squares = dot(self.arch, k, k);
        let along = dot(self.arch, k, &system.ones);
        (1.0 - squares + (1.0 - along).powi(2) / system.ones2).max(1e-12)
    }
}
