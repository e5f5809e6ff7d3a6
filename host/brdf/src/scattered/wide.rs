//! The inner loops of a kriging system, many numbers at a time.
//!
//! Sums run in [`LANES`] parts that are added in one order, and a product is rounded before it is added: whatever
//! the width of a processor's registers, the numbers are the same.

use super::ScatteredKernel;
use crate::elementary::Elementary;
use crate::interpolate::coordinates::Pair;
use pulp::bytemuck::cast_slice_mut;
use pulp::{Arch, Scalar, Simd, WithSimd};

/// Parts of a sum.
const LANES: usize = 16;
/// Numbers that are worked on at a time. Columns are as long as a multiple of it: a loop over the rest, one by one,
/// would take as long as all others.
const WIDTH: usize = 8;
/// Columns of a factor that are worked on at a time.
const PANEL: usize = 4;

/// The next multiple of [`WIDTH`].
fn padded(n: usize) -> usize {
    n.next_multiple_of(WIDTH)
}

/// Places, axis by axis; on each the last one again up to a multiple of [`WIDTH`].
#[derive(Clone, Debug, Default)]
pub(super) struct Axes {
    n: usize,
    all: Vec<f64>,
}

impl Axes {
    pub fn of(places: impl Iterator<Item = Pair> + Clone) -> Self {
        let n = places.clone().count();
        let rows = padded(n);
        let mut all = vec![0.0; 6 * rows];
        for (k, place) in places.enumerate() {
            for (axis, x) in place.into_iter().enumerate() {
                all[axis * rows + k] = x;
            }
        }
        for axis in all.chunks_exact_mut(rows.max(1)) {
            let last = axis[n - 1];
            axis[n..].fill(last);
        }
        Self { n, all }
    }

    pub fn len(&self) -> usize {
        self.n
    }

    #[inline(always)]
    pub fn place(&self, k: usize) -> Pair {
        let rows = padded(self.n);
        let at = |axis: usize| self.all[axis * rows + k];
        [at(0), at(1), at(2), at(3), at(4), at(5)]
    }

