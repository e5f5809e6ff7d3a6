//! How well the data determine each number.

use super::Problem;
use nalgebra::DMatrix;

/// Eigenvalues of the scaled normal matrix below this share of the largest belong to combinations
/// of numbers that the data do not determine.
const LEAST_EIGENVALUE: f64 = 1e-9;

/// Standard uncertainties from the curvature of the sum of squares, `s² (JᵀJ)⁻¹`, as if residuals
/// were independent. Where the model is wrong they are not, and the uncertainties are too small.
pub(super) fn standard(problem: &Problem<'_>, values: &[f64], cost: f64) -> Vec<Option<f64>> {
    let n = values.len();
    let mut here = Vec::new();
    problem.residuals(values, &problem.cells, &mut here);
    let freedom = here.len().saturating_sub(n).max(1) as f64;
    let variance = cost / freedom;
    let mut jacobian = DMatrix::zeros(here.len(), n);
    let (mut there, mut moved) = (Vec::new(), values.to_vec());
    for k in 0..n {
        let step = 1e-6 * values[k].abs().max(1e-3);
        // Towards zero: a bound from above is never crossed.
        moved[k] -= step;
        problem.residuals(&moved, &problem.cells, &mut there);
        moved[k] = values[k];
        let column = here.iter().zip(&there).map(|(a, b)| (a - b) / step);
        jacobian
            .column_mut(k)
            .iter_mut()
            .zip(column)
            .for_each(|(to, d)| *to = d);
    }
    let normal = jacobian.tr_mul(&jacobian);
    let scale: Vec<f64> = (0..n).map(|k| normal[(k, k)].sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let s = scale[i] * scale[j];
        if s > 0.0 && s.is_finite() {
            normal[(i, j)] / s
        } else {
            0.0
        }
    });
    let eigen = scaled.symmetric_eigen();
    let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    (0..n)
        .map(|k| {
            let mut sum = 0.0;
            for (j, value) in eigen.eigenvalues.iter().enumerate() {
                let part = eigen.eigenvectors[(k, j)].powi(2);
                if *value > LEAST_EIGENVALUE * largest {
                    sum += part / value;
                } else if part > 1e-3 {
                    return None;
                }
            }
            let found = (variance * sum).sqrt() / scale[k];
            (found.is_finite() && found < 1e3 * values[k].abs().max(1e-3)).then_some(found)
        })
        .collect()
}
