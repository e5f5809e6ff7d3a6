//! The mean of a table over turns of the sample, for formats that know no anisotropy.

use crate::elementary::Elementary;
use crate::{DenseBrdf, Direction, Grid};
use rayon::prelude::*;

/// A BRDF of θi, θv and φv − φi: the mean over all azimuths of the light.
pub struct IsotropicMean {
    grid: Grid,
    /// Of each pair of polar angles (light slow, view fast), a value a difference of azimuths.
    values: Vec<[f32; 3]>,
    /// Root mean square of ln of value over mean, over all cells in which both are positive: 0 of an isotropic
    /// table.
    pub anisotropy: f64,
}

impl IsotropicMean {
    /// Of a table. All azimuths of the grid count the same.
    pub fn of(table: &DenseBrdf) -> Self {
        let grid = table.grid();
        let (n_theta, n_phi) = (grid.n_theta(), grid.n_phi());
        let pairs: Vec<(Vec<[f32; 3]>, f64, u64)> = (0..n_theta * n_theta)
            .into_par_iter()
            .map(|pair| of_pair(table, [pair / n_theta, pair % n_theta], n_phi))
            .collect();
        let (squares, count) = pairs
            .iter()
            .fold((0.0, 0), |(sum, n), pair| (sum + pair.1, n + pair.2));
        Self {
            grid,
            values: pairs.into_iter().flat_map(|pair| pair.0).collect(),
            anisotropy: (squares / count.max(1) as f64).sqrt(),
        }
    }

    /// The value at polar angles of light and view and a difference of azimuths φv − φi, all in radians; linear
    /// between the nodes.
    pub fn lookup(&self, theta_i: f64, theta_v: f64, delta_phi: f64) -> [f64; 3] {
        let at = |theta| Direction {
            theta,
            phi: delta_phi,
        };
        let (n_theta, n_phi) = (self.grid.n_theta(), self.grid.n_phi());
        let mut sum = [0.0; 3];
        // A light's polar angles have the weights of azimuth 0.
        let lights = self.grid.corners(Direction {
            theta: theta_i,
            phi: 0.0,
        });
        for (light, of_light) in lights.into_iter().filter(|(_, weight)| *weight > 0.0) {
            for (view, of_view) in self.grid.corners(at(theta_v)) {
                let pair = light / n_phi * n_theta + view / n_phi;
                let value = self.values[pair * n_phi + view % n_phi];
                for c in 0..3 {
                    sum[c] += of_light * of_view * f64::from(value[c]);
                }
            }
        }
        sum
    }

    /// The value at a pair of directions.
    pub fn at(&self, light: Direction, view: Direction) -> [f64; 3] {
        self.lookup(light.theta, view.theta, view.phi - light.phi)
    }
}

/// The means of a pair of polar angles, with the sum of squared ln about them and the number of those.
fn of_pair(
    table: &DenseBrdf,
    [theta_i, theta_v]: [usize; 2],
    n_phi: usize,
) -> (Vec<[f32; 3]>, f64, u64) {
    let (mut squares, mut count) = (0.0, 0);
    let of_delta = |delta: usize| {
        let turned = (0..n_phi).map(|phi| {
            table.at(
                theta_i * n_phi + phi,
                theta_v * n_phi + (phi + delta) % n_phi,
            )
        });
        let turned: Vec<[f32; 3]> = turned.collect();
        let mean =
            [0, 1, 2].map(|c| turned.iter().map(|v| f64::from(v[c])).sum::<f64>() / n_phi as f64);
        let whole = |v: [f64; 3]| v[0] + v[1] + v[2];
        for value in turned {
            let ratio = whole(value.map(f64::from)) / whole(mean);
            if ratio > 0.0 && ratio.is_finite() {
                squares += ratio.natural_log().powi(2);
                count += 1;
            }
        }
        mean.map(|v| v as f32)
    };
    let means = (0..n_phi).map(of_delta).collect();
    (means, squares, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(of: impl Fn(Direction, Direction) -> f64) -> DenseBrdf {
        let grid = Grid::with_step_deg(15.0).unwrap();
        DenseBrdf::from_fn(grid, |i, v| {
            [of(grid.direction(i), grid.direction(v)) as f32; 3]
        })
    }

    #[test]
    fn what_depends_on_differences_of_azimuth_alone_stays_and_the_rest_is_averaged() {
        // Not the same at φ and −φ.
        let isotropic = |i: Direction, v: Direction| {
            let delta = v.phi - i.phi;
            1.0 + 0.3 * i.theta + 0.2 * v.theta + 0.2 * delta.cosine() + 0.1 * delta.sine()
        };
        let mean = IsotropicMean::of(&table(isotropic));
        assert!(mean.anisotropy < 1e-6);
        let at = |t: f64, p: f64| Direction::from_deg(t, p);
        let (light, view) = (at(30.0, 45.0), at(60.0, 165.0));
        for c in 0..3 {
            assert!((mean.at(light, view)[c] - isotropic(light, view)).abs() < 1e-6);
        }
        assert!((mean.at(view, light)[0] - isotropic(view, light)).abs() < 1e-6);

        let turned =
            |i: Direction, v: Direction| isotropic(i, v) * (1.0 + 0.5 * (2.0 * i.phi).cosine());
        let mean = IsotropicMean::of(&table(turned));
        assert!((mean.at(light, view)[1] - isotropic(light, view)).abs() < 1e-6);
        // RMS of ln(1 + a cos x) is about a/√2.
        assert!(
            (0.33..0.45).contains(&mean.anisotropy),
            "{}",
            mean.anisotropy
        );
    }
}