    /// Those of an axis from number `from` on, many at a time.
    #[inline(always)]
    fn axis(&self, axis: usize, from: usize) -> &[f64] {
        let rows = padded(self.n);
        &self.all[axis * rows + from..(axis + 1) * rows]
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

/// The covariances of places with each other, over the variance of the process: the lower half of K, column by column,
/// each from a multiple of [`WIDTH`] on to the next one beyond its end.
pub(super) struct Correlations {
    n: usize,
    k: Vec<f64>,
}

impl Correlations {
    pub fn new(arch: Arch, at: &Axes, covariance: Covariance) -> Self {
        let n = at.len();
        let mut k = vec![0.0; n * padded(n)];
        arch.dispatch(Filled {
            k: &mut k,
            at,
            covariance,
        });
        Self { n, k }
    }

    /// The factor of `K + nugget · noise`; `None` where that is singular to this precision.
    pub fn factor(&self, arch: Arch, nugget: f64, noise: &Noise) -> Option<Factor> {
        let k = self.k.clone();
        Self { n: self.n, k }.into_factor(arch, nugget, noise)
    }

    /// The same in their own memory.
    pub fn into_factor(self, arch: Arch, nugget: f64, noise: &Noise) -> Option<Factor> {
        let Self { n, k: mut l } = self;
        add_noise(n, &mut l, nugget, noise);
        arch.dispatch(Factored(n, &mut l))
            .then_some(Factor { n, l })
    }
}

fn add_noise(n: usize, k: &mut [f64], nugget: f64, noise: &Noise) {
    for (j, variance) in noise.variances.iter().enumerate() {
        k[j * padded(n) + j] = 1.0 + nugget * variance;
    }
    for (i, j) in &noise.same {
        k[i * padded(n) + j] += IN_COMMON * nugget * noise.variances[*i];
    }
}

/// A lower factor L, column by column, each as long as the whole and up to a multiple of [`WIDTH`]; zero above the
/// diagonal.
pub(super) struct Factor {
    n: usize,
    l: Vec<f64>,
}

impl Factor {
    /// That of `L Lᵀ`.
    pub fn log_determinant(&self) -> f64 {
        let pivots = (0..self.n).map(|j| self.l[j * padded(self.n) + j].natural_log());
        2.0 * pivots.sum::<f64>()
    }

    /// `x = L⁻¹ x` of each.
    pub fn forward(&self, arch: Arch, x: &mut [&mut [f64]]) {
        arch.dispatch(Forward(self, x));
    }

    /// `x = L⁻ᵀ x` of each.
    pub fn backward(&self, arch: Arch, x: &mut [Vec<f64>]) {
        for x in x.iter_mut() {
            x.resize(padded(self.n), 0.0);
        }
        arch.dispatch(Backward(self, x));
        for x in x {
            x.truncate(self.n);
        }
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
    k.resize(padded(at.len()), 0.0);
    arch.dispatch(Covariances {
        at,
        covariance,
        place,
        k,
    });
    k.truncate(at.len());
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
    fn with_simd<S: Simd>(self, simd: S) {
        let (wide, rest) = S::as_mut_simd_f64s(self.0);
        for x in wide {
            *x = exponential(simd, *x);
        }
        for x in rest {
            *x = exponential(Scalar, *x);
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
    fn with_simd<S: Simd>(self, simd: S) {
        fill_column(simd, self.at, 0, self.covariance, self.place, self.k);
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
    fn with_simd<S: Simd>(self, simd: S) {
        let n = self.at.len();
        let rows = padded(n);
        for j in 0..n {
            let from = j / WIDTH * WIDTH;
            let column = &mut self.k[j * rows + from..(j + 1) * rows];
            fill_column(
                simd,
                self.at,
                from,
                self.covariance,
                &self.at.place(j),
                column,
            );
        }
    }
}

struct Factored<'a>(usize, &'a mut [f64]);

impl WithSimd for Factored<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self(n, l) = self;
        let rows = padded(n);
        for j in (0..n).step_by(PANEL) {
            let (done, rest) = l.split_at_mut(j * rows);
            let panel = &mut rest[..PANEL.min(n - j) * rows];
            let from = j / WIDTH * WIDTH;
            for four in done.chunks_exact(PANEL * rows) {
                let c = columns(four, rows);
                let numbers = |row: usize| [c[0][row], c[1][row], c[2][row], c[3][row]];
                let c = [&c[0][from..], &c[1][from..], &c[2][from..], &c[3][from..]];
                if panel.len() == PANEL * rows {
                    let a = [numbers(j), numbers(j + 1), numbers(j + 2), numbers(j + 3)];
                    subtract_four_of_four(simd, columns_mut(panel, rows, from), c, a);
                } else {
                    for (w, column) in panel.chunks_exact_mut(rows).enumerate() {
                        subtract_four(simd, &mut column[from..], c, numbers(j + w));
                    }
                }
            }
            if !factor_panel(simd, panel, j, rows) {
                return false;
            }
        }
        true
    }
}

/// The first four columns.
#[inline(always)]
fn columns(all: &[f64], rows: usize) -> [&[f64]; PANEL] {
    let (first, rest) = all.split_at(rows);
    let (second, rest) = rest.split_at(rows);
    let (third, rest) = rest.split_at(rows);
    [first, second, third, &rest[..rows]]
}

/// The first four columns from a row on.
#[inline(always)]
fn columns_mut(all: &mut [f64], rows: usize, from: usize) -> [&mut [f64]; PANEL] {
    let (first, rest) = all.split_at_mut(rows);
    let (second, rest) = rest.split_at_mut(rows);
    let (third, rest) = rest.split_at_mut(rows);
    [
        &mut first[from..],
        &mut second[from..],
        &mut third[from..],
        &mut rest[from..rows],
    ]
}

/// `x −= a₀ c₀ + a₁ c₁ + a₂ c₂ + a₃ c₃`, of full registers.
#[inline(always)]
fn subtract_four<S: Simd>(simd: S, x: &mut [f64], c: [&[f64]; PANEL], a: [f64; PANEL]) {
    let [c0, c1, c2, c3] = c;
    let a = [
        simd.splat_f64s(a[0]),
        simd.splat_f64s(a[1]),
        simd.splat_f64s(a[2]),
        simd.splat_f64s(a[3]),
    ];
    let (c0, c1) = (S::as_simd_f64s(c0).0, S::as_simd_f64s(c1).0);
    let (c2, c3) = (S::as_simd_f64s(c2).0, S::as_simd_f64s(c3).0);
    let x = S::as_mut_simd_f64s(x).0;
    for ((((x, c0), c1), c2), c3) in x.iter_mut().zip(c0).zip(c1).zip(c2).zip(c3) {
        *x = less_four(simd, *x, [*c0, *c1, *c2, *c3], a);
    }
}

/// The same of four columns at a time, which share the `c`.
#[inline(always)]
fn subtract_four_of_four<S: Simd>(
    simd: S,
    x: [&mut [f64]; PANEL],
    c: [&[f64]; PANEL],
    a: [[f64; PANEL]; PANEL],
) {
    let mut all = [[simd.splat_f64s(0.0); PANEL]; PANEL];
    for (all, a) in all.iter_mut().zip(&a) {
        for (all, a) in all.iter_mut().zip(a) {
            *all = simd.splat_f64s(*a);
        }
    }
    let [x0, x1, x2, x3] = x;
    let [c0, c1, c2, c3] = c;
    let (x0, x1) = (S::as_mut_simd_f64s(x0).0, S::as_mut_simd_f64s(x1).0);
    let (x2, x3) = (S::as_mut_simd_f64s(x2).0, S::as_mut_simd_f64s(x3).0);
    let (c0, c1) = (S::as_simd_f64s(c0).0, S::as_simd_f64s(c1).0);
    let (c2, c3) = (S::as_simd_f64s(c2).0, S::as_simd_f64s(c3).0);
    let x = x0.iter_mut().zip(x1).zip(x2).zip(x3);
    let c = c0.iter().zip(c1).zip(c2).zip(c3);
    for ((((x0, x1), x2), x3), (((c0, c1), c2), c3)) in x.zip(c) {
        let c = [*c0, *c1, *c2, *c3];
        *x0 = less_four(simd, *x0, c, all[0]);
        *x1 = less_four(simd, *x1, c, all[1]);
        *x2 = less_four(simd, *x2, c, all[2]);
        *x3 = less_four(simd, *x3, c, all[3]);
    }
}

#[inline(always)]
fn less_four<S: Simd>(simd: S, x: S::f64s, c: [S::f64s; 4], a: [S::f64s; 4]) -> S::f64s {
    let first = simd.add_f64s(simd.mul_f64s(a[0], c[0]), simd.mul_f64s(a[1], c[1]));
    let second = simd.add_f64s(simd.mul_f64s(a[2], c[2]), simd.mul_f64s(a[3], c[3]));
    simd.sub_f64s(x, simd.add_f64s(first, second))
}

/// Factors up to [`PANEL`] columns, the first of which begins at row `j`; `false` where they are singular.
#[inline(always)]
fn factor_panel<S: Simd>(simd: S, panel: &mut [f64], j: usize, rows: usize) -> bool {
    let start = j / WIDTH * WIDTH;
    for w in 0..panel.len() / rows {
        let (before, column) = panel.split_at_mut(w * rows);
        let column = &mut column[..rows];
        for done in before.chunks_exact(rows) {
            subtract(simd, &mut column[start..], &done[start..], done[j + w]);
        }
        let pivot = column[j + w];
        if pivot.is_nan() || pivot <= 1e-12 {
            return false;
        }
        let root = simd.splat_f64s(1.0 / pivot.sqrt());
        column[start..j + w].fill(0.0);
        for x in S::as_mut_simd_f64s(&mut column[start..]).0 {
            *x = simd.mul_f64s(*x, root);
        }
    }
    true
}

struct Forward<'a, 'b>(&'a Factor, &'a mut [&'b mut [f64]]);

impl WithSimd for Forward<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self(Factor { n, l }, all) = self;
        let rows = padded(*n);
        for (j, column) in l.chunks_exact(rows).enumerate() {
            // What is above the diagonal is zero.
            let from = j / WIDTH * WIDTH;
            for x in all.iter_mut() {
                let first = x[j] / column[j];
                subtract(simd, &mut x[from..], &column[from..*n], first);
                x[j] = first;
            }
        }
    }
}

struct Backward<'a>(&'a Factor, &'a mut [Vec<f64>]);

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self(Factor { n, l }, all) = self;
        let rows = padded(*n);
        // Those of columns side by side wait for each other only in what they have in common.
        for start in (0..*n).step_by(WIDTH).rev() {
            let end = (start + WIDTH).min(*n);
            for x in all.iter_mut() {
                let mut below = [0.0; WIDTH];
                for (j, below) in (start..end).zip(&mut below) {
                    let column = &l[j * rows..(j + 1) * rows];
                    *below = sum_of_columns(simd, &column[start + WIDTH..], &x[start + WIDTH..]);
                }
                for j in (start..end).rev() {
                    let column = &l[j * rows..(j + 1) * rows];
                    let mut rest = x[j] - below[j - start];
                    for i in j + 1..end {
                        rest -= column[i] * x[i];
                    }
                    x[j] = rest / column[j];
                }
            }
        }
    }
}

/// Σ a b of a multiple of [`WIDTH`], in so many parts.
#[inline(always)]
fn sum_of_columns<S: Simd>(simd: S, a: &[f64], b: &[f64]) -> f64 {
    let mut parts = [0.0; WIDTH];
    let every = WIDTH / S::F64_LANES;
    let (a, b) = (S::as_simd_f64s(a).0, S::as_simd_f64s(b).0);
    for group in 0..every {
        let mut sum = simd.splat_f64s(0.0);
        let mut k = group;
        while k < a.len().min(b.len()) {
            sum = simd.add_f64s(sum, simd.mul_f64s(a[k], b[k]));
            k += every;
        }
        S::as_mut_simd_f64s(&mut parts).0[group] = sum;
    }
    let [a, b, c, d, e, f, g, h] = parts;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// `x −= a c`.
#[inline(always)]
fn subtract<S: Simd>(simd: S, x: &mut [f64], c: &[f64], a: f64) {
    let (wide_x, rest_x) = S::as_mut_simd_f64s(x);
    let (wide_c, rest_c) = S::as_simd_f64s(c);
    let wide_a = simd.splat_f64s(a);
    for (x, c) in wide_x.iter_mut().zip(wide_c) {
        *x = simd.sub_f64s(*x, simd.mul_f64s(wide_a, *c));
    }
    for (x, c) in rest_x.iter_mut().zip(rest_c) {
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

/// The covariances of a place with those from number `from` on, a multiple of [`WIDTH`] of them.
#[inline(always)]
fn fill_column<S: Simd>(
    simd: S,
    at: &Axes,
    from: usize,
    covariance: Covariance,
    place: &Pair,
    column: &mut [f64],
) {
    let axes = [0, 1, 2, 3, 4, 5].map(|axis| S::as_simd_f64s(at.axis(axis, from)).0);
    let place = place.map(|x| simd.splat_f64s(x));
    let scale = simd.splat_f64s(covariance.scale);
    let (columns, _) = S::as_mut_simd_f64s(column);
    for (k, out) in columns.iter_mut().enumerate() {
        let square = |axis: usize| {
            let off = simd.sub_f64s(axes[axis][k], place[axis]);
            simd.mul_f64s(off, off)
        };
        let planar = simd.add_f64s(square(0), square(1));
        let upright = simd.add_f64s(square(2), square(3));
        let others = simd.add_f64s(square(4), square(5));
        let squares = simd.add_f64s(simd.add_f64s(planar, upright), others);
        let s = simd.mul_f64s(scale, simd.sqrt_f64s(squares));
        let decayed = exponential(simd, simd.neg_f64s(s));
        *out = match covariance.kernel {
            ScatteredKernel::Exponential => decayed,
            ScatteredKernel::Matern32 => {
                simd.mul_f64s(decayed, simd.add_f64s(simd.splat_f64s(1.0), s))
            }
        };
    }
}

/// What is added to this is rounded to a whole number, which stands in the low bits.
const WHOLE: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts, the first short enough that its products with whole numbers up to 1010 are exact.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
/// 1 / k! up to k = 12: within ±ln 2 / 2 the next term is below 2e-16.
const TAYLOR: [f64; 13] = [
    1.0,
    1.0,
    0.5,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
];

/// eˣ with no branch; beyond ±700 as there.
#[inline(always)]
fn exponential<S: Simd>(simd: S, x: S::f64s) -> S::f64s {
    let mul = |a: S::f64s, b: S::f64s| simd.mul_f64s(a, b);
    let add = |a: S::f64s, b: S::f64s| simd.add_f64s(a, b);
    let all = |x: f64| simd.splat_f64s(x);
    let x = simd.max_f64s(simd.min_f64s(x, all(700.0)), all(-700.0));
    let shifted = add(mul(x, all(std::f64::consts::LOG2_E)), all(WHOLE));
    let halvings = simd.sub_f64s(shifted, all(WHOLE));
    let x = simd.sub_f64s(x, mul(halvings, all(LN_2[0])));
    let x = simd.sub_f64s(x, mul(halvings, all(LN_2[1])));
    // Estrin's scheme: few products wait for each other.
    let two = |k: usize| add(all(TAYLOR[k]), mul(all(TAYLOR[k + 1]), x));
    let x2 = mul(x, x);
    let x4 = mul(x2, x2);
    let low = add(two(0), mul(two(2), x2));
    let low = add(low, mul(add(two(4), mul(two(6), x2)), x4));
    let high = add(two(8), mul(two(10), x2));
    let high = add(high, mul(all(TAYLOR[12]), x4));
    let e = add(low, mul(high, mul(x4, x4)));
    // The whole number becomes an exponent.
    let mut exponents = [shifted];
    for exponent in cast_slice_mut::<S::f64s, u64>(&mut exponents) {
        let whole = exponent.wrapping_sub(WHOLE.to_bits());
        *exponent = whole.wrapping_add(1023) << 52;
    }
    mul(e, exponents[0])
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn decay(s: f64) -> f64 {
        let mut logs = [-s; 8];
        exponentials(Arch::new(), &mut logs);
        assert!(logs.iter().all(|x| *x == exponential(Scalar, -s)));
        logs[0]
    }

    #[test]
    fn decays_are_those_of_the_exponential() {
        for k in 0..4000 {
            let s = 0.17 * f64::from(k);
            let truth = (-s).exponential();
            assert!((decay(s) / truth - 1.0).abs() < 1e-14, "{s}");
            assert!((decay(-s) * truth - 1.0).abs() < 1e-14, "{s}");
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
                factor.forward(Arch::new(), &mut [&mut x[..]]);
                let mut narrow = [x.clone()];
                narrow[0].resize(padded(n), 0.0);
                Backward(&factor, &mut narrow).with_simd(pulp::Scalar);
                let mut solved = [x];
                factor.backward(Arch::new(), &mut solved);
                let [x] = solved;
                assert!(x == narrow[0][..n]);
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
                let mut narrow = vec![0.0; n * padded(n)];
                let filled = Filled {
                    k: &mut narrow,
                    at: &at,
                    covariance,
                };
                filled.with_simd(pulp::Scalar);
                add_noise(n, &mut narrow, 1e-3, &noise);
                assert!(Factored(n, &mut narrow).with_simd(pulp::Scalar));
                assert!(narrow == factor.l);
            }
        }
    }
}
