//! How well the data determine each number.

use super::least_squares::jacobian;
use super::{Cell, Problem};
use crate::direction::{Direction, Vec3};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Eigenvalues of the scaled normal matrix below this share of the largest belong to combinations
/// of numbers that the data do not determine.
const LEAST_EIGENVALUE: f64 = 1e-9;
/// Patches of directions, about 30° wide: beyond each polar angle so many sectors. An interpolated
/// table takes its values from a neighbourhood of about this size, and frames span 15° to 28°.
const RINGS: [(f64, usize); 4] = [(0.0, 1), (15.0, 6), (45.0, 10), (75.0, 12)];

/// Standard uncertainties that allow for residuals which depend on each other: cells of an
/// interpolated table share their samples, and a model that is wrong is wrong over whole regions.
///
/// The sum of squares' curvature A = JᵀJ says how a number answers to the residuals; how much these
/// vary together is seen from the sums of Jᵀr over groups of cells (pairs of patches of directions,
/// light and view exchangeable as in a reciprocal table): the covariance is A⁻¹ (Σ g gᵀ) A⁻¹ · G/(G−1)
/// with the sum g of each of G groups (Liang and Zeger 1986). Where residuals are independent it is
/// the usual s² A⁻¹.
///
/// An error that all cells share changes the residuals by one of `shifts`, and the numbers by A⁻¹ Jᵀ of that.
pub(super) fn standard(
    problem: &Problem<'_>,
    values: &[f64],
    shifts: &[Vec<f64>],
) -> Vec<Option<f64>> {
    let n = values.len();
    let residuals =
        |values: &[f64], out: &mut Vec<f64>| problem.residuals(values, &problem.cells, out);
    let mut here = Vec::new();
    residuals(values, &mut here);
    if here.len() != 3 * problem.cells.len() {
        return vec![None; n];
    }
    // Towards zero: a bound from above is never crossed.
    let step = |k: usize| -1e-6 * values[k].abs().max(1e-3);
    let jacobian = jacobian(&residuals, values, &here, step);
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
    let is_determined = |value: f64| value > LEAST_EIGENVALUE * largest;
    let mut inverse = DMatrix::zeros(n, n);
    for (j, value) in eigen.eigenvalues.iter().enumerate() {
        if is_determined(*value) {
            let direction = eigen.eigenvectors.column(j);
            inverse += direction * direction.transpose() / *value;
        }
    }
    let gradients = group_gradients(problem, &jacobian, &here);
    let groups = gradients.len() as f64;
    let mut variances = vec![0.0; n];
    let mut add = |gradient: &DVector<f64>, weight: f64| {
        let scaled = DVector::from_fn(n, |k, _| gradient[k] / scale[k]);
        let influence = &inverse * scaled;
        for k in 0..n {
            variances[k] += weight * (influence[k] / scale[k]).powi(2);
        }
    };
    for gradient in &gradients {
        add(gradient, groups / (groups - 1.0).max(1.0));
    }
    for shift in shifts.iter().filter(|shift| shift.len() == here.len()) {
        add(&jacobian.tr_mul(&DVector::from_column_slice(shift)), 1.0);
    }
    (0..n)
        .map(|k| {
            let undetermined: f64 = eigen
                .eigenvalues
                .iter()
                .enumerate()
                .filter(|(_, value)| !is_determined(**value))
                .map(|(j, _)| eigen.eigenvectors[(k, j)].powi(2))
                .sum();
            let found = variances[k].sqrt();
            let is_sound = found.is_finite() && found < 1e3 * values[k].abs().max(1e-3);
            (undetermined <= 1e-3 && is_sound).then_some(found)
        })
        .collect()
}

/// The sum of Jᵀr over the cells of each group.
fn group_gradients(
    problem: &Problem<'_>,
    jacobian: &DMatrix<f64>,
    residuals: &[f64],
) -> Vec<DVector<f64>> {
    let n = jacobian.ncols();
    let mut groups: BTreeMap<(usize, usize), DVector<f64>> = BTreeMap::new();
    for (k, cell) in problem.cells.iter().enumerate() {
        let sum = groups
            .entry(group(cell))
            .or_insert_with(|| DVector::zeros(n));
        for row in 3 * k..3 * k + 3 {
            *sum += jacobian.row(row).transpose() * residuals[row];
        }
    }
    groups.into_values().collect()
}

/// The patches of a cell's two directions, in either order.
fn group(cell: &Cell) -> (usize, usize) {
    let (a, b) = (patch(cell.light), patch(cell.view));
    (a.min(b), a.max(b))
}

fn patch(v: Vec3) -> usize {
    let direction = Direction::from_vec3(v);
    let theta_deg = direction.theta_deg();
    let ring = RINGS.iter().rposition(|(from, _)| theta_deg >= *from);
    let ring = ring.unwrap_or(0);
    let before: usize = RINGS[..ring].iter().map(|(_, sectors)| sectors).sum();
    let sectors = RINGS[ring].1;
    let sector = (direction.phi_deg() / 360.0 * sectors as f64) as usize;
    before + sector.min(sectors - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_and_its_reciprocal_one_are_of_the_same_group_and_patches_are_30_degrees_wide() {
        let at = |t, p| Direction::from_deg(t, p).to_vec3();
        let cell = |light, view| Cell {
            light,
            view,
            value: [1.0; 3],
        };
        let (a, b) = (at(62.0, 10.0), at(30.0, 200.0));
        assert_eq!(group(&cell(a, b)), group(&cell(b, a)));
        assert_ne!(group(&cell(a, b)), group(&cell(at(62.0, 50.0), b)));
        let patches: std::collections::BTreeSet<usize> = (0..90)
            .flat_map(|t| (0..360).map(move |p| patch(at(f64::from(t), f64::from(p)))))
            .collect();
        assert_eq!(
            patches.into_iter().collect::<Vec<_>>(),
            (0..29).collect::<Vec<_>>()
        );
    }
}
