//! Radial basis functions through the neighbours, with a polynomial tail:
//! f(x) = Σ wⱼ φ(|x − xⱼ|) + p(x), where Σ wⱼ q(xⱼ) = 0 for every polynomial q of the tail's degree.
//!
//! (Φ + λ I) w + P c = y, Pᵀ w = 0; one factorisation for all channels. The nugget λ smooths, and
//! makes solvable what is not: the paper's own systems are singular wherever nodes coincide. The
//! same system, with the same meaning of λ, as that of scipy's `RBFInterpolator`.

use super::basis::BasisFunction;
use super::{Failure, Interpolant, Neighbourhood, System};

/// An interpolant by radial basis functions.
pub struct Rbf {
    /// The basis function.
    pub kernel: BasisFunction,
    /// Its length in radii of the neighbourhood; of no consequence to kernels that have none.
    pub length: f64,
    /// λ, added to the diagonal.
    pub nugget: f64,
}

impl Interpolant for Rbf {
    fn estimate(&self, near: &Neighbourhood, system: &mut System) -> Result<[f64; 3], Failure> {
        let n = near.offsets.len();
        let tail = if self.kernel.tail_degree() == 0 { 1 } else { 7 };
        if n < tail {
            return Err(Failure::TooFew {
                have: n,
                need: tail,
            });
        }
        let radius = near.radius().max(f64::MIN_POSITIVE);
        let length = self.length * radius;
        system.begin(n + tail);
        let matrix = system.matrix_mut();
        for j in 0..n {
            let a = &near.offsets[j];
            matrix[(j, j)] = self.kernel.value(0.0, length) + self.nugget;
            for i in j + 1..n {
                let b = &near.offsets[i];
                let r2: f64 = (0..6).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum();
                let value = self.kernel.value(r2.sqrt(), length);
                matrix[(i, j)] = value;
                matrix[(j, i)] = value;
            }
            for t in 0..tail {
                // 1, then the offsets in radii: the unit changes nothing but the rounding.
                let value = if t == 0 { 1.0 } else { a[t - 1] / radius };
                matrix[(n + t, j)] = value;
                matrix[(j, n + t)] = value;
            }
        }
        let rhs = system.rhs_mut();
        for (j, value) in near.values.iter().enumerate() {
            for c in 0..3 {
                rhs[(j, c)] = value[c];
            }
        }
        let solution = system.solve()?;
        // Offsets are zero at the place, so of the tail only the constant is left.
        let mut sum = [0, 1, 2].map(|c| solution[(n, c)]);
        for (j, distance) in near.distances.iter().enumerate() {
            let value = self.kernel.value(*distance, length);
            for c in 0..3 {
                sum[c] += value * solution[(j, c)];
            }
        }
        Ok(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elementary::Elementary;
    use nalgebra::{DMatrix, DVector};

    /// Evenly scattered in six dimensions, all within a radius of about 1.
    fn scattered(n: usize) -> Neighbourhood {
        let mut near = Neighbourhood::default();
        let steps = [0.8987, 0.8077, 0.7259, 0.6524, 0.5863, 0.5269];
        for k in 1..=n {
            let at = steps.map(|a| (k as f64 * a).fract() - 0.5);
            let value = (2.0 * at[0]).sine() + at[3] * at[4];
            near.push(at, [value, 1.0 + value, -3.0 * value]);
        }
        near
    }

    /// Universal kriging: a predictor that is unbiased for a constant and of least variance, by a
    /// Cholesky factor of the kernel shifted until it is positive definite, and the value found
    /// from weights of the data instead of weights of the kernels. Another way to the same number.
    fn kriging(near: &Neighbourhood, nugget: f64) -> [f64; 3] {
        let n = near.offsets.len();
        let between =
            |a: &[f64; 6], b: &[f64; 6]| (0..6).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        let shift = 100.0;
        let matrix = DMatrix::from_fn(n, n, |i, j| {
            shift - between(&near.offsets[i], &near.offsets[j]) + if i == j { nugget } else { 0.0 }
        });
        let cholesky = matrix.cholesky().unwrap();
        let to_place = DVector::from_fn(n, |i, _| shift - between(&near.offsets[i], &[0.0; 6]));
        let ones = DVector::repeat(n, 1.0);
        let (a, b) = (cholesky.solve(&to_place), cholesky.solve(&ones));
        let lagrange = (1.0 - a.sum()) / b.sum();
        let weights = a + b * lagrange;
        [0, 1, 2].map(|c| (0..n).map(|i| weights[i] * near.values[i][c]).sum())
    }

    #[test]
    fn linear_functions_with_a_constant_tail_are_kriging() {
        let mut system = System::default();
        for (n, nugget) in [(8, 0.0), (60, 1e-3), (200, 1e-3), (200, 0.1)] {
            let near = scattered(n);
            let rbf = Rbf {
                kernel: BasisFunction::Linear,
                length: 1.0,
                nugget,
            };
            let got = rbf.estimate(&near, &mut system).unwrap();
            let expected = kriging(&near, nugget);
            for c in 0..3 {
                assert!(
                    (got[c] - expected[c]).abs() < 1e-9,
                    "{n}: {got:?} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn without_a_nugget_nodes_keep_their_values_and_with_one_they_need_not() {
        let mut system = System::default();
        for kernel in BasisFunction::ALL {
            let mut near = scattered(40);
            let at = near.offsets[7];
            let value = near.values[7];
            for (offset, distance) in near.offsets.iter_mut().zip(&mut near.distances) {
                *offset = std::array::from_fn(|k| offset[k] - at[k]);
                *distance = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
            }
            let mut rbf = Rbf {
                kernel,
                length: 1.0,
                nugget: 0.0,
            };
            let exact = rbf.estimate(&near, &mut system).unwrap();
            assert!((exact[0] - value[0]).abs() < 1e-6, "{kernel:?}");
            rbf.nugget = 0.5;
            let smooth = rbf.estimate(&near, &mut system).unwrap();
            assert!((smooth[0] - value[0]).abs() > 1e-3, "{kernel:?}");
        }
    }

    #[test]
    fn coinciding_nodes_are_singular_without_a_nugget_and_solved_with_one() {
        let mut near = scattered(30);
        near.push(near.offsets[4], near.values[4]);
        let mut system = System::measuring_condition();
        let mut rbf = Rbf {
            kernel: BasisFunction::Linear,
            length: 1.0,
            nugget: 0.0,
        };
        assert_eq!(rbf.estimate(&near, &mut system), Err(Failure::Singular));
        assert!(system.condition().is_some_and(|c| c > 1e15));
        rbf.nugget = 1e-3;
        assert!(rbf.estimate(&near, &mut system).is_ok());
        assert!(system.condition().is_some_and(|c| c < 1e7));
    }

    #[test]
    fn a_tail_needs_as_many_neighbours_as_it_has_terms() {
        let rbf = Rbf {
            kernel: BasisFunction::Cubic,
            length: 1.0,
            nugget: 1e-3,
        };
        let got = rbf.estimate(&scattered(6), &mut System::default());
        assert_eq!(got, Err(Failure::TooFew { have: 6, need: 7 }));
    }
}
