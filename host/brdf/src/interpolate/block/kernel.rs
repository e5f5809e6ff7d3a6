//! The kernel: how two values of the interpolated process correlate, by their distance.
//!
//! The default method is kriging with [`Matern32`]. A kernel of one's own is a type that implements
//! [`Kernel`], and is handed over in [`FillSettings::kernel`](crate::interpolate::FillSettings::kernel); cross-validation, error bars and
//! fills then use it:
//!
//! ```
//! use gonia_brdf::interpolate::{FillSettings, Kernel};
//!
//! /// exp(−s): rougher than the default.
//! struct Exponential;
//!
//! impl Kernel for Exponential {
//!     fn name(&self) -> &str {
//!         "exponential"
//!     }
//!     fn correlation(&self, s: f32) -> f32 {
//!         (-s).exp()
//!     }
//! }
//!
//! let settings = FillSettings { kernel: &Exponential, ..FillSettings::DEFAULT };
//! assert!(settings.to_string().contains("exponential"));
//! ```

use super::{Block, KrigingBlock};
use crate::elementary::Elementary;
use nalgebra::RealField;
use pulp::Simd;
use pulp::bytemuck::cast_slice_mut;

/// A stationary correlation function, positive definite in six dimensions.
///
/// Only [`Self::name`] and [`Self::correlation`] must be written; blocks are compiled for each kernel by
/// itself, so that the call costs nothing.
pub trait Kernel: Send + Sync + 'static {
    /// Its name, for messages and files. Settings are equal when their kernels' names are.
    fn name(&self) -> &str;

    /// Correlation at the scaled distance `s` ≥ 0: 1 at 0, and falling.
    fn correlation(&self, s: f32) -> f32;

    /// The scaled distance is this times the distance over the range: 1 unless the kernel's own formula
    /// has another unit.
    fn scale(&self) -> f32 {
        1.0
    }

    /// The smallest range, in radii of the neighbourhood, with which [`Self::correlations`] is right at
    /// two radii, which is how far apart data can be. A smaller one is raised to it.
    fn range_min(&self) -> f32 {
        0.0
    }

    /// [`Self::correlation`] of `G` vectors of scaled distances. A kernel that needs speed has its own,
    /// without closures (they would be compiled without the instruction set).
    #[inline(always)]
    fn correlations<S: Simd, const G: usize>(&self, simd: S, s: [S::f32s; G]) -> [S::f32s; G]
    where
        Self: Sized,
    {
        let (_, mut values) = (simd, s);
        for value in cast_slice_mut::<S::f32s, f32>(&mut values) {
            *value = self.correlation(*value);
        }
        values
    }

    /// A block of this kernel: leave it as it is.
    fn block<const N: usize>(&'static self) -> Box<dyn Block<N>>
    where
        Self: Sized,
    {
        Box::new(KrigingBlock::new(self))
    }
}

/// Numbers of channels that are interpolated together: more of them share a factorisation, and a sum over the data
/// is written for each number by itself.
pub const WIDTHS: [usize; 3] = [1, 3, 31];

/// Makes blocks of so many channels.
pub trait NewBlock<const N: usize> {
    /// A block, not fitted to anything yet.
    fn new_block(&'static self) -> Box<dyn Block<N>>;
}

impl<K: Kernel, const N: usize> NewBlock<N> for K {
    fn new_block(&'static self) -> Box<dyn Block<N>> {
        self.block()
    }
}

/// Any [`Kernel`], as settings hold it: it makes blocks of all [`WIDTHS`].
pub trait AnyKernel: Kernel + NewBlock<1> + NewBlock<3> + NewBlock<31> {}

impl<K: Kernel> AnyKernel for K {}

impl PartialEq for dyn AnyKernel {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl std::fmt::Debug for dyn AnyKernel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Matérn 3/2, `(1 + s) e^{−s}` with `s = √3 distance / range`: processes that have a slope, and no
/// curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Matern32;

impl Matern32 {
    /// The formula itself, in any precision.
    #[inline(always)]
    pub fn of<T: RealField + Elementary>(s: T) -> T {
        (T::one() + s) * (-s).exponential()
    }
}

/// [`Matern32::correlations`] is constant beyond this. Data are within two radii of each other, so that s
/// stays below 0.5 with a range of 8 radii.
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

impl Kernel for Matern32 {
    fn name(&self) -> &str {
        "matern-3/2"
    }

    #[inline(always)]
    fn correlation(&self, s: f32) -> f32 {
        Self::of(s)
    }

    fn scale(&self) -> f32 {
        3f32.sqrt()
    }

    fn range_min(&self) -> f32 {
        2.0 * self.scale() / S_MAX
    }

    #[inline(always)]
    fn correlations<S: Simd, const G: usize>(&self, simd: S, s: [S::f32s; G]) -> [S::f32s; G] {
        let mut s = s;
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

    /// Not inherited: here it is compiled once, and not again in each crate that uses the default.
    #[inline(never)]
    fn block<const N: usize>(&'static self) -> Box<dyn Block<N>> {
        Box::new(KrigingBlock::new(self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    struct Correlations<K>(K, Vec<f32>);

    impl<K: Kernel> WithSimd for Correlations<K> {
        type Output = Vec<f32>;

        #[inline(always)]
        fn with_simd<S: Simd>(mut self, simd: S) -> Vec<f32> {
            for s in S::as_mut_simd_f32s(&mut self.1).0 {
                [*s] = self.0.correlations(simd, [*s]);
            }
            self.1
        }
    }

    /// e^{−s}, without vectors of its own.
    #[derive(Clone, Copy)]
    struct Exponential;

    impl Kernel for Exponential {
        fn name(&self) -> &str {
            "exponential"
        }
        fn correlation(&self, s: f32) -> f32 {
            (-s).exponential()
        }
    }

    fn largest_difference<K: Kernel + Copy>(kernel: K) -> f32 {
        let distances: Vec<f32> = (0..=96).map(|k| k as f32 / 96.0).take(96).collect();
        let wide = Arch::new().dispatch(Correlations(kernel, distances.clone()));
        let narrow = Correlations(kernel, distances.clone()).with_simd(pulp::Scalar);
        let pairs = distances.iter().zip(wide.iter().zip(&narrow));
        pairs.fold(0.0f32, |m, (s, (a, b))| {
            let expected = kernel.correlation(*s);
            m.max((a - expected).abs()).max((b - expected).abs())
        })
    }

    #[test]
    fn vectors_give_what_single_numbers_give() {
        assert!(largest_difference(Matern32) < 4e-7);
        assert_eq!(largest_difference(Exponential), 0.0);
    }

    #[test]
    fn with_the_smallest_range_data_two_radii_apart_are_within_the_polynomial() {
        assert!((2.0 * Matern32.scale() / Matern32.range_min() - S_MAX).abs() < 1e-6);
        assert!((f64::from(Matern32.correlation(0.5)) - Matern32::of(0.5f64)).abs() < 1e-6);
    }
}
