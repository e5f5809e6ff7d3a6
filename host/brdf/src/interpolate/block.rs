//! One block: a Gaussian process through the nodes around a place, evaluated at many cells.
//!
//! Ordinary kriging with a Matérn-3/2 kernel `k(d) = (1 + s) e^{−s}`, `s = √3 d / range`, the range
//! a fixed multiple of the neighbourhood's radius, and a nugget on the diagonal. The constant mean
//! is estimated with the rest (generalised least squares). One factorisation serves all cells and
//! all channels.

use super::cholesky::{Columns, PANEL};
use super::coordinates::{Point, Trend, distance2};
use super::nodes::Node;
use pulp::{Arch, Simd, WithSimd};
use std::borrow::Borrow;

/// What a block is fitted with.
#[derive(Clone, Copy, Debug)]
pub struct BlockSettings {
    /// Range of the kernel in radii of the neighbourhood.
    pub range: f32,
    /// What the second half of a point counts in the kernel's distances, over what it counts in others.
    pub stretch: f32,
    /// Variance of the logarithm of one sample.
    pub noise_variance: f32,
    /// Smallest nugget (noise over signal variance): single precision needs one.
    pub nugget_min: f32,
    /// The process is that of the logarithms less this.
    pub trend: Trend,
}

/// The widest vectors in use hold 16 numbers; buffers are padded to it.
const PAD: usize = 16;
/// A node that counts less than this is as good as absent.
const COUNT_MIN: f32 = 1e-3;
/// Right-hand sides: three channels and the constant.
const RHS: usize = 4;

/// Working memory of one thread, used again for block after block.
#[derive(Default)]
pub struct BlockSolver {
    matrix: Columns,
    /// Coordinates of the nodes from the middle, axis by axis, times √3 over the range.
    axes: [Vec<f32>; 6],
    /// Squared length of these coordinates.
    norms: Vec<f32>,
    /// The middle: where the coordinates count from. Distances come from scalar products, which
    /// single precision only bears near the origin.
    middle: Point,
    log_values: [Vec<f32>; 3],
    counts: Vec<f32>,
    /// `K⁻¹ (y − μ)`, channel by channel.
    weights: [Vec<f32>; 3],
    mean: [f32; 3],
    /// Values stay between these, channel by channel.
    limits: [(f32, f32); 3],
    /// Variance of the process, channel by channel, by maximum likelihood.
    signal: [f32; 3],
    /// Nodes in the factor.
    n: usize,
    /// Whether the matrix holds a factor.
    factored: bool,
    /// Kernel of a few places with all nodes, and what the factor makes of it.
    columns: Vec<f32>,
    /// √3 over the range, axis by axis.
    scale: Point,
    trend: Trend,
    /// The trend at the nodes less that in the middle.
    trends: Vec<f32>,
    /// Variance of the trend's slope over that of the process.
    slope_variance: f32,
    /// By how much the slope is off, channel by channel.
    slopes: [f32; 3],
    arch: Arch,
}

impl BlockSolver {
    /// Fits the process to nodes that lie within `radius` of each other's middle: the radius that the
    /// range is measured in. Returns the nugget that was used.
    ///
    /// With fewer than two nodes the mean is all there is.
    pub fn fit(
        &mut self,
        nodes: impl ExactSizeIterator<Item = impl Borrow<Node>>,
        middle: Point,
        radius: f32,
        settings: &BlockSettings,
    ) -> f32 {
        let n = nodes.len();
        let padded = n.next_multiple_of(PAD);
        self.middle = middle;
        self.trend = settings.trend;
        let scale = 3f32.sqrt() / (settings.range * radius.max(1e-6));
        let second = scale * settings.stretch;
        self.scale = [scale, scale, scale, second, second, second];
        self.load(nodes, padded);
        self.limits = [0, 1, 2].map(|c| limits_of(&self.log_values[c][..n]));
        if n >= 2 {
            let mut nugget = None;
            // A pivot lost to rounding is mended by a larger nugget; the last of these makes any
            // kernel matrix diagonally dominant enough.
            for attempt in 0..8 {
                let used = self.arch.dispatch(Fit {
                    solver: self,
                    n,
                    padded,
                    settings,
                    nugget,
                });
                match used {
                    Ok(nugget) => {
                        self.factored = true;
                        return nugget;
                    }
                    Err(tried) => nugget = Some(tried * if attempt < 3 { 4.0 } else { 32.0 }),
                }
            }
        }
        self.fall_back_to_mean(n);
        self.factored = false;
        1.0
    }

    /// Variance of the fitted process about its true value at places, per channel, as far as the
    /// nodes around can tell: the kriging variance times the variance that the nodes' values show.
    /// Appends to `out`. Call after [`Self::fit`]; where that fell back to the mean, the variance of
    /// the nodes' values.
    pub fn variances_at(&mut self, places: &[Point], out: &mut Vec<[f32; 3]>) {
        if !self.factored {
            out.extend(places.iter().map(|_| self.signal));
            return;
        }
        self.arch.dispatch(Variance {
            solver: self,
            places,
            out,
        });
    }

