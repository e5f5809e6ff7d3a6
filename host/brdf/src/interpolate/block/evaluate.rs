//! The values of a fitted block.

use super::Process;
use super::distances::{CHAINS, Place, correlations, vectors};
use super::kernel::Kernel;
use crate::interpolate::coordinates::Point;
use pulp::{Simd, WithSimd};

/// Appends the logarithms at places, channel by channel.
pub(super) struct Evaluate<'a, K> {
    pub(super) kernel: &'a K,
    pub(super) process: &'a Process,
    pub(super) places: &'a [Point],
    pub(super) out: &'a mut Vec<[f32; 3]>,
}

impl<K: Kernel> WithSimd for Evaluate<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let s = self.process;
        let axes = vectors::<S>(&s.axes, &s.norms, 0..s.norms.len());
        let weights = [
            S::as_simd_f32s(&s.weights[0]).0,
            S::as_simd_f32s(&s.weights[1]).0,
            S::as_simd_f32s(&s.weights[2]).0,
        ];
        let in_middle = s.drift.at(&s.middle);
        for point in self.places {
            let mut place = Place::<S>::at_origin(simd);
            for k in 0..6 {
                place.set(simd, k, (point[k] - s.middle[k]) * s.scale[k]);
            }
            let mut sums = [simd.splat_f32s(0.0); 3];
            let mut r = 0;
            while r + CHAINS <= axes.norms.len() {
                let k = correlations::<K, S, CHAINS>(self.kernel, simd, &place, &axes, r);
                for g in 0..CHAINS {
                    for c in 0..3 {
                        sums[c] = simd.mul_add_e_f32s(k[g], weights[c][r + g], sums[c]);
                    }
                }
                r += CHAINS;
            }
            while r < axes.norms.len() {
                let [k] = correlations::<K, S, 1>(self.kernel, simd, &place, &axes, r);
                for c in 0..3 {
                    sums[c] = simd.mul_add_e_f32s(k, weights[c][r], sums[c]);
                }
                r += 1;
            }
            let drift = s.drift.at(point);
            let from_middle = drift - in_middle;
            let mut result = s.mean;
            for c in 0..3 {
                result[c] += simd.reduce_sum_f32s(sums[c]) + from_middle * s.slopes[c];
                let (low, high) = s.limits[c];
                result[c] = result[c].max(low).min(high) + drift;
            }
            self.out.push(result);
        }
    }
}
