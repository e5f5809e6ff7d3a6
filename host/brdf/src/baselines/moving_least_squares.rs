//! Moving least squares: a polynomial around the place, fitted with weights that fall with the
//! distance; its value at the place.
//!
//! Bins lie on two-dimensional sheets in a four-dimensional manifold in six coordinates, so that a
//! polynomial in all six has many coefficients that nothing determines. It is fitted along the
//! principal axes of the neighbours instead, those along which they really spread.

use super::{Failure, Interpolant, Neighbourhood, System};
use nalgebra::{Matrix6, Vector6};

/// A pair of directions has four degrees of freedom.
const MOST_AXES: usize = 4;
/// Along an axis whose spread is less than this share of the widest, nothing can be told.
const LEAST_SPREAD: f64 = 0.03;

/// A moving least-squares fit.
pub struct MovingLeastSquares {
    /// Degree of the polynomial: 1 or 2.
    pub degree: usize,
    /// Ridge on all coefficients but the constant, as a share of the weights' sum.
    pub nugget: f64,
}

impl Interpolant for MovingLeastSquares {
    fn estimate(&self, near: &Neighbourhood, system: &mut System) -> Result<[f64; 3], Failure> {
        if near.offsets.is_empty() {
            return Err(Failure::TooFew { have: 0, need: 1 });
        }
        // The farthest neighbour keeps a little weight, so that one alone still counts.
        let reach = 1.05 * near.radius().max(f64::MIN_POSITIVE);
        let weights: Vec<f64> = near
            .distances
            .iter()
            .map(|distance| {
                let s = distance / reach;
                (1.0 - s).powi(4) * (4.0 * s + 1.0)
            })
            .collect();
        let axes = principal_axes(near, reach);
        let terms = n_terms(axes.len(), self.degree);
        system.begin(terms);
        let mut term = Vec::with_capacity(terms);
        let mut total = 0.0;
        for (k, weight) in weights.iter().enumerate() {
            monomials(&near.offsets[k], reach, &axes, self.degree, &mut term);
            total += weight;
            for a in 0..terms {
                for b in 0..=a {
                    system.matrix_mut()[(a, b)] += weight * term[a] * term[b];
                }
                for c in 0..3 {
                    system.rhs_mut()[(a, c)] += weight * term[a] * near.values[k][c];
                }
            }
        }
        let matrix = system.matrix_mut();
        for a in 0..terms {
            if a > 0 {
                matrix[(a, a)] += self.nugget * total;
            }
            for b in 0..a {
                matrix[(b, a)] = matrix[(a, b)];
            }
        }
        let solution = system.solve()?;
        Ok([0, 1, 2].map(|c| solution[(0, c)]))
    }
}

/// The directions in which the neighbours spread, widest first.
fn principal_axes(near: &Neighbourhood, reach: f64) -> Vec<Vector6<f64>> {
    let n = near.offsets.len() as f64;
    let vector = |offset: &[f64; 6]| Vector6::from_column_slice(offset) / reach;
    let mean = near.offsets.iter().map(vector).sum::<Vector6<f64>>() / n;
    let mut covariance = Matrix6::zeros();
    for offset in &near.offsets {
        let d = vector(offset) - mean;
        covariance += d * d.transpose();
    }
    let eigen = covariance.symmetric_eigen();
    let mut order: Vec<usize> = (0..6).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let least = LEAST_SPREAD * LEAST_SPREAD * eigen.eigenvalues[order[0]];
    order
        .into_iter()
        .take(MOST_AXES)
        .filter(|k| eigen.eigenvalues[*k] > least.max(f64::EPSILON))
        .map(|k| eigen.eigenvectors.column(k).into_owned())
        .collect()
}

fn n_terms(axes: usize, degree: usize) -> usize {
    let quadratic = if degree >= 2 {
        axes * (axes + 1) / 2
    } else {
        0
    };
    1 + axes + quadratic
}

/// 1, the coordinates along the axes, and their products.
fn monomials(
    offset: &[f64; 6],
    reach: f64,
    axes: &[Vector6<f64>],
    degree: usize,
    out: &mut Vec<f64>,
) {
    out.clear();
    out.push(1.0);
    let offset = Vector6::from_column_slice(offset) / reach;
    out.extend(axes.iter().map(|axis| axis.dot(&offset)));
    if degree >= 2 {
        for a in 0..axes.len() {
            for b in 0..=a {
                out.push(out[1 + a] * out[1 + b]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scattered around the origin in three of the six dimensions.
    fn scattered(value: impl Fn(&[f64; 6]) -> f64) -> Neighbourhood {
        let mut near = Neighbourhood::default();
        for k in 1..80 {
            let f = |a: f64| (k as f64 * a).fract() - 0.45;
            let at = [f(0.819_172), 0.0, f(0.671_043), 0.0, f(0.549_700), 0.0];
            near.push(at, [value(&at), 2.0, -value(&at)]);
        }
        near
    }

    #[test]
    fn a_polynomial_of_its_degree_is_found_again() {
        let linear = |p: &[f64; 6]| 5.0 + 2.0 * p[0] - 3.0 * p[2];
        let quadratic = |p: &[f64; 6]| linear(p) + 4.0 * p[0] * p[4] - p[2] * p[2];
        let mut system = System::default();
        for degree in [1, 2] {
            let mls = MovingLeastSquares {
                degree,
                nugget: 0.0,
            };
            let at = |near: &Neighbourhood, system: &mut System| {
                mls.estimate(near, system).unwrap_or([f64::NAN; 3])
            };
            let got = at(&scattered(linear), &mut system);
            assert!((got[0] - 5.0).abs() < 1e-9 && (got[1] - 2.0).abs() < 1e-9);
            assert!((got[2] + 5.0).abs() < 1e-9);
            let off = (at(&scattered(quadratic), &mut system)[0] - 5.0).abs();
            if degree == 2 {
                assert!(off < 1e-9, "{off}");
            } else {
                assert!(off > 1e-3, "{off}");
            }
        }
    }

    #[test]
    fn one_neighbour_and_coinciding_ones_give_their_mean() {
        let mls = MovingLeastSquares {
            degree: 2,
            nugget: 1e-3,
        };
        let mut near = Neighbourhood::default();
        near.push([0.1; 6], [4.0; 3]);
        let mut system = System::default();
        let close = |got: Result<[f64; 3], Failure>, value: f64| {
            assert!(got.is_ok_and(|v| (v[0] - value).abs() < 1e-9), "{got:?}");
        };
        close(mls.estimate(&near, &mut system), 4.0);
        near.push([0.1; 6], [6.0; 3]);
        close(mls.estimate(&near, &mut system), 5.0);
    }
}