    /// Variance of the mean of the fitted process over some places, as [`Self::variances_at`] has it for each.
    pub fn variance_of_mean(&mut self, places: &[Point]) -> [f32; 3] {
        if !self.factored || places.is_empty() {
            return self.signal;
        }
        let share = 1.0 / places.len() as f32;
        let in_middle = self.trend.at(&self.middle);
        let trend = share
            * places
                .iter()
                .map(|p| self.trend.at(p) - in_middle)
                .sum::<f32>();
        let scaled: Vec<Point> = places
            .iter()
            .map(|p| std::array::from_fn(|k| (p[k] - self.middle[k]) * self.scale[k]))
            .collect();
        let correlation = |a: &Point, b: &Point| {
            let s = distance2(a, b).sqrt();
            (1.0 + s) * (-s).exp()
        };
        let mut own = self.slope_variance * trend * trend;
        for a in &scaled {
            for b in &scaled {
                own += share * share * correlation(a, b);
            }
        }
        let mut u: Vec<f32> = (0..self.n)
            .map(|j| {
                let node: Point = std::array::from_fn(|k| self.axes[k][j]);
                let sum: f32 = scaled.iter().map(|p| correlation(p, &node)).sum();
                share * sum + self.slope_variance * self.trends[j] * trend
            })
            .collect();
        let ones = self.norms.len() + 3;
        let (mut uu, mut zu, mut zz) = (0.0f32, 0.0f32, 0.0f32);
        for j in 0..self.n {
            let column = self.matrix.column(j);
            let x = u[j] / column[j];
            uu += x * x;
            zu += x * column[ones];
            zz += column[ones] * column[ones];
            for (entry, l) in u[j + 1..].iter_mut().zip(&column[j + 1..self.n]) {
                *entry -= x * l;
            }
        }
        let kriging = (own - uu).max(0.0) + (1.0 - zu).powi(2) / zz.max(1e-12);
        self.signal.map(|signal| signal * kriging)
    }

    /// Evaluates the fitted process at places; appends the logarithm per channel, which stays near the
    /// nodes' range: beyond them the process is no more than a guess, and must not run away.
    pub fn evaluate(&self, places: &[Point], out: &mut Vec<[f32; 3]>) {
        self.arch.dispatch(Evaluate {
            solver: self,
            places,
            out,
        });
    }

    fn load(&mut self, nodes: impl ExactSizeIterator<Item = impl Borrow<Node>>, padded: usize) {
        for buffer in self
            .axes
            .iter_mut()
            .chain(&mut self.log_values)
            .chain(&mut self.weights)
            .chain([&mut self.counts, &mut self.norms, &mut self.trends])
        {
            buffer.clear();
            buffer.resize(padded, 0.0);
        }
        let in_middle = self.trend.at(&self.middle);
        for (row, node) in nodes.enumerate() {
            let node = node.borrow();
            for k in 0..6 {
                let x = (node.point[k] - self.middle[k]) * self.scale[k];
                self.axes[k][row] = x;
                self.norms[row] += x * x;
            }
            let trend = self.trend.at(&node.point);
            self.trends[row] = trend - in_middle;
            for c in 0..3 {
                self.log_values[c][row] = node.log_value[c] - trend;
            }
            self.counts[row] = node.count;
        }
    }

    fn fall_back_to_mean(&mut self, n: usize) {
        for c in 0..3 {
            self.mean[c] = self.log_values[c].iter().sum::<f32>() / n.max(1) as f32;
            self.weights[c].fill(0.0);
            self.slopes[c] = 0.0;
            let squares = self.log_values[c][..n]
                .iter()
                .map(|v| (v - self.mean[c]).powi(2));
            self.signal[c] = squares.sum::<f32>() / n.max(1) as f32;
        }
    }
}

/// A value may lie beyond those around by this share of their range, as a peak between them does …
const BEYOND_SHARE: f32 = 0.5;
/// … and by this in any case, but never by more than that, in natural logarithms.
const BEYOND: (f32, f32) = (0.1, 1.0);

fn limits_of(values: &[f32]) -> (f32, f32) {
    let low = values.iter().copied().fold(f32::INFINITY, f32::min);
    let high = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    if low > high {
        // Of no nodes.
        return (f32::NEG_INFINITY, f32::INFINITY);
    }
    let beyond = (BEYOND_SHARE * (high - low)).clamp(BEYOND.0, BEYOND.1);
    (low - beyond, high + beyond)
}

struct Fit<'a> {
    solver: &'a mut BlockSolver,
    n: usize,
    padded: usize,
    settings: &'a BlockSettings,
    nugget: Option<f32>,
}

impl WithSimd for Fit<'_> {
    /// The nugget used, or the one that failed.
    type Output = Result<f32, f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let (n, padded) = (self.n, self.padded);
        let s = self.solver;
        s.matrix.resize(padded, padded + PAD);
        let correlations = s.fill_matrix(simd, n, padded);
        let (variance, noise) = s.variances(n, self.settings);
        // Under the process, the expected variance of n values is σ_f² (1 − mean correlation) +
        // σ_n². Never believe that all is noise: a tenth of the variance is signal.
        let pairs = (n * (n - 1) / 2) as f32;
        let decorrelation = (1.0 - correlations / pairs).max(1e-6);
        let signal = (variance - noise).max(0.1 * variance).max(1e-12) / decorrelation;
        let nugget = self.nugget.unwrap_or_else(|| {
            (self.settings.noise_variance / signal).clamp(self.settings.nugget_min, 1.0)
        });
        for j in 0..n {
            s.matrix.column_mut(j)[j] = 1.0 + nugget / s.counts[j].max(COUNT_MIN);
        }
        s.add_slope(signal, n);
        if !s.matrix.factor(simd, padded) {
            return Err(nugget);
        }
        s.solve_back(simd, n, padded);
        s.n = n;
        Ok(nugget)
    }
}

