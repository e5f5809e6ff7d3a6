//! The reference's BRDF-like central values, I_C / cos θi of eq. (3), for any pair of directions.
//!
//! The values of one point in each frame are sparse and a little noisy, and a white fabric is
//! smooth: a regression on polynomials in the quantities of reflection (logarithms of values, so
//! that they stay positive) takes up nearly everything, and averages the noise. What it leaves is
//! interpolated between the nearest poses, and vanishes far from all of them. Both parts are the
//! same with light and view exchanged, as the reference itself is.

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot, normalize};
use gonia_brdf::{DenseBrdf, Direction, Grid, Pose};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Step of the lattice on which the regression's residuals are tabulated, degrees.
const LATTICE_DEG: f64 = 12.0;
/// Residuals further away than this (angle of light and of view, in quadrature) have no say.
const REACH_DEG: f64 = 25.0;
/// Residuals closer than this count the same: their noise is averaged, not followed.
const CORE_DEG: f64 = 4.0;
/// Fewest values for a coefficient of the regression.
const VALUES_A_TERM: usize = 4;

/// A smooth function of light and view.
pub struct CentralField {
    degree: usize,
    coefficients: [DVector<f64>; 3],
    residual: Option<DenseBrdf>,
}

/// Fits the values at some poses. `None` when there are none, or when one is not positive.
pub fn fit_central(values: &[(Pose, [f32; 3])]) -> Option<CentralField> {
    let positive = |v: &[f32; 3]| v.iter().all(|v| *v > 0.0 && v.is_finite());
    if values.is_empty() || !values.iter().all(|(_, v)| positive(v)) {
        return None;
    }
    let logs: Vec<[f64; 3]> = values
        .iter()
        .map(|(_, v)| v.map(|v| f64::from(v).natural_log()))
        .collect();
    let degree = [3, 2, 1]
        .into_iter()
        .find(|d| values.len() >= VALUES_A_TERM * n_terms(*d))
        .unwrap_or(0);
    let n = n_terms(degree);
    let mut normal = DMatrix::<f64>::zeros(n, n);
    let mut right = DMatrix::<f64>::zeros(n, 3);
    let mut row = Vec::with_capacity(n);
    for ((pose, _), log) in values.iter().zip(&logs) {
        terms(degree, pose.light.to_vec3(), pose.view.to_vec3(), &mut row);
        for i in 0..n {
            for j in 0..=i {
                normal[(i, j)] += row[i] * row[j];
            }
            for c in 0..3 {
                right[(i, c)] += row[i] * log[c];
            }
        }
    }
    // A ridge far below the noise: the terms of a few poses may depend on each other.
    let ridge = 1e-9 * normal.trace() / n as f64;
    for i in 0..n {
        normal[(i, i)] += ridge;
        for j in 0..i {
            normal[(j, i)] = normal[(i, j)];
        }
    }
    let solution = normal.cholesky()?.solve(&right);
    let mut field = CentralField {
        degree,
        coefficients: [0, 1, 2].map(|c| solution.column(c).into_owned()),
        residual: None,
    };
    field.residual = field.tabulate_residual(values, &logs);
    Some(field)
}

impl CentralField {
    /// The value for unit vectors towards light and view.
    pub fn at(&self, light: Vec3, view: Vec3) -> [f32; 3] {
        thread_local! {
            static ROW: std::cell::RefCell<Vec<f64>> = const { std::cell::RefCell::new(Vec::new()) };
        }
        let trend = ROW.with_borrow_mut(|row| {
            terms(self.degree, light, view, row);
            self.trend(row)
        });
        let residual = match &self.residual {
            Some(table) => table.lookup(Direction::from_vec3(light), Direction::from_vec3(view)),
            None => [0.0; 3],
        };
        [0, 1, 2].map(|c| (trend[c] + f64::from(residual[c])).exponential() as f32)
    }

    fn trend(&self, row: &[f64]) -> [f64; 3] {
        self.coefficients
            .each_ref()
            .map(|k| k.iter().zip(row).map(|(k, term)| k * term).sum())
    }

    fn tabulate_residual(
        &self,
        values: &[(Pose, [f32; 3])],
        logs: &[[f64; 3]],
    ) -> Option<DenseBrdf> {
        let grid = Grid::with_step_deg(LATTICE_DEG).ok()?;
        let mut row = Vec::new();
        let mut points = Vec::with_capacity(2 * values.len());
        for ((pose, _), log) in values.iter().zip(logs) {
            let (light, view) = (pose.light.to_vec3(), pose.view.to_vec3());
            terms(self.degree, light, view, &mut row);
            let trend = self.trend(&row);
            let residual = [0, 1, 2].map(|c| log[c] - trend[c]);
            points.push((light, view, residual));
            points.push((view, light, residual));
        }
        let n = grid.n_directions();
        let directions: Vec<Vec3> = (0..n).map(|i| grid.direction(i).to_vec3()).collect();
        // The half with light ≥ view; the other half is its mirror image.
        let half: Vec<Vec<[f32; 3]>> = (0..n)
            .into_par_iter()
            .map(|light| {
                (0..=light)
                    .map(|view| weighted_mean(&points, directions[light], directions[view]))
                    .collect()
            })
            .collect();
        let plane = |c: usize| {
            (0..n * n)
                .map(|cell| {
                    let (i, v) = grid.light_and_view(cell);
                    half[i.max(v)][i.min(v)][c]
                })
                .collect()
        };
        DenseBrdf::new(grid, [0, 1, 2].map(plane))
    }
}

