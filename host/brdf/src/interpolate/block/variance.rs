//! The variance of a fitted block about the truth.

use super::PAD;
use super::Process;
use super::distances::{Axes, Place, correlations};
use super::kernel::Kernel;
use crate::interpolate::coordinates::{Point, distance2};
use pulp::{Simd, WithSimd};

/// The variance of ordinary kriging over that of the process: `own` that of what is predicted, `uu`
/// what the data tell of it (uᵀu, `u = L⁻¹ k`), the last term for the unknown mean (`z = L⁻¹ 1`).
#[inline(always)]
fn kriging_variance(own: f32, uu: f32, zu: f32, zz: f32) -> f32 {
    (own - uu).max(0.0) + (1.0 - zu).powi(2) / zz.max(1e-12)
}

/// Appends the variances at places, channel by channel.
pub(super) struct Variance<'a, K, const N: usize> {
    pub(super) kernel: &'a K,
    pub(super) process: &'a mut Process<N>,
    pub(super) places: &'a [Point],
    pub(super) out: &'a mut Vec<[f32; N]>,
}

impl<K: Kernel, const N: usize> WithSimd for Variance<'_, K, N> {
    type Output = ();

    /// Places in the lanes: `u = L⁻¹ k`, column by column of L, for a vector of places at once; then
    /// `1 − uᵀu + (1 − zᵀu)² / zᵀz` with `z = L⁻¹ 1`, the last term for the unknown mean.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let s = self.process;
        let (n, lanes) = (s.n, S::F32_LANES);
        let ones = s.norms.len() + N;
        let mut zz = 0.0f32;
        for j in 0..n {
            zz += s.matrix.column(j)[ones].powi(2);
        }
        s.columns.resize(n * lanes, 0.0);
        // Coordinates of the places, axis by axis, and their squared lengths, in seven vectors.
        let mut buffer = [0.0f32; 8 * PAD];
        let in_middle = s.drift.at(&s.middle);
        for places in self.places.chunks(lanes) {
            buffer.fill(0.0);
            for (lane, point) in places.iter().enumerate() {
                buffer[7 * lanes + lane] = s.drift.at(point) - in_middle;
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
                let mut datum = Place::<S>::at_origin(simd);
                for k in 0..6 {
                    datum.set(simd, k, s.axes[k][j]);
                }
                let slope = simd.splat_f32s(s.slope_variance * s.drifts[j]);
                let [k] = correlations::<K, S, 1>(self.kernel, simd, &datum, &axes, 0);
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
                let kriging = kriging_variance(own, uu, zu, zz);
                let mut variance = s.signal;
                for c in 0..N {
                    variance[c] *= kriging;
                }
                self.out.push(variance);
            }
        }
    }
}

impl<const N: usize> Process<N> {
    /// The variance of the mean over some places. All of them are one column of covariances, where
    /// [`Variance`] has one a place.
    pub(super) fn variance_of_mean(&self, kernel: &impl Kernel, places: &[Point]) -> [f32; N] {
        let share = 1.0 / places.len() as f32;
        let in_middle = self.drift.at(&self.middle);
        let drift = share
            * places
                .iter()
                .map(|p| self.drift.at(p) - in_middle)
                .sum::<f32>();
        let scaled: Vec<Point> = places
            .iter()
            .map(|p| std::array::from_fn(|k| (p[k] - self.middle[k]) * self.scale[k]))
            .collect();
        let correlation = |a: &Point, b: &Point| kernel.correlation(distance2(a, b).sqrt());
        let mut own = self.slope_variance * drift * drift;
        for a in &scaled {
            for b in &scaled {
                own += share * share * correlation(a, b);
            }
        }
        let mut u: Vec<f32> = (0..self.n)
            .map(|j| {
                let datum: Point = std::array::from_fn(|k| self.axes[k][j]);
                let sum: f32 = scaled.iter().map(|p| correlation(p, &datum)).sum();
                share * sum + self.slope_variance * self.drifts[j] * drift
            })
            .collect();
        let ones = self.norms.len() + N;
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
        let kriging = kriging_variance(own, uu, zu, zz);
        self.signal.map(|signal| signal * kriging)
    }
}