impl BlockSolver {
    /// The kernel matrix, padded by the unit matrix, with the right-hand sides below. Returns the
    /// sum of the correlations of all pairs.
    #[inline(always)]
    fn fill_matrix<S: Simd>(&mut self, simd: S, n: usize, padded: usize) -> f32 {
        // The matrix is symmetric: the squares on its diagonal hold each pair twice, and each node with
        // itself.
        let mut below = simd.splat_f32s(0.0);
        let mut square = simd.splat_f32s(0.0);
        let mut surplus = 0.0f32;
        for j in 0..n {
            let mut place = Place::<S>::at_origin(simd);
            for k in 0..6 {
                place.set(simd, k, self.axes[k][j]);
            }
            let first = j / S::F32_LANES * S::F32_LANES;
            let column = self.matrix.column_mut(j);
            let (target, _) = S::as_mut_simd_f32s(&mut column[first..padded]);
            let axes = vectors::<S>(&self.axes, &self.norms, first..padded);
            let mut r = 0;
            while r + CHAINS <= target.len() {
                let k = kernel::<S, CHAINS>(simd, &place, &axes, r);
                for g in 0..CHAINS {
                    target[r + g] = k[g];
                    below = simd.add_f32s(below, k[g]);
                }
                r += CHAINS;
            }
            while r < target.len() {
                let [k] = kernel::<S, 1>(simd, &place, &axes, r);
                target[r] = k;
                below = simd.add_f32s(below, k);
                r += 1;
            }
            square = simd.add_f32s(square, target[0]);
            // What whole vectors hold of the padding; half of it in the last square.
            for row in n..padded {
                let share = if row < first + S::F32_LANES { 0.5 } else { 1.0 };
                surplus += share * column[row];
            }
            column[n..].fill(0.0);
            for c in 0..3 {
                column[padded + c] = self.log_values[c][j];
            }
            column[padded + 3] = 1.0;
        }
        for j in n..padded {
            let column = self.matrix.column_mut(j);
            column.fill(0.0);
            column[j] = 1.0;
        }
        let squares = simd.reduce_sum_f32s(square) + n as f32;
        simd.reduce_sum_f32s(below) - 0.5 * squares - surplus
    }

    /// Adds what the nodes share by their trend, whose slope differs from block to block.
    #[inline(always)]
    fn add_slope(&mut self, signal: f32, n: usize) {
        let largest = self.trends.iter().fold(0.0f32, |m, t| m.max(t * t));
        let spread = SLOPE_SPREAD * SLOPE_SPREAD / signal;
        self.slope_variance = spread.min(SLOPE_MAX / largest.max(f32::MIN_POSITIVE));
        if self.slope_variance * largest < SLOPE_MIN {
            self.slope_variance = 0.0;
            return;
        }
        for j in 0..n {
            let factor = self.slope_variance * self.trends[j];
            let column = &mut self.matrix.column_mut(j)[j..n];
            for (entry, trend) in column.iter_mut().zip(&self.trends[j..n]) {
                *entry += factor * trend;
            }
        }
    }

    /// Variance of the nodes' values, mean over the channels, and the share of it that is noise.
    fn variances(&self, n: usize, settings: &BlockSettings) -> (f32, f32) {
        let mut variance = 0.0;
        for values in &self.log_values {
            let (mut sum, mut squares) = (0.0f64, 0.0f64);
            for value in &values[..n] {
                sum += f64::from(*value);
                squares += f64::from(*value) * f64::from(*value);
            }
            variance += (squares - sum * sum / n as f64).max(0.0) / (3 * (n - 1)) as f64;
        }
        let per_sample: f32 = self.counts[..n].iter().map(|c| 1.0 / c.max(1.0)).sum();
        (
            variance as f32,
            settings.noise_variance * per_sample / n as f32,
        )
    }

