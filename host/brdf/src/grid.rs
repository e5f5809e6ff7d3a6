//! The dense grid: a lattice of nodes in (θi, φi, θv, φv) and its order in files.
//!
//! The paper's grid has a step of 2°: θ = 0, 2 … 86° and φ = 0, 2 … 358°, 44 × 44 × 180 × 180
//! nodes. A *direction index* counts `180·iθ + iφ`; a *cell* is a pair (light, view) of them. The
//! dense EXR has one row a light direction and one column a view direction.

use crate::direction::{Direction, wrap_deg};
use std::ops::RangeInclusive;

/// Largest polar angle of a node, in degrees (the paper's 86°).
pub const THETA_MAX_DEG: f64 = 86.0;

/// Steps that a grid may have, thousandths of a degree.
const STEPS_MDEG: RangeInclusive<u32> = 500..=30_000;

/// A lattice of directions with the same step in θ and φ, used for light and view alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    step_mdeg: u32,
    n_theta: usize,
    n_phi: usize,
}

/// Why a grid cannot be made.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error(
    "a grid step of {step_mdeg} millidegrees does not divide 180 degrees, or is not in 0.5..=30 degrees"
)]
pub struct GridError {
    step_mdeg: u32,
}

impl Grid {
    /// The paper's grid, 2° in all four dimensions.
    pub const PAPER: Grid = Grid {
        step_mdeg: 2000,
        n_theta: 44,
        n_phi: 180,
    };

    /// A grid of the given step in degrees. The step must divide 180° and lie in 0.5° ..= 30°.
    pub fn with_step_deg(step_deg: f64) -> Result<Self, GridError> {
        let step_mdeg = (step_deg * 1000.0).round().clamp(0.0, 4e9) as u32;
        if !STEPS_MDEG.contains(&step_mdeg) || 180_000 % step_mdeg != 0 {
            return Err(GridError { step_mdeg });
        }
        Ok(Self {
            step_mdeg,
            n_theta: (THETA_MAX_DEG * 1000.0) as usize / step_mdeg as usize + 1,
            n_phi: 360_000 / step_mdeg as usize,
        })
    }

    /// The grid whose square EXR has this many rows, if there is one.
    pub fn from_directions(n_directions: usize) -> Option<Self> {
        STEPS_MDEG
            .filter_map(|mdeg| Self::with_step_deg(f64::from(mdeg) / 1000.0).ok())
            .find(|grid| grid.n_directions() == n_directions)
    }

    /// Step in degrees, of θ and of φ.
    pub fn step_deg(&self) -> f64 {
        self.step_mdeg as f64 / 1000.0
    }

    /// Number of polar angles.
    pub fn n_theta(&self) -> usize {
        self.n_theta
    }

    /// Number of azimuths.
    pub fn n_phi(&self) -> usize {
        self.n_phi
    }

    /// Number of direction indices, poles counted once an azimuth: rows, or columns, of the EXR.
    pub fn n_directions(&self) -> usize {
        self.n_theta * self.n_phi
    }

    /// Number of cells: `n_directions²`.
    pub fn n_cells(&self) -> usize {
        self.n_directions() * self.n_directions()
    }

    /// The direction at a direction index (`n_phi·iθ + iφ`).
    pub fn direction(&self, index: usize) -> Direction {
        let step = self.step_deg();
        Direction::from_deg(
            (index / self.n_phi) as f64 * step,
            (index % self.n_phi) as f64 * step,
        )
    }

    /// The direction index of the node nearest to the angles, each axis rounded by itself; the
    /// pole is index 0. `None` beyond half a step past the last polar angle, and of an angle
    /// that is not finite.
    pub fn nearest(&self, theta_deg: f64, phi_deg: f64) -> Option<usize> {
        let step = self.step_deg();
        let t = theta_deg / step;
        if !(t > -0.5 && t < self.n_theta as f64 - 0.5 && phi_deg.is_finite()) {
            return None;
        }
        let i_theta = rounded(t);
        if i_theta == 0 {
            return Some(0);
        }
        let mut i_phi = rounded(wrap_deg(phi_deg) / step);
        // At most a whole turn; a remainder would be a division of integers.
        if i_phi == self.n_phi {
            i_phi = 0;
        }
        Some(i_theta * self.n_phi + i_phi)
    }

