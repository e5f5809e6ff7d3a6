//! Symmetric systems of equations with a right-hand side per channel.

use super::Failure;
use nalgebra::{DMatrix, DVector, Dyn, LU};

/// Right-hand sides: the channels.
const CHANNELS: usize = 3;
/// Steps that the estimate of the condition number takes at most; two or three are usual.
const CONDITION_STEPS: usize = 5;

/// A symmetric system, built, solved, and built again by one thread. Indefinite ones are allowed:
/// the constraints of a polynomial tail make them so.
pub struct System {
    matrix: DMatrix<f64>,
    rhs: DMatrix<f64>,
    measures_condition: bool,
    condition: Option<f64>,
}

impl Default for System {
    fn default() -> Self {
        Self {
            matrix: DMatrix::zeros(0, 0),
            rhs: DMatrix::zeros(0, CHANNELS),
            measures_condition: false,
            condition: None,
        }
    }
}

impl System {
    /// A system that estimates its condition number whenever it is solved.
    pub fn measuring_condition() -> Self {
        Self {
            measures_condition: true,
            ..Self::default()
        }
    }

    /// The condition number in the 1-norm of the last system solved (infinite when singular);
    /// `None` when none was solved, or it was not asked for.
    pub fn condition(&self) -> Option<f64> {
        self.condition
    }

    /// Forgets the condition number of an earlier system.
    pub(super) fn forget(&mut self) {
        self.condition = None;
    }

    /// Begins a system of `n` equations, all zero.
    pub(super) fn begin(&mut self, n: usize) {
        self.matrix = DMatrix::zeros(n, n);
        self.rhs = DMatrix::zeros(n, CHANNELS);
    }

    /// The matrix. Both triangles must be written.
    pub(super) fn matrix_mut(&mut self) -> &mut DMatrix<f64> {
        &mut self.matrix
    }

    /// The right-hand sides, a column a channel.
    pub(super) fn rhs_mut(&mut self) -> &mut DMatrix<f64> {
        &mut self.rhs
    }

    /// Solves by LU with partial pivoting. The solutions are columns; the matrix is used up.
    ///
    /// # Errors
    /// [`Failure::Singular`] when the pivots span more than the precision of their numbers.
    pub(super) fn solve(&mut self) -> Result<&DMatrix<f64>, Failure> {
        let n = self.matrix.nrows();
        let matrix = std::mem::replace(&mut self.matrix, DMatrix::zeros(0, 0));
        let norm = self.measures_condition.then(|| norm1(&matrix));
        let lu = LU::new(matrix);
        let pivots = lu.lu_internal().diagonal();
        let (least, most) = pivots
            .iter()
            .fold((f64::INFINITY, 0f64), |(least, most), p| {
                (least.min(p.abs()), most.max(p.abs()))
            });
        // A pivot of NaN fails the comparison too.
        let is_regular = least > most * f64::EPSILON * n as f64;
        if let Some(norm) = norm {
            let inverse = norm1_of_inverse(&lu, n);
            self.condition = Some(inverse.map_or(f64::INFINITY, |inverse| norm * inverse));
        }
        if is_regular && lu.solve_mut(&mut self.rhs) {
            Ok(&self.rhs)
        } else {
            Err(Failure::Singular)
        }
    }
}

fn norm1(matrix: &DMatrix<f64>) -> f64 {
    matrix
        .column_iter()
        .map(|column| column.iter().map(|v| v.abs()).sum::<f64>())
        .fold(0.0, f64::max)
}

/// Hager's estimate of the 1-norm of the inverse of a symmetric matrix (1984), a lower bound that is
/// nearly always within a factor of 3. `None` when a pivot is zero.
fn norm1_of_inverse(lu: &LU<f64, Dyn, Dyn>, n: usize) -> Option<f64> {
    let mut x = DVector::repeat(n, 1.0 / n as f64);
    let mut best = 0.0f64;
    for _ in 0..CONDITION_STEPS {
        let y = lu.solve(&x)?;
        let norm = y.lp_norm(1);
        if !norm.is_finite() {
            return None;
        }
        best = best.max(norm);
        let z = lu.solve(&y.map(f64::signum))?;
        let steepest = z.icamax();
        if z[steepest].abs() <= z.dot(&x) {
            break;
        }
        x.fill(0.0);
        x[steepest] = 1.0;
    }
    Some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hilbert's matrix, whose condition numbers are known.
    fn hilbert(system: &mut System, n: usize) {
        system.begin(n);
        for i in 0..n {
            for j in 0..n {
                system.matrix_mut()[(i, j)] = 1.0 / (i + j + 1) as f64;
            }
        }
    }

    #[test]
    fn condition_numbers_are_those_of_the_literature() {
        // 1-norm condition numbers of Hilbert's matrices (Higham 2002, table 28.1 gives the
        // 2-norm; these follow from the exact integer inverses).
        for (n, expected) in [(3, 748.0), (4, 28_375.0), (5, 943_656.0)] {
            let mut system = System::measuring_condition();
            hilbert(&mut system, n);
            system.rhs_mut()[(0, 0)] = 1.0;
            let first = system.solve().map(|x| x[(0, 0)]).ok();
            // The corner of the inverse is n².
            assert!(first.is_some_and(|x| (x - (n * n) as f64).abs() < 1e-6));
            let condition = system.condition().unwrap_or(0.0);
            assert!(
                (condition / expected - 1.0).abs() < 1e-3,
                "{n}: {condition}"
            );
        }
    }

    #[test]
    fn singular_systems_are_reported_with_their_condition() {
        let mut system = System::measuring_condition();
        system.begin(3);
        system.matrix_mut().fill(1.0);
        assert_eq!(system.solve().err(), Some(Failure::Singular));
        assert!(system.condition().is_some_and(|c| c > 1e15));
        hilbert(&mut system, 14);
        assert_eq!(system.solve().err(), Some(Failure::Singular));
    }

    #[test]
    fn an_indefinite_system_is_solved() {
        let mut system = System::default();
        system.begin(2);
        system.matrix_mut()[(0, 1)] = 2.0;
        system.matrix_mut()[(1, 0)] = 2.0;
        system.rhs_mut()[(0, 2)] = 6.0;
        assert_eq!(system.solve().map(|x| x[(1, 2)]), Ok(3.0));
        assert_eq!(system.condition(), None);
    }
}
