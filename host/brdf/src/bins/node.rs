//! Means of directions about a node, without a sine a sample.

use crate::direction::{normalize, wrap_deg};
use crate::grid::Grid;

/// Sine and cosine of the nodes' angles. A sample lies within half a step of its node, so that a
/// few terms of the series of the difference say its direction.
pub struct Nodes {
    grid: Grid,
    theta: Vec<NodeAngle>,
    phi: Vec<NodeAngle>,
}

/// An angle of a node.
struct NodeAngle {
    deg: f64,
    sin: f64,
    cos: f64,
}

impl Nodes {
    pub fn new(grid: Grid) -> Self {
        let at = |k: usize| {
            let deg = k as f64 * grid.step_deg();
            let (sin, cos) = deg.to_radians().sin_cos();
            NodeAngle { deg, sin, cos }
        };
        Self {
            grid,
            theta: (0..grid.n_theta()).map(at).collect(),
            phi: (0..grid.n_phi()).map(at).collect(),
        }
    }

    /// The node of a direction index.
    pub fn at(&self, direction: usize) -> Node<'_> {
        Node {
            theta: &self.theta[direction / self.grid.n_phi()],
            phi: &self.phi[direction % self.grid.n_phi()],
            is_pole: direction == 0,
        }
    }
}

/// A node of directions.
#[derive(Clone, Copy)]
pub struct Node<'a> {
    theta: &'a NodeAngle,
    phi: &'a NodeAngle,
    is_pole: bool,
}

impl Node<'_> {
    /// The unit vector of the sum of directions (θ, φ in degrees) that are nearest to this node.
    pub fn mean(&self, directions: impl Iterator<Item = (f32, f32)>) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for (theta_deg, phi_deg) in directions {
            let mut d_phi = f64::from(phi_deg) - self.phi.deg;
            if d_phi.abs() > 180.0 {
                d_phi = wrap_deg(d_phi + 180.0) - 180.0;
            }
            // Around the pole azimuths are anywhere.
            let (sp, cp) = if self.is_pole {
                d_phi.to_radians().sin_cos()
            } else {
                self.phi.turned(d_phi)
            };
            let (st, ct) = self.theta.turned(f64::from(theta_deg) - self.theta.deg);
            sum[0] += st * cp;
            sum[1] += st * sp;
            sum[2] += ct;
        }
        normalize(sum).map(|x| x as f32)
    }
}

impl NodeAngle {
    /// Sine and cosine of the angle plus a small one: below 1e-10 off for 15°, the half step of
    /// the coarsest grid, and by rounding only for 1°.
    fn turned(&self, by_deg: f64) -> (f64, f64) {
        let a = by_deg.to_radians();
        let q = a * a;
        let s = a * (1.0 + q * (-1.0 / 6.0 + q * (1.0 / 120.0 - q * (1.0 / 5040.0))));
        let c = 1.0 + q * (-0.5 + q * (1.0 / 24.0 + q * (-1.0 / 720.0 + q * (1.0 / 40320.0))));
        (self.sin * c + self.cos * s, self.cos * c - self.sin * s)
    }
}
