//! The values of a fitted block.

use super::Process;
use super::distances::{Axes, CHAINS, Place, correlations, vectors};
use super::kernel::Kernel;
use crate::interpolate::coordinates::Point;
use pulp::{Simd, WithSimd};

/// Appends the logarithms at places, channel by channel.
pub(super) struct Evaluate<'a, K, const N: usize> {
    pub(super) kernel: &'a K,
    pub(super) process: &'a Process<N>,
    pub(super) places: &'a [Point],
    pub(super) out: &'a mut Vec<[f32; N]>,
}

impl<K: Kernel, const N: usize> WithSimd for Evaluate<'_, K, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let s = self.process;
        let axes = vectors::<S>(&s.axes, &s.norms, 0..s.norms.len());
        let mut row = Vec::new();
        let in_middle = s.drift.at(&s.middle);
        for point in self.places {
            let mut place = Place::<S>::at_origin(simd);
            for k in 0..6 {
                place.set(simd, k, (point[k] - s.middle[k]) * s.scale[k]);
            }
            let sums = if N <= FEW {
                together::<K, S, N>(self.kernel, simd, &place, &axes, &s.weights)
            } else {
                in_groups::<K, S, N>(self.kernel, simd, &place, &axes, &s.weights, &mut row)
            };
            let drift = s.drift.at(point);
            let from_middle = drift - in_middle;
            let mut result = s.mean;
            for c in 0..N {
                result[c] += simd.reduce_sum_f32s(sums[c]) + from_middle * s.slopes[c];
                let (low, high) = s.limits[c];
                result[c] = result[c].max(low).min(high) + drift;
            }
            self.out.push(result);
        }
    }
}

/// So many channels' sums stay in registers beside the kernel's own numbers.
const FEW: usize = 4;
/// Channels of a group, where there are more.
const GROUP: usize = 8;

/// Of each channel the sum over the data of the kernel times the weights, in the lanes.
#[inline(always)]
fn together<K: Kernel, S: Simd, const N: usize>(
    kernel: &K,
    simd: S,
    place: &Place<S>,
    axes: &Axes<'_, S>,
    weights: &[Vec<f32>; N],
) -> [S::f32s; N] {
    let mut columns = [&[][..]; N];
    for c in 0..N {
        columns[c] = S::as_simd_f32s(&weights[c]).0;
    }
    let mut sums = [simd.splat_f32s(0.0); N];
    let mut r = 0;
    while r + CHAINS <= axes.norms.len() {
        let k = correlations::<K, S, CHAINS>(kernel, simd, place, axes, r);
        for g in 0..CHAINS {
            for c in 0..N {
                sums[c] = simd.mul_add_e_f32s(k[g], columns[c][r + g], sums[c]);
            }
        }
        r += CHAINS;
    }
    while r < axes.norms.len() {
        let [k] = correlations::<K, S, 1>(kernel, simd, place, axes, r);
        for c in 0..N {
            sums[c] = simd.mul_add_e_f32s(k, columns[c][r], sums[c]);
        }
        r += 1;
    }
    sums
}

/// The same of many channels: the kernel is kept in `row`, and a group of channels at a time goes through it. The
/// last group takes channels of the one before again, so that all are of one size.
#[inline(always)]
fn in_groups<K: Kernel, S: Simd, const N: usize>(
    kernel: &K,
    simd: S,
    place: &Place<S>,
    axes: &Axes<'_, S>,
    weights: &[Vec<f32>; N],
    row: &mut Vec<S::f32s>,
) -> [S::f32s; N] {
    let length = axes.norms.len();
    row.resize(length, simd.splat_f32s(0.0));
    let mut r = 0;
    while r + CHAINS <= length {
        let k = correlations::<K, S, CHAINS>(kernel, simd, place, axes, r);
        row[r..r + CHAINS].copy_from_slice(&k);
        r += CHAINS;
    }
    while r < length {
        let [k] = correlations::<K, S, 1>(kernel, simd, place, axes, r);
        row[r] = k;
        r += 1;
    }
    let mut sums = [simd.splat_f32s(0.0); N];
    let group = GROUP.min(N);
    let mut first = 0;
    while first < N {
        let from = first.min(N - group);
        let mut part = [simd.splat_f32s(0.0); GROUP];
        let mut columns = [&[][..]; GROUP];
        for c in 0..group {
            columns[c] = &S::as_simd_f32s(&weights[from + c]).0[..length];
        }
        for (r, k) in row.iter().enumerate() {
            for c in 0..GROUP {
                if c < group {
                    part[c] = simd.mul_add_e_f32s(*k, columns[c][r], part[c]);
                }
            }
        }
        sums[from..from + group].copy_from_slice(&part[..group]);
        first += group;
    }
    sums
}
