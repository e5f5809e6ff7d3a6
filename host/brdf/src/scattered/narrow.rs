//! The values of a system in single precision, where that is near enough: many places of cells that share it.

use super::ScatteredKernel;
use super::wide::Covariance;
use crate::interpolate::coordinates::Pair;
use pulp::{Arch, Simd, WithSimd};

/// Data that are worked on at a time. Sums run in so many parts, which are added in one order: whatever the width of a
/// processor's registers, the numbers are the same.
const WIDTH: usize = 16;
/// A system has at most so many times as many data.
const SIDES: usize = 11;
/// The polynomials hold up to this distance, in units of the kernel's range: data are rarely farther.
const S_MAX: f64 = 0.75;
/// What a covariance falls by is off by less than this: a few roundings of what is far below 1.
const OFF: f64 = 6e-8;

/// Data side by side: places in units of the kernel's range from a middle, and their weights, channel by channel.
struct Side<const N: usize> {
    at: [[f32; WIDTH]; 6],
    weights: [[f32; WIDTH]; N],
}

/// Places and weights of a system.
///
/// Weights are of either sign, and their sum is nearly zero: so what counts is by how much covariances fall from 1, which
/// single precision knows better than the covariances themselves.
pub(super) struct Narrow<const N: usize = 3> {
    arch: Arch,
    scale: f64,
    polynomial: &'static [f32; 10],
    middle: Pair,
    sides: Vec<Side<N>>,
    /// Sums of the weights.
    totals: [f64; N],
    /// Channels that have weights.
    channels: usize,
}

impl<const N: usize> Narrow<N> {
    /// Of data at places, with weights channel by channel, for places within a distance from a middle; `None` where sums
    /// are not as near as is wanted.
    pub fn new<'a>(
        arch: Arch,
        covariance: Covariance,
        places: impl Iterator<Item = Pair> + Clone,
        weights: impl Iterator<Item = &'a [f64]> + Clone,
        (middle, within): (Pair, f64),
        wanted: f64,
    ) -> Option<Self> {
        // Roundings are as often up as down.
        let off = |weights: &[f64]| OFF * weights.iter().map(|w| w * w).sum::<f64>().sqrt();
        if !weights.clone().all(|weights| off(weights) <= wanted) {
            return None;
        }
        let (scale, many) = (covariance.scale, places.clone().count());
        if many > SIDES * WIDTH {
            return None;
        }
        let empty = || Side {
            at: [[0.0; WIDTH]; 6],
            weights: [[0.0; WIDTH]; N],
        };
        let mut sides: Vec<Side<N>> = (0..many.div_ceil(WIDTH)).map(|_| empty()).collect();
        for (k, place) in places.enumerate() {
            let off = [0, 1, 2, 3, 4, 5].map(|axis| place[axis] - middle[axis]);
            let far = off.iter().map(|x| x * x).sum::<f64>().sqrt() + within;
            if scale * far > S_MAX {
                return None;
            }
            let side = &mut sides[k / WIDTH];
            for axis in 0..6 {
                side.at[axis][k % WIDTH] = (scale * off[axis]) as f32;
            }
            for (to, weights) in side.weights.iter_mut().zip(weights.clone()) {
                to[k % WIDTH] = weights[k] as f32;
            }
        }
        let mut totals = [0.0; N];
        let channels = weights.clone().count();
        for (total, weights) in totals.iter_mut().zip(weights) {
            *total = weights.iter().sum();
        }
        Some(Self {
            arch,
            scale,
            polynomial: match covariance.kernel {
                ScatteredKernel::Exponential => &EXPONENTIAL,
                ScatteredKernel::Matern32 => &MATERN,
            },
            middle,
            sides,
            totals,
            channels,
        })
    }

    /// Sums of the covariances of a place with the data, by their weights: channel by channel.
    pub fn sums(&self, place: &Pair) -> [f64; N] {
        let off = |axis: usize| self.scale * (place[axis] - self.middle[axis]);
        let at = [0, 1, 2, 3, 4, 5].map(|axis| off(axis) as f32);
        let fallen = self.arch.dispatch(Summed { narrow: self, at });
        std::array::from_fn(|c| self.totals[c] + f64::from(fallen[c]))
    }
}

/// By how much covariances fall from 1 over the distance `s` in units of the range, lowest power of `s` first: e⁻ˢ …
const EXPONENTIAL: [f32; 10] = [
    -1.0,
    1.0 / 2.0,
    -1.0 / 6.0,
    1.0 / 24.0,
    -1.0 / 120.0,
    1.0 / 720.0,
    -1.0 / 5040.0,
    1.0 / 40_320.0,
    -1.0 / 362_880.0,
    1.0 / 3_628_800.0,
];
/// … and (1 + s) e⁻ˢ.
const MATERN: [f32; 10] = [
    0.0,
    -1.0 / 2.0,
    2.0 / 6.0,
    -3.0 / 24.0,
    4.0 / 120.0,
    -5.0 / 720.0,
    6.0 / 5040.0,
    -7.0 / 40_320.0,
    8.0 / 362_880.0,
    -9.0 / 3_628_800.0,
];

