//! From logarithms to values, many at a time: what the mathematical library does one by one took a
//! twentieth of a fill.

use pulp::{Arch, Simd, WithSimd};

/// e^±60 are far beyond any BRDF and far within single precision.
const LARGEST: f32 = 60.0;
/// Bits of a number whose last place is 1: what is added to it is rounded to a whole number, which stands
/// in its low bits.
const WHOLE: f32 = 12_582_912.0;
/// ln 2 in two parts, the first short enough that its products with whole numbers up to 127 are exact.
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
/// 1 / k! from k = 7 down: within ±ln 2 / 2 the next term is below 1e-8.
const TAYLOR: [f32; 8] = [
    1.0 / 5040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// Replaces natural logarithms, one per channel, by what they are the logarithms of, e^−60 ..= e^60;
/// relative error below 3e-7. The same number gives the same result wherever it stands.
pub fn exponentials<const N: usize>(arch: Arch, logs: &mut [[f32; N]]) {
    arch.dispatch(Exponentials(logs.as_flattened_mut()));
}

struct Exponentials<'a>(&'a mut [f32]);

impl WithSimd for Exponentials<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (whole, rest) = S::as_mut_simd_f32s(self.0);
        for x in whole {
            *x = exponential(simd, *x);
        }
        let last = exponential(simd, simd.partial_load_f32s(rest));
        simd.partial_store_f32s(rest, last);
    }
}

#[inline(always)]
fn exponential<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    let largest = simd.splat_f32s(LARGEST);
    let x = simd.max_f32s(simd.min_f32s(x, largest), simd.neg_f32s(largest));
    let magic = simd.splat_f32s(WHOLE);
    let shifted = simd.mul_add_e_f32s(x, simd.splat_f32s(std::f32::consts::LOG2_E), magic);
    let halvings = simd.neg_f32s(simd.sub_f32s(shifted, magic));
    let x = simd.mul_add_e_f32s(halvings, simd.splat_f32s(LN_2[0]), x);
    let x = simd.mul_add_e_f32s(halvings, simd.splat_f32s(LN_2[1]), x);
    let mut e = simd.splat_f32s(TAYLOR[0]);
    for coefficient in &TAYLOR[1..] {
        e = simd.mul_add_e_f32s(e, x, simd.splat_f32s(*coefficient));
    }
    // The whole number becomes an exponent.
    let bias = simd.splat_u32s(127u32.wrapping_sub(WHOLE.to_bits()));
    let exponent = simd.add_u32s(simd.transmute_u32s_f32s(shifted), bias);
    let exponent = simd.wrapping_dyn_shl_u32s(exponent, simd.splat_u32s(23));
    simd.mul_f32s(e, simd.transmute_f32s_u32s(exponent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elementary::Elementary;

    #[test]
    fn exponentials_are_right_to_single_precision_and_bounded() {
        for n in [1, 2, 5, 6, 1000] {
            let logs: Vec<[f32; 3]> = (0..n)
                .map(|k| [-70.0, 0.0, 1e-3].map(|from| from + 140.0 * k as f32 / n as f32))
                .collect();
            for simd in [true, false] {
                let mut values = logs.clone();
                if simd {
                    exponentials(Arch::new(), &mut values);
                } else {
                    Exponentials(values.as_flattened_mut()).with_simd(pulp::Scalar);
                }
                for (value, log) in values.as_flattened().iter().zip(logs.as_flattened()) {
                    let truth = f64::from(*log).clamp(-60.0, 60.0).exponential();
                    let off = f64::from(*value) / truth - 1.0;
                    assert!(off.abs() < 3e-7, "{log}: {off}");
                }
            }
        }
    }

    #[test]
    fn infinite_logarithms_give_finite_values() {
        let mut values = [[f32::INFINITY, f32::NEG_INFINITY, 0.0]];
        exponentials(Arch::new(), &mut values);
        assert!(values[0].iter().all(|v| *v > 0.0 && v.is_finite()) && values[0][2] == 1.0);
    }
}