/// Mean of the residuals around a pair of directions, weighted by 1/d² inside and falling to zero
/// at the reach.
fn weighted_mean(points: &[(Vec3, Vec3, [f64; 3])], light: Vec3, view: Vec3) -> [f32; 3] {
    let reach2 = REACH_DEG.to_radians().powi(2);
    let core2 = CORE_DEG.to_radians().powi(2);
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (l, v, residual) in points {
        // Squared chords, for small angles their squares.
        let distance2 = 4.0 - 2.0 * (dot(*l, light) + dot(*v, view));
        if distance2 < reach2 {
            let fade = 1.0 - distance2 / reach2;
            let weight = fade * fade / (distance2 + core2);
            total += weight;
            for c in 0..3 {
                sum[c] += weight * residual[c];
            }
        }
    }
    if total > 0.0 {
        sum.map(|s| (s / total) as f32)
    } else {
        [0.0; 3]
    }
}

/// Quantities of a pair of directions that do not change when they are exchanged.
const VARIABLES: usize = 6;

/// Their number.
pub(crate) fn n_terms(degree: usize) -> usize {
    // Monomials of at most this degree in six variables.
    [1, 7, 28, 84][degree]
}

/// The monomials, lower degrees first; the first one is 1.
pub(crate) fn terms(degree: usize, light: Vec3, view: Vec3, row: &mut Vec<f64>) {
    let h = normalize([light[0] + view[0], light[1] + view[1], light[2] + view[2]]);
    let u: [f64; VARIABLES] = [
        light[2] + view[2],
        light[2] * view[2],
        h[2],
        h[0] * h[0] - h[1] * h[1],
        2.0 * h[0] * h[1],
        dot(light, h),
    ];
    row.clear();
    row.push(1.0);
    if degree >= 1 {
        row.extend(u);
    }
    if degree >= 2 {
        for i in 0..VARIABLES {
            row.extend((i..VARIABLES).map(|j| u[i] * u[j]));
        }
    }
    if degree >= 3 {
        for i in 0..VARIABLES {
            for j in i..VARIABLES {
                row.extend((j..VARIABLES).map(|k| u[i] * u[j] * u[k]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Brdf;
    use gonia_brdf::model::Kurt;

    /// Rings of the paper's plan, with the oblique lights.
    fn plan() -> Vec<Pose> {
        let rings = [
            (0.0, 1),
            (15.0, 6),
            (30.0, 12),
            (45.0, 18),
            (60.0, 20),
            (75.0, 24),
        ];
        let ring = |(theta, n): (f64, usize)| {
            (0..n).map(move |i| Direction::from_deg(theta, 360.0 * i as f64 / n as f64))
        };
        let views: Vec<_> = rings.into_iter().flat_map(ring).collect();
        let lights = rings.into_iter().chain([(85.0, 24)]).flat_map(ring);
        lights
            .flat_map(|light| views.iter().map(move |view| Pose { light, view: *view }))
            .collect()
    }

    #[test]
    fn a_white_fabric_is_interpolated_to_a_fraction_of_a_percent() {
        let fabric = Kurt::white_reference_fabric();
        let plan = plan();
        assert_eq!(plan.len(), 8505);
        let values: Vec<_> = plan
            .iter()
            .enumerate()
            .map(|(i, pose)| {
                let noise = 1.0 + 0.003 * ((i * 7919 % 101) as f64 / 50.0 - 1.0);
                let f = fabric.eval(pose.light.to_vec3(), pose.view.to_vec3());
                (*pose, f.map(|v| (v * noise) as f32))
            })
            .collect();
        let field = fit_central(&values).unwrap();
        let mut squares = Vec::new();
        for i in 0..4000 {
            let angle = |k: f64, range: f64| (i as f64 * k).fract() * range;
            let light = Direction::from_deg(angle(0.618_03, 86.0), angle(0.754_87, 360.0));
            let view = Direction::from_deg(angle(0.569_84, 75.0), angle(0.438_2, 360.0));
            let truth = fabric.eval(light.to_vec3(), view.to_vec3());
            let value = field.at(light.to_vec3(), view.to_vec3());
            squares.push((f64::from(value[1]) / truth[1]).natural_log().powi(2));
        }
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        println!("rms {rms}");
        assert!(rms < 0.003, "{rms}");
    }

    #[test]
    fn the_field_is_reciprocal() {
        let values: Vec<_> = plan()
            .into_iter()
            .step_by(17)
            .map(|p| {
                (
                    p,
                    [(1.0 + p.light.theta + 0.3 * p.view.phi.sine()) as f32; 3],
                )
            })
            .collect();
        let field = fit_central(&values).unwrap();
        let a = Direction::from_deg(50.0, 20.0).to_vec3();
        let b = Direction::from_deg(33.0, 210.0).to_vec3();
        let (ab, ba) = (field.at(a, b), field.at(b, a));
        assert!((ab[0] - ba[0]).abs() < 1e-5 * ab[0]);
    }

    #[test]
    fn values_that_cannot_be_are_refused() {
        let pose = plan()[5];
        assert!(fit_central(&[]).is_none());
        assert!(fit_central(&[(pose, [0.1, 0.0, 0.1])]).is_none());
        assert!(fit_central(&[(pose, [0.1, f32::NAN, 0.1])]).is_none());
        let one = fit_central(&[(pose, [0.2; 3])]).unwrap();
        let at = one.at(pose.light.to_vec3(), pose.view.to_vec3());
        assert!((at[0] - 0.2).abs() < 1e-4);
    }
}