struct Summed<'a, const N: usize> {
    narrow: &'a Narrow<N>,
    at: [f32; 6],
}

impl<const N: usize> WithSimd for Summed<'_, N> {
    type Output = [f32; N];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f32; N] {
        let Self { narrow, at } = self;
        let c = narrow.polynomial.map(|c| simd.splat_f32s(c));
        let at = at.map(|x| simd.splat_f32s(x));
        let mut sums = [[0f32; WIDTH]; N];
        for group in 0..WIDTH / S::F32_LANES {
            let mut all = [simd.splat_f32s(0.0); SIDES];
            for (side, all) in narrow.sides.iter().zip(&mut all) {
                let off = |axis: usize| {
                    let off = simd.sub_f32s(S::as_simd_f32s(&side.at[axis]).0[group], at[axis]);
                    simd.mul_f32s(off, off)
                };
                let planar = simd.add_f32s(off(0), off(1));
                let upright = simd.add_f32s(off(2), off(3));
                let others = simd.add_f32s(off(4), off(5));
                let s2 = simd.add_f32s(simd.add_f32s(planar, upright), others);
                let s = simd.sqrt_f32s(s2);
                // Estrin's scheme: few products wait for each other.
                let two = |k: usize| simd.add_f32s(c[k], simd.mul_f32s(c[k + 1], s));
                let s4 = simd.mul_f32s(s2, s2);
                let low = simd.add_f32s(two(0), simd.mul_f32s(two(2), s2));
                let high = simd.add_f32s(two(4), simd.mul_f32s(two(6), s2));
                let high = simd.add_f32s(high, simd.mul_f32s(two(8), s4));
                *all = simd.mul_f32s(s, simd.add_f32s(low, simd.mul_f32s(high, s4)));
            }
            for (c, sums) in sums.iter_mut().enumerate().take(narrow.channels) {
                let mut part = simd.splat_f32s(0.0);
                for (side, fallen) in narrow.sides.iter().zip(&all) {
                    let weights = S::as_simd_f32s(&side.weights[c]).0[group];
                    part = simd.add_f32s(part, simd.mul_f32s(weights, *fallen));
                }
                S::as_mut_simd_f32s(sums).0[group] = part;
            }
        }
        for sums in sums.iter_mut().take(narrow.channels) {
            let mut width = WIDTH / 2;
            while width > 0 {
                for k in 0..width {
                    sums[k] += sums[k + width];
                }
                width /= 2;
            }
        }
        sums.map(|sums| sums[0])
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::elementary::Elementary;
    use crate::random::Random;

    #[test]
    fn sums_are_those_of_double_precision_within_what_is_stated_and_the_same_bits_on_any_processor()
    {
        let mut random = Random::new(2);
        for kernel in [ScatteredKernel::Exponential, ScatteredKernel::Matern32] {
            for many in [1, 16, 112, 150] {
                let mut at = || [0; 6].map(|_| random.between(-0.2, 0.2));
                let places: Vec<Pair> = (0..many).map(|_| at()).collect();
                let queries: Vec<Pair> = (0..50).map(|_| at()).collect();
                let weights: Vec<f64> = (0..many).map(|_| random.normal()).collect();
                let covariance = Covariance { kernel, scale: 0.7 };
                let narrow = |within: f64, wanted: f64| {
                    let weights = std::iter::once(&weights[..]);
                    let places = places.iter().copied();
                    let around = ([0.01; 6], within);
                    Narrow::<3>::new(Arch::new(), covariance, places, weights, around, wanted)
                };
                let length = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
                assert!(narrow(0.5, 0.9 * OFF * length).is_none());
                assert!(narrow(S_MAX / 0.7, 1.1 * OFF * length).is_none());
                let narrow = narrow(0.5, 1.1 * OFF * length).unwrap();
                let mut squares = 0.0;
                for query in &queries {
                    let [sum, ..] = narrow.sums(query);
                    let truth: f64 = places
                        .iter()
                        .zip(&weights)
                        .map(|(place, weight)| {
                            let off = (0..6).map(|k| (place[k] - query[k]).powi(2));
                            let s = 0.7 * off.sum::<f64>().sqrt();
                            let smooth = match kernel {
                                ScatteredKernel::Matern32 => 1.0 + s,
                                ScatteredKernel::Exponential => 1.0,
                            };
                            weight * smooth * (-s).exponential()
                        })
                        .sum();
                    assert!((sum - truth).abs() < 3.0 * OFF * length, "{sum} {truth}");
                    squares += (sum - truth).powi(2) / queries.len() as f64;
                    let off = |axis: usize| 0.7 * (query[axis] - narrow.middle[axis]);
                    let at = [0, 1, 2, 3, 4, 5].map(|axis| off(axis) as f32);
                    let alone = Summed {
                        narrow: &narrow,
                        at,
                    };
                    let alone = narrow.totals[0] + f64::from(alone.with_simd(pulp::Scalar)[0]);
                    assert_eq!(alone.to_bits(), sum.to_bits());
                }
                let off = squares.sqrt() / length;
                assert!(off < OFF, "{off}");
            }
        }
    }
}