    /// Mean and weights from the factor and `L⁻¹ b` in the extra rows.
    #[inline(always)]
    fn solve_back<S: Simd>(&mut self, simd: S, n: usize, padded: usize) {
        let mut with_ones = [0.0f32; RHS];
        for j in 0..n {
            let z = &self.matrix.column(j)[padded..padded + RHS];
            for k in 0..RHS {
                with_ones[k] += z[3] * z[k];
            }
        }
        for c in 0..3 {
            self.mean[c] = with_ones[c] / with_ones[3];
        }
        // (y − μ)ᵀ K⁻¹ (y − μ) / n.
        let mut squares = [0.0f32; 3];
        for j in 0..n {
            let z = &self.matrix.column(j)[padded..padded + RHS];
            for c in 0..3 {
                squares[c] += (z[c] - self.mean[c] * z[3]).powi(2);
            }
        }
        for c in 0..3 {
            self.signal[c] = squares[c] / n as f32;
        }
        // Some columns at a time: first what the rows below take from them, which none of them waits for, then
        // the small triangle that is left.
        let lanes = S::F32_LANES;
        for from in (0..n).step_by(lanes).rev() {
            let to = (from + lanes).min(n);
            let mut left = [[0.0f32; 3]; PAD];
            for j in from..to {
                let column = self.matrix.column(j);
                let below = (from + lanes).min(padded);
                let (l, _) = S::as_simd_f32s(&column[below..padded]);
                let mut dots = [simd.splat_f32s(0.0); 3];
                for c in 0..3 {
                    let (w, _) = S::as_simd_f32s(&self.weights[c][below..padded]);
                    for (a, b) in l.iter().zip(w) {
                        dots[c] = simd.mul_add_e_f32s(*a, *b, dots[c]);
                    }
                }
                let z = &column[padded..padded + RHS];
                for c in 0..3 {
                    let dot = simd.reduce_sum_f32s(dots[c]);
                    left[j - from][c] = z[c] - self.mean[c] * z[3] - dot;
                }
            }
            for j in (from..to).rev() {
                let inverse = 1.0 / self.matrix.column(j)[j];
                let weights = left[j - from].map(|x| x * inverse);
                for c in 0..3 {
                    self.weights[c][j] = weights[c];
                }
                for i in from..j {
                    let l = self.matrix.column(i)[j];
                    for c in 0..3 {
                        left[i - from][c] -= l * weights[c];
                    }
                }
            }
        }
        for c in 0..3 {
            let pairs = self.weights[c].iter().zip(&self.trends);
            self.slopes[c] = self.slope_variance * pairs.map(|(w, t)| w * t).sum::<f32>();
        }
    }
}

/// Standard deviation of the trend's slope from block to block: it is 0 where a base makes the value, and
/// some 1 in a lobe.
const SLOPE_SPREAD: f32 = 0.5;
/// The variance that the slope makes, over that of the process, is at most this (single precision bears no
/// more, and the slope is as free as it would be with more) …
const SLOPE_MAX: f32 = 4.0;
/// … and below this left out.
const SLOPE_MIN: f32 = 1e-3;

struct Evaluate<'a> {
    solver: &'a BlockSolver,
    places: &'a [Point],
    out: &'a mut Vec<[f32; 3]>,
}

impl WithSimd for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let s = self.solver;
        let axes = vectors::<S>(&s.axes, &s.norms, 0..s.norms.len());
        let weights = [
            S::as_simd_f32s(&s.weights[0]).0,
            S::as_simd_f32s(&s.weights[1]).0,
            S::as_simd_f32s(&s.weights[2]).0,
        ];
        let in_middle = s.trend.at(&s.middle);
        for point in self.places {
            let mut place = Place::<S>::at_origin(simd);
            for k in 0..6 {
                place.set(simd, k, (point[k] - s.middle[k]) * s.scale[k]);
            }
            let mut sums = [simd.splat_f32s(0.0); 3];
            let mut r = 0;
            while r + CHAINS <= axes.norms.len() {
                let k = kernel::<S, CHAINS>(simd, &place, &axes, r);
                for g in 0..CHAINS {
                    for c in 0..3 {
                        sums[c] = simd.mul_add_e_f32s(k[g], weights[c][r + g], sums[c]);
                    }
                }
                r += CHAINS;
            }
            while r < axes.norms.len() {
                let [k] = kernel::<S, 1>(simd, &place, &axes, r);
                for c in 0..3 {
                    sums[c] = simd.mul_add_e_f32s(k, weights[c][r], sums[c]);
                }
                r += 1;
            }
            let trend = s.trend.at(point);
            let from_middle = trend - in_middle;
            let mut result = s.mean;
            for c in 0..3 {
                result[c] += simd.reduce_sum_f32s(sums[c]) + from_middle * s.slopes[c];
                let (low, high) = s.limits[c];
                result[c] = result[c].max(low).min(high) + trend;
            }
            self.out.push(result);
        }
    }
}

struct Variance<'a> {
    solver: &'a mut BlockSolver,
    places: &'a [Point],
    out: &'a mut Vec<[f32; 3]>,
}

