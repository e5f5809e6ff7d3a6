//! A kriging system through the data around a place, in double precision.

use super::data::Datum;
use super::places::{Near, distance2, radius_of};
use super::{Response, ScatteredKernel, Settings};
use crate::elementary::Elementary;
use crate::interpolate::coordinates::Pair;

/// Ordinary kriging (constant unknown mean) of three channels with one factorisation.
pub(super) struct Local {
    response: Response,
    places: Vec<Pair>,
    /// Rows of the lower factor of `K + nugget`.
    factor: Vec<f64>,
    /// `L⁻¹ 1` and the square of its length.
    ones: Vec<f64>,
    ones2: f64,
    /// `K⁻¹ (y − μ)`, channel by channel.
    weights: [Vec<f64>; 3],
    mean: [f64; 3],
    /// Variance of the process, channel by channel, by maximum likelihood.
    signal: [f64; 3],
    limits: [(f64, f64); 3],
    kernel: ScatteredKernel,
    scale: f64,
    nugget: f64,
}

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

impl Local {
    /// `None` of no data.
    pub fn fit(data: &[Datum], near: &[Near], settings: &Settings) -> Option<Self> {
        if near.is_empty() {
            return None;
        }
        let here: Vec<&Datum> = near.iter().map(|n| &data[n.datum as usize]).collect();
        let response = Response::of(&here);
        let values = |c: usize| -> Vec<f64> {
            here.iter()
                .map(|d| match response {
                    Response::Logarithm => d.log[c],
                    Response::Linear => d.value[c],
                })
                .collect()
        };
        let scale = settings.kernel.scale() / (settings.range * radius_of(near));
        let places: Vec<Pair> = near.iter().map(|n| n.pair).collect();
        let noise: Vec<f64> = here.iter().map(|d| 1.0 / d.count).collect();
        let mut nugget = settings.nugget;
        let factor = loop {
            match factored(&places, &noise, settings.kernel, scale, nugget) {
                Some(factor) => break factor,
                // Larger than this, the matrix is diagonally dominant.
                None if nugget > 1e6 => return None,
                None => nugget = 10.0 * nugget.max(1e-12),
            }
        };
        let n = places.len();
        let mut ones = vec![1.0; n];
        forward(&factor, &mut ones);
        let ones2: f64 = ones.iter().map(|x| x * x).sum();
        let mut local = Self {
            response,
            places,
            factor,
            ones,
            ones2,
            weights: [const { Vec::new() }; 3],
            mean: [0.0; 3],
            signal: [0.0; 3],
            limits: [(0.0, 0.0); 3],
            kernel: settings.kernel,
            scale,
            nugget,
        };
        for c in 0..3 {
            let own = values(c);
            // Of one channel, which stands in all three, the work is done once.
            if c > 0 && own == values(c - 1) {
                local.copy(c - 1, c);
            } else {
                local.load(c, &own);
            }
        }
        Some(local)
    }

    fn copy(&mut self, from: usize, to: usize) {
        self.weights[to] = self.weights[from].clone();
        self.mean[to] = self.mean[from];
        self.signal[to] = self.signal[from];
        self.limits[to] = self.limits[from];
    }

    fn load(&mut self, c: usize, values: &[f64]) {
        let n = values.len();
        let mut y = values.to_vec();
        forward(&self.factor, &mut y);
        let along: f64 = y.iter().zip(&self.ones).map(|(a, b)| a * b).sum();
        let mean = along / self.ones2;
        for (y, one) in y.iter_mut().zip(&self.ones) {
            *y -= mean * one;
        }
        let squares: f64 = y.iter().map(|x| x * x).sum();
        self.signal[c] = squares / (n.max(2) - 1) as f64;
        backward(&self.factor, &mut y);
        self.mean[c] = mean;
        self.weights[c] = y;
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let beyond = match self.response {
            Response::Logarithm => (BEYOND_SHARE * (high - low)).clamp(BEYOND.0, BEYOND.1),
            Response::Linear => 0.0,
        };
        self.limits[c] = (low - beyond, high + beyond);
    }

