//! A BRDF on every cell of the grid.

use crate::direction::{Direction, Vec3};
use crate::grid::Grid;
use crate::model::Brdf;
use rayon::prelude::*;

/// A BRDF tabulated on a [`Grid`]: a plane a channel, each `n_cells` long in the order of [`Grid::cell`] (row = light, column = view).
#[derive(Clone, Debug, PartialEq)]
pub struct DenseBrdf<const N: usize = 3> {
    grid: Grid,
    planes: [Vec<f32>; N],
}

impl<const N: usize> DenseBrdf<N> {
    /// Wraps a plane of values a channel. `None` when a plane is not `grid.n_cells()` long.
    pub fn new(grid: Grid, planes: [Vec<f32>; N]) -> Option<Self> {
        planes
            .iter()
            .all(|p| p.len() == grid.n_cells())
            .then_some(Self { grid, planes })
    }

    /// Wraps planes that are known to be of the grid's size.
    pub(crate) fn from_planes(grid: Grid, planes: [Vec<f32>; N]) -> Self {
        debug_assert!(planes.iter().all(|p| p.len() == grid.n_cells()));
        Self { grid, planes }
    }

    /// The grid of the table.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// A plane a channel.
    pub fn planes(&self) -> &[Vec<f32>; N] {
        &self.planes
    }

    /// Takes the planes out, to move them into a file.
    pub fn into_planes(self) -> [Vec<f32>; N] {
        self.planes
    }

    /// The value at a pair of direction indices.
    pub fn at(&self, light: usize, view: usize) -> [f32; N] {
        let cell = self.grid.cell(light, view);
        std::array::from_fn(|c| self.planes[c][cell])
    }

    /// The value at any pair of directions, linear between the nodes in all four angles; beyond
    /// the last polar angle the last node's value.
    pub fn lookup(&self, light: Direction, view: Direction) -> [f32; N] {
        let at = |i, v| Ok::<_, std::convert::Infallible>(self.at(i, v));
        match self.grid.lookup(light, view, at) {
            Ok(value) => value,
        }
    }
}

impl DenseBrdf {
    /// The table of values at pairs of direction indices.
    pub fn from_fn(grid: Grid, at: impl Fn(usize, usize) -> [f32; 3]) -> Self {
        let n = grid.n_directions();
        let mut planes = [(); 3].map(|()| Vec::with_capacity(grid.n_cells()));
        for light in 0..n {
            for view in 0..n {
                let value = at(light, view);
                for c in 0..3 {
                    planes[c].push(value[c]);
                }
            }
        }
        Self { grid, planes }
    }

    /// The table of an analytic model.
    pub fn tabulate(grid: Grid, model: &dyn Brdf) -> Self {
        let n = grid.n_directions();
        let vectors: Vec<Vec3> = (0..n).map(|d| grid.direction(d).to_vec3()).collect();
        let mut planes = [(); 3].map(|()| vec![0.0; grid.n_cells()]);
        let [red, green, blue] = &mut planes;
        red.par_chunks_mut(n)
            .zip(green.par_chunks_mut(n))
            .zip(blue.par_chunks_mut(n))
            .enumerate()
            .for_each(|(light, ((red, green), blue))| {
                for view in 0..n {
                    let value = model.eval(vectors[light], vectors[view]);
                    red[view] = value[0] as f32;
                    green[view] = value[1] as f32;
                    blue[view] = value[2] as f32;
                }
            });
        Self { grid, planes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lookup_is_exact_at_nodes_and_linear_between() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let value = |i: usize, v: usize| (3 * i + 7 * v) as f32;
        let n = grid.n_directions();
        let plane: Vec<f32> = (0..grid.n_cells()).map(|c| value(c / n, c % n)).collect();
        let dense = DenseBrdf::new(grid, [plane.clone(), plane.clone(), plane]).unwrap();
        for (i, v) in [(13, 25), (12, 35)] {
            let at = dense.lookup(grid.direction(i), grid.direction(v));
            assert!((at[0] - value(i, v)).abs() < 1e-3);
        }
        let between = dense.lookup(Direction::from_deg(30.0, 15.0), grid.direction(24));
        assert!((between[1] - 0.5 * (value(12, 24) + value(13, 24))).abs() < 1e-3);
        let wrapped = dense.lookup(Direction::from_deg(30.0, 345.0), grid.direction(24));
        assert!((wrapped[2] - 0.5 * (value(23, 24) + value(12, 24))).abs() < 1e-3);
        assert!(DenseBrdf::new(grid, [vec![], vec![], vec![]]).is_none());
    }
}
