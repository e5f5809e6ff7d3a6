//! The inner loops of a kriging system, many numbers at a time.
//!
//! Sums run in [`LANES`] parts that are added in one order, and a product is rounded before it is added: whatever
//! the width of a processor's registers, the numbers are the same.

use super::ScatteredKernel;
use crate::elementary::Elementary;
use crate::interpolate::coordinates::Pair;
use pulp::{Arch, Simd, WithSimd};

/// Parts of a sum.
const LANES: usize = 16;

/// Places, axis by axis.
#[derive(Clone, Debug, Default)]
pub(super) struct Axes {
    axes: [Vec<f64>; 6],
}

impl Axes {
    pub fn of(places: impl Iterator<Item = Pair>) -> Self {
        let mut axes: [Vec<f64>; 6] = Default::default();
        for place in places {
            for (axis, x) in axes.iter_mut().zip(place) {
                axis.push(x);
            }
        }
        Self { axes }
    }

    pub fn len(&self) -> usize {
        self.axes[0].len()
    }

    fn place(&self, k: usize) -> Pair {
        [0, 1, 2, 3, 4, 5].map(|a| self.axes[a][k])
    }
}

/// Covariances over the variance of the process, by distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Covariance {
    pub kernel: ScatteredKernel,
    /// Over the distance.
    pub scale: f64,
}

/// The noise of the data of a system, over that of one sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Noise {
    /// Of each datum.
    pub variances: Vec<f64>,
    /// Images of one datum, the earlier first: they have their noise in common.
    pub same: Vec<(usize, usize)>,
}

impl Noise {
    /// Of every so manieth datum.
    pub fn step_by(&self, every: usize) -> Self {
        let kept = |k: usize| k.is_multiple_of(every).then_some(k / every);
        let same = self.same.iter();
        Self {
            variances: self.variances.iter().step_by(every).copied().collect(),
            same: same
                .filter_map(|(i, j)| Some((kept(*i)?, kept(*j)?)))
                .collect(),
        }
    }
}

/// So much of the noise of images of one datum is in common: what is left keeps a system apart from singular.
const IN_COMMON: f64 = 0.999;

/// The covariances of places with each other, over the variance of the process: the lower half of K, column by column.
pub(super) struct Correlations {
    n: usize,
    k: Vec<f64>,
}

impl Correlations {
    pub fn new(arch: Arch, at: &Axes, covariance: Covariance) -> Self {
        let n = at.len();
        let mut k = vec![0.0; n * n];
        arch.dispatch(Filled {
            k: &mut k,
            at,
            covariance,
        });
        Self { n, k }
    }

    /// The factor of `K + nugget · noise`; `None` where that is singular to this precision.
    pub fn factor(&self, arch: Arch, nugget: f64, noise: &Noise) -> Option<Factor> {
        let mut l = self.k.clone();
        for (j, variance) in noise.variances.iter().enumerate() {
            l[j * (self.n + 1)] = 1.0 + nugget * variance;
        }
        for (i, j) in &noise.same {
            l[i * self.n + j] += IN_COMMON * nugget * noise.variances[*i];
        }
        arch.dispatch(Factored(self.n, &mut l))
            .then_some(Factor { n: self.n, l })
    }
}

/// A lower factor L, column by column, each as long as the whole.
pub(super) struct Factor {
    n: usize,
    l: Vec<f64>,
}

impl Factor {
    /// That of `L Lᵀ`.
    pub fn log_determinant(&self) -> f64 {
        let pivots = (0..self.n).map(|j| self.l[j * (self.n + 1)].natural_log());
        2.0 * pivots.sum::<f64>()
    }

    /// `x = L⁻¹ x`.
    pub fn forward(&self, arch: Arch, x: &mut [f64]) {
        arch.dispatch(Forward(self, x));
    }

    /// `x = L⁻ᵀ x`.
    pub fn backward(&self, arch: Arch, x: &mut [f64]) {
        arch.dispatch(Backward(self, x));
    }
}

/// The covariances of a place with all others.
pub(super) fn covariances(
    arch: Arch,
    at: &Axes,
    covariance: Covariance,
    place: &Pair,
    k: &mut Vec<f64>,
) {
    k.resize(at.len(), 0.0);
    arch.dispatch(Covariances {
        at,
        covariance,
        place,
        k,
    });
}

/// Σ a b.
pub(super) fn dot(arch: Arch, a: &[f64], b: &[f64]) -> f64 {
    arch.dispatch(Dot(a, b))
}

/// Replaces logarithms by what they are the logarithms of, e^−700 ..= e^700.
pub(super) fn exponentials(arch: Arch, logs: &mut [f64]) {
    arch.dispatch(Exponentials(logs));
}