    /// The four nodes around a direction with their bilinear weights; beyond the last polar angle
    /// those of its last ring.
    pub fn corners(&self, d: Direction) -> [(usize, f64); 4] {
        let (step, n_phi) = (self.step_deg(), self.n_phi);
        let t = (d.theta_deg() / step).clamp(0.0, (self.n_theta - 1) as f64);
        let p = wrap_deg(d.phi_deg()) / step;
        let (t0, p0) = (t.floor() as usize, p.floor() as usize);
        let t1 = (t0 + 1).min(self.n_theta - 1);
        let (p0, p1) = (p0 % n_phi, (p0 + 1) % n_phi);
        let (ft, fp) = (t - t.floor(), p - p.floor());
        [
            (t0 * n_phi + p0, (1.0 - ft) * (1.0 - fp)),
            (t0 * n_phi + p1, (1.0 - ft) * fp),
            (t1 * n_phi + p0, ft * (1.0 - fp)),
            (t1 * n_phi + p1, ft * fp),
        ]
    }

    /// The value at any pair of directions, linear in all four angles between those that `at` gives for
    /// pairs of direction indices; beyond the last polar angle the last node's value.
    pub fn lookup<E, const N: usize>(
        &self,
        light: Direction,
        view: Direction,
        mut at: impl FnMut(usize, usize) -> Result<[f32; N], E>,
    ) -> Result<[f32; N], E> {
        let views = self.corners(view);
        let mut sum = [0.0f64; N];
        for (i, wi) in self.corners(light) {
            for (v, wv) in views {
                let weight = wi * wv;
                if weight > 0.0 {
                    let value = at(i, v)?;
                    for c in 0..N {
                        sum[c] += weight * f64::from(value[c]);
                    }
                }
            }
        }
        Ok(sum.map(|s| s as f32))
    }

    /// The cell of a pair of direction indices: `light·n_directions + view`.
    pub fn cell(&self, light: usize, view: usize) -> usize {
        light * self.n_directions() + view
    }

    /// The (light, view) direction indices of a cell.
    pub fn light_and_view(&self, cell: usize) -> (usize, usize) {
        (cell / self.n_directions(), cell % self.n_directions())
    }
}

/// `x.round()` of x > −0.5: without SSE 4.1 that is a call, and binning asks forty million times.
fn rounded(x: f64) -> usize {
    let below = x as usize;
    below + usize::from(x - below as f64 >= 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_grid_has_the_papers_size() {
        let grid = Grid::with_step_deg(2.0).unwrap();
        assert_eq!(grid, Grid::PAPER);
        assert_eq!(grid.n_directions(), 7920);
        assert_eq!(grid.n_cells(), 62_726_400);
        assert_eq!(Grid::from_directions(7920), Some(grid));
        assert_eq!(Grid::from_directions(7921), None);
        let between = Grid::with_step_deg(1.5).unwrap();
        assert_eq!(Grid::from_directions(between.n_directions()), Some(between));
    }

    #[test]
    fn steps_that_do_not_close_the_circle_are_refused() {
        for bad in [0.0, -2.0, 0.4, 7.0, 45.0, f64::NAN] {
            assert!(Grid::with_step_deg(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn every_node_is_nearest_to_itself() {
        let grid = Grid::with_step_deg(6.0).unwrap();
        for index in 0..grid.n_directions() {
            let d = grid.direction(index);
            let expected = if index < grid.n_phi() { 0 } else { index };
            assert_eq!(grid.nearest(d.theta_deg(), d.phi_deg()), Some(expected));
        }
        assert_eq!(Grid::PAPER.nearest(86.99, 359.2), Some(43 * 180));
        assert_eq!(Grid::PAPER.nearest(87.01, 0.0), None);
        assert_eq!(Grid::PAPER.nearest(f64::NAN, 0.0), None);
        assert_eq!(Grid::PAPER.nearest(0.0, f64::NAN), None);
    }
}
