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

/// Vectors of places that are solved together …
const TOGETHER: usize = 2;
/// … for four rows of the factor at a time, or one for eight: eight sums stay in registers, and none waits for another.
const SUMS: usize = 8;

/// Appends the variances at places, channel by channel.
pub(super) struct Variance<'a, K, const N: usize> {
    pub(super) kernel: &'a K,
    pub(super) process: &'a mut Process<N>,
    pub(super) places: &'a [Point],
    pub(super) out: &'a mut Vec<[f32; N]>,
}

impl<K: Kernel, const N: usize> WithSimd for Variance<'_, K, N> {
    type Output = ();

    /// Places in the lanes: `u = L⁻¹ k` for vectors of places at once; then `1 − uᵀu + (1 − zᵀu)² / zᵀz` with
    /// `z = L⁻¹ 1`, the last term for the unknown mean.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let s = self.process;
        let ones = s.norms.len() + N;
        let mut zz = 0.0f32;
        for j in 0..s.n {
            zz += s.matrix.column(j)[ones].powi(2);
        }
        let wide = TOGETHER * S::F32_LANES;
        let rest = self.places.len() % wide;
        let (many, few) = self.places.split_at(self.places.len() - rest);
        for places in many.chunks_exact(wide) {
            variances::<K, S, N, { SUMS / TOGETHER }, TOGETHER>(
                self.kernel,
                simd,
                s,
                places,
                zz,
                self.out,
            );
        }
        for places in few.chunks(S::F32_LANES) {
            variances::<K, S, N, SUMS, 1>(self.kernel, simd, s, places, zz, self.out);
        }
    }
}

/// Appends the variances at no more places than `P` vectors hold, by `R` rows of the factor at a time.
#[inline(always)]
fn variances<K: Kernel, S: Simd, const N: usize, const R: usize, const P: usize>(
    kernel: &K,
    simd: S,
    s: &mut Process<N>,
    places: &[Point],
    zz: f32,
    out: &mut Vec<[f32; N]>,
) {
    let (n, lanes) = (s.n, P * S::F32_LANES);
    // The factor is padded by the unit matrix, and so are its right-hand sides by zeros.
    let padded = s.norms.len();
    let ones = padded + N;
    s.columns.clear();
    s.columns.resize(padded * lanes, 0.0);
    // Coordinates of the places, axis by axis, their squared lengths, and the drift.
    let mut buffer = [[0.0f32; TOGETHER * PAD]; 8];
    let in_middle = s.drift.at(&s.middle);
    for (lane, point) in places.iter().enumerate() {
        buffer[7][lane] = s.drift.at(point) - in_middle;
        for k in 0..6 {
            let x = (point[k] - s.middle[k]) * s.scale[k];
            buffer[k][lane] = x;
            buffer[6][lane] += x * x;
        }
    }
    let axes = Axes::<S> {
        axes: [
            S::as_simd_f32s(&buffer[0]).0,
            S::as_simd_f32s(&buffer[1]).0,
            S::as_simd_f32s(&buffer[2]).0,
            S::as_simd_f32s(&buffer[3]).0,
            S::as_simd_f32s(&buffer[4]).0,
            S::as_simd_f32s(&buffer[5]).0,
        ],
        norms: S::as_simd_f32s(&buffer[6]).0,
    };
    let (drifts, _) = S::as_simd_f32s(&buffer[7]);
    let (u, _) = S::as_mut_simd_f32s(&mut s.columns);
    let (u, _) = u.as_chunks_mut::<P>();
    for j in 0..n {
        let mut datum = Place::<S>::at_origin(simd);
        for k in 0..6 {
            datum.set(simd, k, s.axes[k][j]);
        }
        let slope = simd.splat_f32s(s.slope_variance * s.drifts[j]);
        let k = correlations::<K, S, P>(kernel, simd, &datum, &axes, 0);
        for p in 0..P {
            u[j][p] = simd.mul_add_e_f32s(slope, drifts[p], k[p]);
        }
    }
    s.matrix.solve::<S, R, P>(simd, padded, u);
    let mut sums = [[simd.splat_f32s(0.0); P]; 2];
    for j in 0..n {
        let one = simd.splat_f32s(s.matrix.column(j)[ones]);
        for p in 0..P {
            sums[0][p] = simd.mul_add_e_f32s(u[j][p], u[j][p], sums[0][p]);
            sums[1][p] = simd.mul_add_e_f32s(u[j][p], one, sums[1][p]);
        }
    }
    let mut found = [[0.0f32; TOGETHER * PAD]; 2];
    for k in 0..2 {
        let (vectors, _) = S::as_mut_simd_f32s(&mut found[k]);
        vectors[..P].copy_from_slice(&sums[k]);
    }
    for lane in 0..places.len() {
        let own = 1.0 + s.slope_variance * buffer[7][lane].powi(2);
        let kriging = kriging_variance(own, found[0][lane], found[1][lane], zz);
        out.push(s.signal.map(|signal| signal * kriging));
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