struct Exponentials<'a>(&'a mut [f64]);

impl WithSimd for Exponentials<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for x in self.0.iter_mut() {
            *x = exponential(*x);
        }
    }
}

struct Covariances<'a> {
    at: &'a Axes,
    covariance: Covariance,
    place: &'a Pair,
    k: &'a mut [f64],
}

impl WithSimd for Covariances<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        fill_column(self.at, 0, self.covariance, self.place, self.k);
    }
}

struct Dot<'a>(&'a [f64], &'a [f64]);

impl WithSimd for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        sum_of_products(self.0, self.1)
    }
}

struct Filled<'a> {
    k: &'a mut [f64],
    at: &'a Axes,
    covariance: Covariance,
}

impl WithSimd for Filled<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let n = self.at.len();
        for j in 0..n {
            let column = &mut self.k[j * n + j..(j + 1) * n];
            fill_column(self.at, j, self.covariance, &self.at.place(j), column);
        }
    }
}

struct Factored<'a>(usize, &'a mut [f64]);

impl WithSimd for Factored<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Self(n, l) = self;
        for j in 0..n {
            let (done, rest) = l.split_at_mut(j * n);
            let column = &mut rest[j..n];
            let mut k = 0;
            while k + 4 <= j {
                let c0 = &done[k * n + j..][..n - j];
                let c1 = &done[(k + 1) * n + j..][..n - j];
                let c2 = &done[(k + 2) * n + j..][..n - j];
                let c3 = &done[(k + 3) * n + j..][..n - j];
                let (a0, a1, a2, a3) = (c0[0], c1[0], c2[0], c3[0]);
                for i in 0..n - j {
                    column[i] -= (a0 * c0[i] + a1 * c1[i]) + (a2 * c2[i] + a3 * c3[i]);
                }
                k += 4;
            }
            while k < j {
                let c = &done[k * n + j..][..n - j];
                subtract(column, c, c[0]);
                k += 1;
            }
            let pivot = column[0];
            if pivot.is_nan() || pivot <= 1e-12 {
                return false;
            }
            let root = 1.0 / pivot.sqrt();
            for x in column.iter_mut() {
                *x *= root;
            }
        }
        true
    }
}

struct Forward<'a>(&'a Factor, &'a mut [f64]);

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self(Factor { n, l }, x) = self;
        for j in 0..*n {
            let column = &l[j * n + j..(j + 1) * n];
            let (first, rest) = x[j..].split_at_mut(1);
            first[0] /= column[0];
            subtract(rest, &column[1..], first[0]);
        }
    }
}

struct Backward<'a>(&'a Factor, &'a mut [f64]);

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self(Factor { n, l }, x) = self;
        for j in (0..*n).rev() {
            let column = &l[j * n + j..(j + 1) * n];
            let below = sum_of_products(&column[1..], &x[j + 1..]);
            x[j] = (x[j] - below) / column[0];
        }
    }
}

/// `x −= a c`.
#[inline(always)]
fn subtract(x: &mut [f64], c: &[f64], a: f64) {
    for (x, c) in x.iter_mut().zip(c) {
        *x -= a * c;
    }
}

#[inline(always)]
fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (wide_a, wide_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let (rest_a, rest_b) = (wide_a.remainder(), wide_b.remainder());
    for (a, b) in wide_a.zip(wide_b) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    let mut rest = 0.0;
    for (a, b) in rest_a.iter().zip(rest_b) {
        rest += a * b;
    }
    let mut width = LANES / 2;
    while width > 0 {
        for k in 0..width {
            sums[k] += sums[k + width];
        }
        width /= 2;
    }
    sums[0] + rest
}

/// The covariances of a place with those from number `from` on.
#[inline(always)]
fn fill_column(at: &Axes, from: usize, covariance: Covariance, place: &Pair, column: &mut [f64]) {
    let n = column.len();
    let x = &at.axes[0][from..][..n];
    let y = &at.axes[1][from..][..n];
    let z = &at.axes[2][from..][..n];
    let u = &at.axes[3][from..][..n];
    let v = &at.axes[4][from..][..n];
    let w = &at.axes[5][from..][..n];
    let scale = covariance.scale;
    // The choice stands outside of the loops, which are the same but for the factor.
    match covariance.kernel {
        ScatteredKernel::Exponential => {
            for i in 0..n {
                let place_i = [x[i], y[i], z[i], u[i], v[i], w[i]];
                column[i] = decay(scale * distance2(&place_i, place).sqrt());
            }
        }
        ScatteredKernel::Matern32 => {
            for i in 0..n {
                let place_i = [x[i], y[i], z[i], u[i], v[i], w[i]];
                let s = scale * distance2(&place_i, place).sqrt();
                column[i] = (1.0 + s) * decay(s);
            }
        }
    }
}

