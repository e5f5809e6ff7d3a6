//! Scaled distances from a place to the data, a vector of them at a time, and the kernel of these.

use super::kernel::Kernel;
use pulp::Simd;

#[derive(Clone, Copy)]
pub(super) struct Place<S: Simd> {
    minus_twice: [S::f32s; 6],
    norm: f32,
}

impl<S: Simd> Place<S> {
    #[inline(always)]
    pub(super) fn at_origin(simd: S) -> Self {
        Self {
            minus_twice: [simd.splat_f32s(0.0); 6],
            norm: 0.0,
        }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, simd: S, axis: usize, x: f32) {
        self.minus_twice[axis] = simd.splat_f32s(-2.0 * x);
        self.norm += x * x;
    }
}

/// A range of the data' coordinates as vectors.
pub(super) struct Axes<'a, S: Simd> {
    pub(super) axes: [&'a [S::f32s]; 6],
    pub(super) norms: &'a [S::f32s],
}

/// Spelt out, like all that is below `with_simd`: a closure there would be compiled without the
/// instruction set.
#[inline(always)]
pub(super) fn vectors<'a, S: Simd>(
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
pub(super) const CHAINS: usize = 4;

/// The kernel of the scaled distances from a place to vectors `r..r + G` of the data.
#[inline(always)]
pub(super) fn correlations<K: Kernel, S: Simd, const G: usize>(
    kernel: &K,
    simd: S,
    place: &Place<S>,
    data: &Axes<'_, S>,
    r: usize,
) -> [S::f32s; G] {
    let norm = simd.splat_f32s(place.norm);
    let mut s2 = [norm; G];
    for g in 0..G {
        s2[g] = simd.add_f32s(data.norms[r + g], norm);
    }
    for k in 0..6 {
        for g in 0..G {
            s2[g] = simd.mul_add_e_f32s(data.axes[k][r + g], place.minus_twice[k], s2[g]);
        }
    }
    let tiny = simd.splat_f32s(1e-12);
    for g in 0..G {
        s2[g] = simd.max_f32s(s2[g], tiny);
    }
    kernel.correlations(simd, roots(simd, s2))
}

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
