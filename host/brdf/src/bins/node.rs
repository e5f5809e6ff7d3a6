//! Means of directions about a node, without a sine a sample.

use crate::direction::{normalize, wrap_deg};
use crate::elementary::Elementary;
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
            let (sin, cos) = deg.to_radians().sine_cosine();
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
    ///
    /// What is summed is each direction less the node's, in the node's meridian plane: numbers of the size of
    /// half a step, for which single precision is ample.
    pub fn mean(&self, directions: impl ExactSizeIterator<Item = (f32, f32)>) -> [f32; 3] {
        let count = directions.len() as f64;
        let (sin, cos) = (self.theta.sin as f32, self.theta.cos as f32);
        let mut sum = [0.0f32; 3];
        for (theta_deg, phi_deg) in directions {
            let mut d_phi = f64::from(phi_deg) - self.phi.deg;
            if d_phi.abs() > 180.0 {
                d_phi = wrap_deg(d_phi + 180.0) - 180.0;
            }
            // Around the pole azimuths are anywhere.
            let (sp, cp) = if self.is_pole {
                let (s, c) = d_phi.to_radians().sine_cosine();
                (s as f32, (c - 1.0) as f32)
            } else {
                small_turn(d_phi)
            };
            let (st, ct) = small_turn(f64::from(theta_deg) - self.theta.deg);
            let outward = sin * ct + cos * st;
            sum[0] += outward + (sin + outward) * cp;
            sum[1] += (sin + outward) * sp;
            sum[2] += cos * ct - sin * st;
        }
        let [x, y, z] = sum.map(|s| f64::from(s) / count);
        let x = x + self.theta.sin;
        normalize([
            x * self.phi.cos - y * self.phi.sin,
            x * self.phi.sin + y * self.phi.cos,
            z + self.theta.cos,
        ])
        .map(|x| x as f32)
    }
}

/// sin a and cos a − 1 of a small angle in degrees, by their series: below 2e-8 (1e-6°) off for 15°, half
/// the step of the coarsest grid.
fn small_turn(deg: f64) -> (f32, f32) {
    let a = deg.to_radians() as f32;
    let q = a * a;
    (
        a * (1.0 + q * (-1.0 / 6.0 + q * (1.0 / 120.0))),
        q * (-0.5 + q * (1.0 / 24.0 + q * (-1.0 / 720.0))),
    )
}