#[inline(always)]
fn distance2(a: &Pair, b: &Pair) -> f64 {
    let d = [
        a[0] - b[0],
        a[1] - b[1],
        a[2] - b[2],
        a[3] - b[3],
        a[4] - b[4],
        a[5] - b[5],
    ];
    (d[0] * d[0] + d[1] * d[1]) + (d[2] * d[2] + d[3] * d[3]) + (d[4] * d[4] + d[5] * d[5])
}

/// What is added to this is rounded to a whole number, which stands in the low bits.
const WHOLE: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts, the first short enough that its products with whole numbers up to 1010 are exact.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
/// 1 / k! from k = 12 down: within ±ln 2 / 2 the next term is below 2e-16.
const TAYLOR: [f64; 13] = [
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// e⁻ˢ.
#[inline(always)]
fn decay(s: f64) -> f64 {
    exponential(-s)
}

/// eˣ with no branch; beyond ±700 as there.
#[inline(always)]
fn exponential(x: f64) -> f64 {
    let x = if x < 700.0 { x } else { 700.0 };
    let x = if x > -700.0 { x } else { -700.0 };
    let shifted = x * std::f64::consts::LOG2_E + WHOLE;
    let halvings = shifted - WHOLE;
    let x = (x - halvings * LN_2[0]) - halvings * LN_2[1];
    let mut e = TAYLOR[0];
    for coefficient in &TAYLOR[1..] {
        e = e * x + coefficient;
    }
    // The whole number becomes an exponent.
    let exponent = shifted.to_bits().wrapping_sub(WHOLE.to_bits());
    e * f64::from_bits(exponent.wrapping_add(1023) << 52)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn decays_are_those_of_the_exponential() {
        for k in 0..4000 {
            let s = 0.17 * f64::from(k);
            let truth = (-s).exponential();
            assert!((decay(s) / truth - 1.0).abs() < 1e-14, "{s}");
            assert!((exponential(s) * truth - 1.0).abs() < 1e-14, "{s}");
        }
        assert!(decay(f64::INFINITY) > 0.0 && decay(1e9) < 1e-300);
    }

    fn system(n: usize) -> (Axes, Noise) {
        let mut random = Random::new(9);
        let places = (0..n).map(|_| [0; 6].map(|_| random.between(-1.0, 1.0)));
        let at = Axes::of(places.collect::<Vec<_>>().into_iter());
        let variances = (0..n).map(|k| f64::from(k as u32 % 3 + 1)).collect();
        // The first and the fourth of every seven are of one datum.
        let same = (0..n.saturating_sub(3)).step_by(7).map(|k| (k, k + 3));
        let same = same.collect();
        (at, Noise { variances, same })
    }

    #[test]
    fn a_factor_solves_its_system_to_the_same_bits_with_and_without_wide_registers() {
        for n in [1, 2, 7, 33, 96] {
            for kernel in [ScatteredKernel::Exponential, ScatteredKernel::Matern32] {
                let (at, noise) = system(n);
                let covariance = Covariance { kernel, scale: 0.4 };
                let y: Vec<f64> = (0..n).map(|k| f64::from(k as u32 * 7 % 11)).collect();
                let correlations = Correlations::new(Arch::new(), &at, covariance);
                let factor = correlations.factor(Arch::new(), 1e-3, &noise).unwrap();
                let mut x = y.clone();
                factor.forward(Arch::new(), &mut x);
                factor.backward(Arch::new(), &mut x);
                let mut k = Vec::new();
                for i in 0..n {
                    covariances(Arch::new(), &at, covariance, &at.place(i), &mut k);
                    k[i] += 1e-3 * noise.variances[i];
                    for (a, b) in &noise.same {
                        for (own, other) in [(a, b), (b, a)] {
                            if *own == i {
                                k[*other] += 1e-3 * IN_COMMON * noise.variances[i];
                            }
                        }
                    }
                    let back = dot(Arch::new(), &k, &x);
                    assert!((back - y[i]).abs() < 1e-8, "{n} {i}: {back} {}", y[i]);
                }
                let mut narrow = vec![0.0; n * n];
                let filled = Filled {
                    k: &mut narrow,
                    at: &at,
                    covariance,
                };
                filled.with_simd(pulp::Scalar);
                for (j, noise) in noise.variances.iter().enumerate() {
                    narrow[j * (n + 1)] = 1.0 + 1e-3 * noise;
                }
                for (i, j) in &noise.same {
                    narrow[i * n + j] += IN_COMMON * 1e-3 * noise.variances[*i];
                }
                assert!(Factored(n, &mut narrow).with_simd(pulp::Scalar));
                assert!(narrow == factor.l);
            }
        }
    }
}