impl WithSimd for Variance<'_> {
    type Output = ();

    /// Places in the lanes: `u = L⁻¹ k`, column by column of L, for a vector of places at once; then
    /// `1 − uᵀu + (1 − zᵀu)² / zᵀz` with `z = L⁻¹ 1`, the last term for the unknown mean.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let s = self.solver;
        let (n, lanes) = (s.n, S::F32_LANES);
        let ones = s.norms.len() + 3;
        let mut zz = 0.0f32;
        for j in 0..n {
            zz += s.matrix.column(j)[ones].powi(2);
        }
        s.columns.resize(n * lanes, 0.0);
        // Coordinates of the places, axis by axis, and their squared lengths, in seven vectors.
        let mut buffer = [0.0f32; 8 * PAD];
        let in_middle = s.trend.at(&s.middle);
        for places in self.places.chunks(lanes) {
            buffer.fill(0.0);
            for (lane, point) in places.iter().enumerate() {
                buffer[7 * lanes + lane] = s.trend.at(point) - in_middle;
                for k in 0..6 {
                    let x = (point[k] - s.middle[k]) * s.scale[k];
                    buffer[k * lanes + lane] = x;
                    buffer[6 * lanes + lane] += x * x;
                }
            }
            let (vectors, _) = S::as_simd_f32s(&buffer);
            let axes = Axes::<S> {
                axes: [
                    &vectors[0..1],
                    &vectors[1..2],
                    &vectors[2..3],
                    &vectors[3..4],
                    &vectors[4..5],
                    &vectors[5..6],
                ],
                norms: &vectors[6..7],
            };
            let (u, _) = S::as_mut_simd_f32s(&mut s.columns);
            for j in 0..n {
                let mut node = Place::<S>::at_origin(simd);
                for k in 0..6 {
                    node.set(simd, k, s.axes[k][j]);
                }
                let slope = simd.splat_f32s(s.slope_variance * s.trends[j]);
                let [k] = kernel::<S, 1>(simd, &node, &axes, 0);
                u[j] = simd.mul_add_e_f32s(slope, vectors[7], k);
            }
            let mut uu = simd.splat_f32s(0.0);
            let mut zu = simd.splat_f32s(0.0);
            for j in 0..n {
                let column = s.matrix.column(j);
                let (done, rest) = u.split_at_mut(j + 1);
                let x = simd.mul_f32s(done[j], simd.splat_f32s(1.0 / column[j]));
                uu = simd.mul_add_e_f32s(x, x, uu);
                zu = simd.mul_add_e_f32s(x, simd.splat_f32s(column[ones]), zu);
                for (t, l) in rest.iter_mut().zip(&column[j + 1..n]) {
                    *t = simd.mul_add_e_f32s(x, simd.splat_f32s(-*l), *t);
                }
            }
            let mut out = [0.0f32; 2 * PAD];
            {
                let (vectors, _) = S::as_mut_simd_f32s(&mut out);
                vectors[0] = uu;
                vectors[1] = zu;
            }
            for lane in 0..places.len() {
                let (uu, zu) = (out[lane], out[lanes + lane]);
                let own = 1.0 + s.slope_variance * buffer[7 * lanes + lane].powi(2);
                let kriging = (own - uu).max(0.0) + (1.0 - zu).powi(2) / zz.max(1e-12);
                let mut variance = s.signal;
                for c in 0..3 {
                    variance[c] *= kriging;
                }
                self.out.push(variance);
            }
        }
    }
}

/// One place in all lanes: −2 times its coordinates, and their squared length.
#[derive(Clone, Copy)]
struct Place<S: Simd> {
    minus_twice: [S::f32s; 6],
    norm: f32,
}

impl<S: Simd> Place<S> {
    #[inline(always)]
    fn at_origin(simd: S) -> Self {
        Self {
            minus_twice: [simd.splat_f32s(0.0); 6],
            norm: 0.0,
        }
    }

    #[inline(always)]
    fn set(&mut self, simd: S, axis: usize, x: f32) {
        self.minus_twice[axis] = simd.splat_f32s(-2.0 * x);
        self.norm += x * x;
    }
}

/// A range of the nodes' coordinates as vectors.
struct Axes<'a, S: Simd> {
    axes: [&'a [S::f32s]; 6],
    norms: &'a [S::f32s],
}

/// Spelt out, like all that is below `with_simd`: a closure there would be compiled without the
/// instruction set.
#[inline(always)]
fn vectors<'a, S: Simd>(
    axes: &'a [Vec<f32>; 6],
    norms: &'a [f32],
    range: std::ops::Range<usize>,
) -> Axes<'a, S> {
    Axes {
        axes: [
            S::as_simd_f32s(&axes[0][range.clone()]).0,
            S::as_simd_f32s(&axes[1][range.clone()]).0,
            S::as_simd_f32s(&axes[2][range.clone()]).0,
            S::as_simd_f32s(&axes[3][range.clone()]).0,
            S::as_simd_f32s(&axes[4][range.clone()]).0,
            S::as_simd_f32s(&axes[5][range.clone()]).0,
        ],
        norms: S::as_simd_f32s(&norms[range]).0,
    }
}

/// Vectors of the kernel computed step by step together: one alone is a chain of forty dependent
/// instructions, and the processor would wait at each.
const CHAINS: usize = 4;

/// Matérn 3/2, `(1 + s) e^{−s}`, of the scaled distances s from a place to vectors `r..r + G` of the
/// nodes.
#[inline(always)]
fn kernel<S: Simd, const G: usize>(
    simd: S,
    place: &Place<S>,
    nodes: &Axes<'_, S>,
    r: usize,
) -> [S::f32s; G] {
    let norm = simd.splat_f32s(place.norm);
    let mut s2 = [norm; G];
    for g in 0..G {
        s2[g] = simd.add_f32s(nodes.norms[r + g], norm);
    }
    for k in 0..6 {
        for g in 0..G {
            s2[g] = simd.mul_add_e_f32s(nodes.axes[k][r + g], place.minus_twice[k], s2[g]);
        }
    }
    let tiny = simd.splat_f32s(1e-12);
    for g in 0..G {
        s2[g] = simd.max_f32s(s2[g], tiny);
    }
    let mut s = roots(simd, s2);
    let longest = simd.splat_f32s(S_MAX);
    for g in 0..G {
        s[g] = simd.min_f32s(s[g], longest);
    }
    let mut p = [simd.splat_f32s(MATERN[0]); G];
    for k in 1..MATERN.len() {
        let coefficient = simd.splat_f32s(MATERN[k]);
        for g in 0..G {
            p[g] = simd.mul_add_e_f32s(p[g], s[g], coefficient);
        }
    }
    p
}