    /// The value at a place near the data, aligned as they are.
    pub fn at(&self, place: &Pair) -> Predicted {
        self.at_with(place, true)
    }

    /// The same; without its error, which takes most of the time, that is 0.
    pub fn at_with(&self, place: &Pair, with_error: bool) -> Predicted {
        let mut k: Vec<f64> = self
            .places
            .iter()
            .map(|p| self.kernel.at(self.scale * distance2(p, place).sqrt()))
            .collect();
        let fitted = [0, 1, 2].map(|c| {
            let sum: f64 = k.iter().zip(&self.weights[c]).map(|(a, b)| a * b).sum();
            (self.mean[c] + sum).clamp(self.limits[c].0, self.limits[c].1)
        });
        // The least value of noise about zero is a share of its error.
        let unit = if with_error || self.response == Response::Linear {
            self.unit_variance(&mut k)
        } else {
            0.0
        };
        let mut predicted = Predicted {
            value: fitted,
            relative: [0.0; 3],
            noise: [0.0; 3],
        };
        for c in 0..3 {
            let error = (unit * self.signal[c]).sqrt();
            match self.response {
                Response::Logarithm => {
                    // Noise that is as much above as below lies lower in logarithms, by half its variance.
                    let noise = self.nugget * self.signal[c];
                    predicted.noise[c] = noise;
                    predicted.value[c] = (fitted[c] + 0.5 * noise.min(NOISE_MAX)).exponential();
                    predicted.relative[c] = error;
                }
                Response::Linear => {
                    let value = fitted[c].max(ABOVE_ZERO * error).max(1e-30);
                    predicted.value[c] = value;
                    predicted.relative[c] = error / value;
                    predicted.noise[c] = self.nugget * self.signal[c] / (value * value);
                }
            }
        }
        predicted
    }
}

impl Local {
    /// Kriging variance over that of the process, of the covariances `k` of a place with the data, which are
    /// spoilt.
    fn unit_variance(&self, k: &mut [f64]) -> f64 {
        forward(&self.factor, k);
        let squares: f64 = k.iter().map(|x| x * x).sum();
        let along: f64 = k.iter().zip(&self.ones).map(|(a, b)| a * b).sum();
        (1.0 - squares + (1.0 - along).powi(2) / self.ones2).max(1e-12)
    }
}

/// The rows of L, one after the other, each as long as its number and one.
fn factored(
    places: &[Pair],
    noise: &[f64],
    kernel: ScatteredKernel,
    scale: f64,
    nugget: f64,
) -> Option<Vec<f64>> {
    let n = places.len();
    let mut l: Vec<f64> = Vec::with_capacity(n * (n + 1) / 2);
    for i in 0..n {
        let start = l.len();
        for j in 0..i {
            let own = kernel.at(scale * distance2(&places[i], &places[j]).sqrt());
            let row_j = &l[j * (j + 1) / 2..];
            let row_i = &l[start..start + j];
            let x = (own - dot(row_i, &row_j[..j])) / row_j[j];
            l.push(x);
        }
        let row = &l[start..];
        let pivot = 1.0 + nugget * noise[i] - dot(row, row);
        if pivot.is_nan() || pivot <= 1e-12 {
            return None;
        }
        l.push(pivot.sqrt());
    }
    Some(l)
}

/// In four sums, so that the processor need not wait for each: the same four everywhere.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    sums[0] + sums[1] + (sums[2] + sums[3]) + rest
}

fn forward(l: &[f64], x: &mut [f64]) {
    let mut start = 0;
    for i in 0..x.len() {
        let row = &l[start..=start + i];
        x[i] = (x[i] - dot(&row[..i], &x[..i])) / row[i];
        start += i + 1;
    }
}

fn backward(l: &[f64], x: &mut [f64]) {
    for i in (0..x.len()).rev() {
        let start = i * (i + 1) / 2;
        let row = &l[start..=start + i];
        x[i] /= row[i];
        let at = x[i];
        for (below, l) in x[..i].iter_mut().zip(row) {
            *below -= l * at;
        }
    }
}
