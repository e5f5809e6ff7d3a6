//! Levenberg and Marquardt's method with derivatives by differences.

use nalgebra::{DMatrix, DVector};

/// Steps of the differences: the square root of double precision.
const STEP: f64 = 1e-6;
/// A step that lowers the cost by less than this share was the last.
const LEAST_GAIN: f64 = 1e-7;

/// Where a search ended.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// The numbers.
    pub at: Vec<f64>,
    /// Sum of the squared residuals there.
    pub cost: f64,
    /// Whether no step made it better; else the steps ran out.
    pub converged: bool,
    /// Steps taken.
    pub iterations: usize,
}

/// Minimises the sum of squares of `residuals` from a starting point, in at most `iterations` steps.
/// The function fills its second argument, always to the same length; a point it cannot do is one
/// with a residual that is not finite.
pub fn minimise(
    residuals: &dyn Fn(&[f64], &mut Vec<f64>),
    start: Vec<f64>,
    iterations: usize,
) -> Minimum {
    let n = start.len();
    let mut at = start;
    let mut here = Vec::new();
    residuals(&at, &mut here);
    let mut cost = sum_of_squares(&here);
    let mut damping = 1e-2;
    let (mut there, mut moved) = (Vec::new(), at.clone());
    for iteration in 0..iterations {
        let jacobian = jacobian(residuals, &at, &here, |_| STEP);
        let normal = jacobian.tr_mul(&jacobian);
        let gradient = jacobian.tr_mul(&DVector::from_column_slice(&here));
        let mut gain = 0.0;
        while damping < 1e12 {
            let mut damped = normal.clone();
            for k in 0..n {
                // A number that changes nothing stays where it is.
                damped[(k, k)] += damping * normal[(k, k)] + 1e-12;
            }
            let Some(factor) = damped.cholesky() else {
                damping *= 10.0;
                continue;
            };
            let step = factor.solve(&gradient);
            for k in 0..n {
                // Beyond a few units every bounded parameter lies on its bound.
                moved[k] = at[k] - step[k].clamp(-3.0, 3.0);
            }
            residuals(&moved, &mut there);
            let cost_there = sum_of_squares(&there);
            if cost_there < cost {
                gain = (cost - cost_there) / cost;
                cost = cost_there;
                std::mem::swap(&mut at, &mut moved);
                std::mem::swap(&mut here, &mut there);
                damping = (damping * 0.2).max(1e-9);
                break;
            }
            damping *= 4.0;
        }
        if gain < LEAST_GAIN {
            return Minimum {
                at,
                cost,
                converged: cost.is_finite(),
                iterations: iteration + 1,
            };
        }
    }
    Minimum {
        at,
        cost,
        converged: false,
        iterations,
    }
}

/// The derivatives of the residuals, which are `here` at a point, by differences over a step of each
/// number.
pub(super) fn jacobian(
    residuals: &dyn Fn(&[f64], &mut Vec<f64>),
    at: &[f64],
    here: &[f64],
    step: impl Fn(usize) -> f64,
) -> DMatrix<f64> {
    let mut jacobian = DMatrix::zeros(here.len(), at.len());
    let (mut there, mut moved) = (Vec::new(), at.to_vec());
    for k in 0..at.len() {
        moved[k] += step(k);
        residuals(&moved, &mut there);
        moved[k] = at[k];
        let column = there.iter().zip(here).map(|(a, b)| (a - b) / step(k));
        for (derivative, found) in jacobian.column_mut(k).iter_mut().zip(column) {
            *derivative = found;
        }
    }
    jacobian
}

fn sum_of_squares(residuals: &[f64]) -> f64 {
    let sum: f64 = residuals.iter().map(|r| r * r).sum();
    if sum.is_finite() { sum } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rosenbrocks_valley_is_walked_to_its_end() {
        let valley = |x: &[f64], r: &mut Vec<f64>| {
            r.clear();
            r.extend([10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
        };
        let found = minimise(&valley, vec![-1.2, 1.0], 200);
        assert!(found.converged);
        assert!((found.at[0] - 1.0).abs() < 1e-5 && (found.at[1] - 1.0).abs() < 1e-5);
        let cut_short = minimise(&valley, vec![-1.2, 1.0], 3);
        assert!(!cut_short.converged && cut_short.cost < 24.2);
    }

    #[test]
    fn a_number_without_effect_and_a_start_that_cannot_be_computed_do_no_harm() {
        let idle = |x: &[f64], r: &mut Vec<f64>| {
            r.clear();
            r.extend([x[0] - 2.0, 0.5 * (x[0] - 2.0)]);
        };
        let found = minimise(&idle, vec![0.0, 5.0], 50);
        assert!(found.converged && (found.at[0] - 2.0).abs() < 1e-6 && found.at[1] == 5.0);
        let broken = |_: &[f64], r: &mut Vec<f64>| {
            r.clear();
            r.push(f64::NAN);
        };
        assert!(!minimise(&broken, vec![1.0], 5).converged);
    }
}