/// √x for positive, normal x, by Newton's iteration for 1/√x: its steps are products, of which vectors of
/// 16 do many in the time of a square root. Relative error below 1e-6.
#[inline(always)]
fn roots<S: Simd, const G: usize>(simd: S, x: [S::f32s; G]) -> [S::f32s; G] {
    let (minus_half, three_halves) = (simd.splat_f32s(-0.5), simd.splat_f32s(1.5));
    let mut y = x;
    let mut steps = NEWTON;
    for g in 0..G {
        if let Some(guess) = reciprocal_root::<S>(simd, x[g]) {
            y[g] = guess;
            steps = 1;
        } else {
            // From the exponent's half.
            let (one, magic) = (simd.splat_u32s(1), simd.splat_u32s(0x5f37_5a86));
            let half_exponent = simd.wrapping_dyn_shr_u32s(simd.transmute_u32s_f32s(x[g]), one);
            y[g] = simd.transmute_f32s_u32s(simd.sub_u32s(magic, half_exponent));
        }
    }
    for _ in 1..steps {
        for g in 0..G {
            let t = simd.mul_f32s(simd.mul_f32s(x[g], minus_half), y[g]);
            y[g] = simd.mul_f32s(y[g], simd.mul_add_e_f32s(t, y[g], three_halves));
        }
    }
    // The last step gives x / √x at once.
    let mut root = x;
    for g in 0..G {
        root[g] = simd.mul_f32s(x[g], y[g]);
    }
    for g in 0..G {
        y[g] = simd.mul_f32s(y[g], minus_half);
    }
    for g in 0..G {
        y[g] = simd.mul_add_e_f32s(root[g], y[g], three_halves);
    }
    for g in 0..G {
        root[g] = simd.mul_f32s(root[g], y[g]);
    }
    root
}

