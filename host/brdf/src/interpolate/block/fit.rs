//! Fitting one block: the kernel matrix, its factor, and the weights.

use super::distances::{CHAINS, Place, correlations, vectors};
use super::kernel::Kernel;
use super::{BlockSettings, COUNT_MIN, PAD, Process};
use pulp::{Simd, WithSimd};

/// Fits a process to the data that it has loaded.
pub(super) struct Fit<'a, K, const N: usize> {
    pub(super) kernel: &'a K,
    pub(super) process: &'a mut Process<N>,
    pub(super) n: usize,
    pub(super) padded: usize,
    pub(super) settings: &'a BlockSettings,
    /// The one to use, where a smaller one failed.
    pub(super) nugget: Option<f32>,
}

impl<K: Kernel, const N: usize> WithSimd for Fit<'_, K, N> {
    /// The nugget used, or the one that failed.
    type Output = Result<f32, f32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let (n, padded) = (self.n, self.padded);
        let s = self.process;
        // A right-hand side a channel, and the constant's.
        s.matrix
            .resize(padded, padded + (N + 1).next_multiple_of(PAD));
        let correlations = s.fill_matrix(self.kernel, simd, n, padded);
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
        s.add_drift(signal, n);
        if !s.matrix.factor(simd, padded) {
            return Err(nugget);
        }
        s.solve_back(simd, n, padded);
        s.n = n;
        Ok(nugget)
    }
}

impl<const N: usize> Process<N> {
    /// The kernel matrix, padded by the unit matrix, with the right-hand sides below. Returns the
    /// sum of the correlations of all pairs.
    #[inline(always)]
    fn fill_matrix<K: Kernel, S: Simd>(
        &mut self,
        kernel: &K,
        simd: S,
        n: usize,
        padded: usize,
    ) -> f32 {
        // The matrix is symmetric: the squares on its diagonal hold each pair twice, and each datum with
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
                let k = correlations::<K, S, CHAINS>(kernel, simd, &place, &axes, r);
                for g in 0..CHAINS {
                    target[r + g] = k[g];
                    below = simd.add_f32s(below, k[g]);
                }
                r += CHAINS;
            }
            while r < target.len() {
                let [k] = correlations::<K, S, 1>(kernel, simd, &place, &axes, r);
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
            for c in 0..N {
                column[padded + c] = self.log_values[c][j];
            }
            column[padded + N] = 1.0;
        }
        for j in n..padded {
            let column = self.matrix.column_mut(j);
            column.fill(0.0);
            column[j] = 1.0;
        }
        let squares = simd.reduce_sum_f32s(square) + n as f32;
        simd.reduce_sum_f32s(below) - 0.5 * squares - surplus
    }

    /// Adds what the data share by their drift, whose slope differs from block to block.
    #[inline(always)]
    fn add_drift(&mut self, signal: f32, n: usize) {
        let largest = self.drifts.iter().fold(0.0f32, |m, t| m.max(t * t));
        let spread = SLOPE_SPREAD * SLOPE_SPREAD / signal;
        self.slope_variance = spread.min(SLOPE_MAX / largest.max(f32::MIN_POSITIVE));
        if self.slope_variance * largest < SLOPE_MIN {
            self.slope_variance = 0.0;
            return;
        }
        for j in 0..n {
            let factor = self.slope_variance * self.drifts[j];
            let column = &mut self.matrix.column_mut(j)[j..n];
            for (entry, drift) in column.iter_mut().zip(&self.drifts[j..n]) {
                *entry += factor * drift;
            }
        }
    }

    /// Variance of the data' values, mean over the channels, and the share of it that is noise.
    fn variances(&self, n: usize, settings: &BlockSettings) -> (f32, f32) {
        let mut variance = 0.0;
        for values in &self.log_values {
            let (mut sum, mut squares) = (0.0f64, 0.0f64);
            for value in &values[..n] {
                sum += f64::from(*value);
                squares += f64::from(*value) * f64::from(*value);
            }
            variance += (squares - sum * sum / n as f64).max(0.0) / (N * (n - 1)) as f64;
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
        let (mut with_ones, mut of_ones) = ([0.0f32; N], 0.0f32);
        for j in 0..n {
            let z = &self.matrix.column(j)[padded..=padded + N];
            for k in 0..N {
                with_ones[k] += z[N] * z[k];
            }
            of_ones += z[N] * z[N];
        }
        for c in 0..N {
            self.mean[c] = with_ones[c] / of_ones;
        }
        // (y − μ)ᵀ K⁻¹ (y − μ) / n.
        let mut squares = [0.0f32; N];
        for j in 0..n {
            let z = &self.matrix.column(j)[padded..=padded + N];
            for c in 0..N {
                squares[c] += (z[c] - self.mean[c] * z[N]).powi(2);
            }
        }
        for c in 0..N {
            self.signal[c] = squares[c] / n as f32;
        }
        // Some columns at a time: first what the rows below take from them, which none of them waits for, then
        // the small triangle that is left.
        let lanes = S::F32_LANES;
        for from in (0..n).step_by(lanes).rev() {
            let to = (from + lanes).min(n);
            let mut left = [[0.0f32; N]; PAD];
            for j in from..to {
                let column = self.matrix.column(j);
                let below = (from + lanes).min(padded);
                let (l, _) = S::as_simd_f32s(&column[below..padded]);
                let mut dots = [simd.splat_f32s(0.0); N];
                for c in 0..N {
                    let (w, _) = S::as_simd_f32s(&self.weights[c][below..padded]);
                    for (a, b) in l.iter().zip(w) {
                        dots[c] = simd.mul_add_e_f32s(*a, *b, dots[c]);
                    }
                }
                let z = &column[padded..=padded + N];
                for c in 0..N {
                    let dot = simd.reduce_sum_f32s(dots[c]);
                    left[j - from][c] = z[c] - self.mean[c] * z[N] - dot;
                }
            }
            for j in (from..to).rev() {
                let inverse = 1.0 / self.matrix.column(j)[j];
                let weights = left[j - from].map(|x| x * inverse);
                for c in 0..N {
                    self.weights[c][j] = weights[c];
                }
                for i in from..j {
                    let l = self.matrix.column(i)[j];
                    for c in 0..N {
                        left[i - from][c] -= l * weights[c];
                    }
                }
            }
        }
        for c in 0..N {
            let pairs = self.weights[c].iter().zip(&self.drifts);
            self.slopes[c] = self.slope_variance * pairs.map(|(w, t)| w * t).sum::<f32>();
        }
    }
}

/// Standard deviation of the drift's slope from block to block: it is 0 where a base makes the value, and
/// some 1 in a lobe.
const SLOPE_SPREAD: f32 = 0.5;
/// The variance that the slope makes, over that of the process, is at most this (single precision bears no
/// more, and the slope is as free as it would be with more) …
const SLOPE_MAX: f32 = 4.0;
/// … and below this left out.
const SLOPE_MIN: f32 = 1e-3;