/// 1/√x as the processor guesses it, to 14 bits (AVX-512) or 12 (AVX2), where it does.
#[inline(always)]
fn reciprocal_root<S: Simd>(simd: S, x: S::f32s) -> Option<S::f32s> {
    #[cfg(target_arch = "x86_64")]
    {
        use pulp::bytemuck::cast;
        use pulp::x86::{V3, V4};
        let simd: &dyn std::any::Any = &simd;
        if let Some(simd) = simd.downcast_ref::<V4>() {
            return Some(cast(simd.avx512f._mm512_rsqrt14_ps(cast(x))));
        }
        if let Some(simd) = simd.downcast_ref::<V3>() {
            return Some(cast(simd.avx._mm256_rsqrt_ps(cast(x))));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (simd, x);
    None
}

/// Newton's steps without the processor's help: each doubles the digits, the guess has five bits.
const NEWTON: usize = 3;

/// The kernel is constant beyond this. Nodes are within two radii of each other, so that s stays
/// below 0.5 with a range of 8 radii.
const S_MAX: f32 = 1.0;
/// `(1 + s) e^{−s}` for 0 ≤ s ≤ 1 through Chebyshev's points, highest power first. Off by 1.2e-7.
const MATERN: [f32; 7] = [
    -3.833_789_6e-3,
    2.948_314_1e-2,
    -1.225_060_45e-1,
    3.324_849e-1,
    -4.998_608_5e-1,
    -8.626_152_5e-6,
    1.000_000_1,
];
const _: () = assert!(PAD.is_multiple_of(PANEL));

#[cfg(test)]
mod tests {
    use super::super::coordinates::Coordinates;
    use super::*;

    const SETTINGS: BlockSettings = BlockSettings {
        range: 8.0,
        stretch: 1.0,
        noise_variance: 1e-6,
        nugget_min: 1e-4,
        trend: Trend::NONE,
    };

    fn node(x: f32, y: f32, count: f32) -> Node {
        let v = (3.0 * x).sin() + 0.5 * y;
        Node {
            point: [x, y, 0.0, 0.0, 0.0, 0.0],
            log_value: [v, 2.0 * v, -v],
            count,
            source: 0,
        }
    }

    fn scattered(n: usize) -> Vec<Node> {
        // The golden-ratio sequence fills the square evenly.
        (0..n)
            .map(|k| {
                let f = |a: f64| ((k as f64 * a) % 1.0) as f32 - 0.5;
                node(f(0.754_877_666), f(0.569_840_291), 1.0)
            })
            .collect()
    }

    fn at(solver: &BlockSolver, place: &Point) -> [f32; 3] {
        let mut out = Vec::new();
        solver.evaluate(&[*place], &mut out);
        out[0]
    }

    #[test]
    fn a_smooth_function_is_found_again_between_its_nodes() {
        for n in [48, 64, 185] {
            let nodes = scattered(n);
            let mut solver = BlockSolver::default();
            solver.fit(nodes.iter(), [0.0; 6], 0.7, &SETTINGS);
            for (x, y) in [(0.1, 0.2), (-0.3, 0.33), (0.0, 0.0)] {
                let truth = node(x, y, 1.0);
                let got = at(&solver, &truth.point);
                for c in 0..3 {
                    let off = (got[c] - truth.log_value[c]).abs();
                    assert!(off < 0.03, "{n} {x} {y} {c}: {off}");
                }
            }
        }
    }

    #[test]
    fn the_solution_satisfies_the_kriging_equations() {
        let nodes = scattered(50);
        let mut solver = BlockSolver::default();
        let nugget = f64::from(solver.fit(nodes.iter(), [0.0; 6], 0.7, &SETTINGS));
        let scale = 3f64.sqrt() / (8.0 * 0.7);
        let k = |a: &Node, b: &Node| {
            let s = (0..6)
                .map(|i| f64::from(a.point[i] - b.point[i]).powi(2))
                .sum::<f64>()
                .sqrt()
                * scale;
            (1.0 + s) * (-s).exp()
        };
        for c in 0..3 {
            // (K + λ I) w + μ = y, and the weights sum to zero.
            let total: f32 = solver.weights[c].iter().sum();
            let largest = solver.weights[c].iter().fold(0f32, |m, w| m.max(w.abs()));
            assert!(total.abs() < 2e-3 * largest, "{total} {largest}");
            for (i, a) in nodes.iter().enumerate() {
                let row: f64 = nodes
                    .iter()
                    .zip(&solver.weights[c])
                    .map(|(b, w)| k(a, b) * f64::from(*w))
                    .sum();
                let left =
                    row + nugget * f64::from(solver.weights[c][i]) + f64::from(solver.mean[c]);
                assert!((left - f64::from(a.log_value[c])).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn the_variance_is_what_kriging_says() {
        // Against a dense solve in double precision, at places off the nodes and on one.
        let nodes = scattered(40);
        let mut solver = BlockSolver::default();
        let nugget = f64::from(solver.fit(nodes.iter(), [0.0; 6], 0.7, &SETTINGS));
        let scale = 3f64.sqrt() / (8.0 * 0.7);
        let k = |a: &Point, b: &Point| {
            let squares = (0..6).map(|i| f64::from(a[i] - b[i]).powi(2));
            let s = squares.sum::<f64>().sqrt() * scale;
            (1.0 + s) * (-s).exp()
        };
        let places: Vec<Point> = (0..20)
            .map(|i| node(0.05 * i as f32 - 0.5, 0.3, 1.0).point)
            .chain([nodes[7].point])
            .collect();
        let mut got = Vec::new();
        solver.variances_at(&places, &mut got);
        // Ordinary kriging: K and a border of ones.
        let n = nodes.len();
        let matrix: Vec<Vec<f64>> = (0..=n)
            .map(|i| {
                (0..=n)
                    .map(|j| match (i < n, j < n) {
                        (true, true) => {
                            k(&nodes[i].point, &nodes[j].point) + if i == j { nugget } else { 0.0 }
                        }
                        (false, false) => 0.0,
                        _ => 1.0,
                    })
                    .collect()
            })
            .collect();
        for (place, got) in places.iter().zip(&got) {
            let mut rhs: Vec<f64> = nodes.iter().map(|b| k(place, &b.point)).collect();
            rhs.push(1.0);
            let x = gauss(matrix.clone(), rhs.clone());
            let kriging: f64 = 1.0 - x.iter().zip(&rhs).map(|(a, b)| a * b).sum::<f64>();
            for c in 0..3 {
                let off = f64::from(got[c] / solver.signal[c]) - kriging;
                assert!(off.abs() < 2e-5 + 0.02 * kriging, "{off} {kriging}");
            }
        }
    }

    #[test]
    fn a_stretch_is_a_kernel_of_shorter_axes() {
        // Once by the settings, once by the points; nodes and places off both halves' axes.
        let moved = |node: &Node, by: f32| {
            let mut node = *node;
            node.point[4] = by * node.point[1];
            node
        };
        let place = |by: f32| moved(&node(0.13, -0.21, 1.0), by).point;
        let predicted = |by: f32, stretch: f32| {
            let nodes: Vec<Node> = scattered(60).iter().map(|n| moved(n, by)).collect();
            let settings = BlockSettings {
                stretch,
                ..SETTINGS
            };
            let mut solver = BlockSolver::default();
            solver.fit(nodes.iter(), [0.0; 6], 0.7, &settings);
            let mut variance = Vec::new();
            solver.variances_at(&[place(by)], &mut variance);
            let of_mean = solver.variance_of_mean(&[place(by)]);
            [at(&solver, &place(by))[0], variance[0][0], of_mean[0]]
        };
        let (by_settings, by_points, plain) = (
            predicted(2.0, 0.5),
            predicted(1.0, 1.0),
            predicted(2.0, 1.0),
        );
        for k in 0..3 {
            let near = (by_settings[k] / by_points[k] - 1.0).abs();
            let far = (plain[k] / by_points[k] - 1.0).abs();
            assert!(near < 1e-3 && far > 3.0 * near, "{k}: {near} {far}");
        }
    }

    /// Nodes along the second half's first axis, whose values follow the trend of half/difference
    /// coordinates so many times.
    fn along_the_trend(times: f32) -> (BlockSettings, Vec<Node>) {
        let trend = Coordinates::half_difference(0.5).trend();
        let settings = BlockSettings { trend, ..SETTINGS };
        let nodes = (0..60)
            .map(|k| {
                let mut node = node(0.002 * (k % 7) as f32, 0.0, 1.0);
                node.point[3] = 0.4 + 0.004 * k as f32;
                node.log_value = [times * trend.at(&node.point); 3];
                node
            })
            .collect();
        (settings, nodes)
    }

    #[test]
    fn a_trend_goes_on_beyond_the_nodes_with_the_slope_that_they_show() {
        let beyond: Point = [0.0, 0.0, 0.0, 0.68, 0.0, 0.0];
        let middle: Point = [0.0, 0.0, 0.0, 0.52, 0.0, 0.0];
        for times in [0.5, 1.0, 1.5] {
            let (settings, nodes) = along_the_trend(times);
            let expected = times * settings.trend.at(&beyond);
            let off = |settings: &BlockSettings| {
                let mut solver = BlockSolver::default();
                solver.fit(nodes.iter(), middle, 0.12, settings);
                (at(&solver, &beyond)[0] - expected).abs()
            };
            let (with, without) = (off(&settings), off(&SETTINGS));
            assert!(
                with < 0.1 * expected && with < 0.5 * without,
                "{times}: {with} {without}"
            );
        }
    }

    #[test]
    fn the_variance_of_a_mean_is_that_of_its_place_and_less_of_several() {
        let (with_trend, along) = along_the_trend(1.2);
        let place = |x, y| node(x, y, 1.0).point;
        let cases = [
            (SETTINGS, scattered(60), place(0.9, 0.7), place(-0.9, 0.7)),
            (
                with_trend,
                along,
                [0.0, 0.0, 0.0, 0.68, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.36, 0.0, 0.0],
            ),
        ];
        for (settings, nodes, a, b) in cases {
            let mut solver = BlockSolver::default();
            solver.fit(nodes.iter(), [0.0; 6], 0.7, &settings);
            let mut single = Vec::new();
            solver.variances_at(&[a, b], &mut single);
            let [of_a, of_b] = [a, b].map(|p| solver.variance_of_mean(&[p])[0]);
            assert!(
                (of_a / single[0][0] - 1.0).abs() < 0.03,
                "{of_a} {single:?}"
            );
            assert!(
                (of_b / single[1][0] - 1.0).abs() < 0.03,
                "{of_b} {single:?}"
            );
            // Far apart they know little of each other's error.
            let both = solver.variance_of_mean(&[a, b])[0];
            assert!(
                both < 0.9 * of_a.max(of_b) && both > 0.0,
                "{both} {of_a} {of_b}"
            );
        }
    }

    /// Solves a small dense system by elimination with pivots.
    fn gauss(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
        let n = b.len();
        for j in 0..n {
            let pivot = (j..n)
                .max_by(|x, y| a[*x][j].abs().total_cmp(&a[*y][j].abs()))
                .unwrap();
            a.swap(j, pivot);
            b.swap(j, pivot);
            for i in j + 1..n {
                let f = a[i][j] / a[j][j];
                for k in j..n {
                    a[i][k] -= f * a[j][k];
                }
                b[i] -= f * b[j];
            }
        }
        for j in (0..n).rev() {
            for k in j + 1..n {
                b[j] -= a[j][k] * b[k];
            }
            b[j] /= a[j][j];
        }
        b
    }

    #[test]
    fn duplicates_a_single_node_and_none_give_finite_values() {
        let mut solver = BlockSolver::default();
        let same = vec![node(0.2, 0.1, 1.0); 40];
        solver.fit(same.iter(), [0.0; 6], 0.0, &SETTINGS);
        let value = at(&solver, &same[0].point);
        assert!((value[0] - same[0].log_value[0]).abs() < 1e-3, "{value:?}");
        solver.fit(same[..1].iter(), [0.0; 6], 0.0, &SETTINGS);
        let value = at(&solver, &[1.0; 6]);
        assert!((value[0] - same[0].log_value[0]).abs() < 1e-3, "{value:?}");
        solver.fit(same[..0].iter(), [0.0; 6], 0.0, &SETTINGS);
        assert!(at(&solver, &[1.0; 6]).iter().all(|v| v.is_finite()));
    }

    #[test]
    fn far_from_its_nodes_a_block_does_not_run_away() {
        // A slope of 2 over nodes a tenth apart; the place is thirty radii away.
        let nodes: Vec<Node> = (0..20)
            .map(|k| {
                let mut node = node(0.1 * k as f32, 0.0, 1.0);
                node.log_value = [0.2 * k as f32; 3];
                node
            })
            .collect();
        let mut solver = BlockSolver::default();
        solver.fit(nodes.iter(), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, &SETTINGS);
        let between = at(&solver, &node(1.05, 0.0, 1.0).point)[0];
        assert!((between - 2.1).abs() < 0.05, "{between}");
        for x in [-4.0, 6.0, 30.0] {
            let far = at(&solver, &node(x, 0.0, 1.0).point)[0];
            assert!((-1.0..=4.8).contains(&far), "{x}: {far}");
        }
    }

    #[test]
    fn more_noise_means_a_larger_nugget_and_a_smoother_fit() {
        let nodes = scattered(100);
        let mut solver = BlockSolver::default();
        let quiet = solver.fit(nodes.iter(), [0.0; 6], 0.7, &SETTINGS);
        let noisy = BlockSettings {
            noise_variance: 0.4,
            ..SETTINGS
        };
        assert!(solver.fit(nodes.iter(), [0.0; 6], 0.7, &noisy) > 10.0 * quiet);
    }
}
