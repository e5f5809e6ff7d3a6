//! The grid's directions, cut into patches of about the same size on the sphere. The cells of a
//! pair of patches share one factorisation.

use crate::direction::{Vec3, normalize};
use crate::grid::Grid;

/// Neighbouring directions.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Direction indices; of the pole only azimuth 0.
    pub directions: Vec<u32>,
    /// Unit vectors of the directions, in the same order.
    pub vectors: Vec<Vec3>,
    /// Unit vector in the middle.
    pub centre: Vec3,
}

/// Covers the grid with patches of about `size_deg` × `size_deg`; every direction is in one patch,
/// the pole once.
pub fn cover(grid: Grid, size_deg: f64) -> Vec<Patch> {
    let step = grid.step_deg();
    let rows = ((size_deg / step).round() as usize).max(1);
    let mut patches = Vec::new();
    let mut first = 0;
    while first < grid.n_theta() {
        let last = (first + rows).min(grid.n_theta());
        let middle_deg = 0.5 * (first + last - 1) as f64 * step;
        // The cap around the pole is one patch: its circumference is short all over.
        let n_around = if first == 0 {
            1
        } else {
            let circumference_deg = 360.0 * middle_deg.to_radians().sin();
            ((circumference_deg / size_deg).round() as usize).clamp(1, grid.n_phi())
        };
        for k in 0..n_around {
            let columns = k * grid.n_phi() / n_around..(k + 1) * grid.n_phi() / n_around;
            patches.push(patch(grid, first..last, columns));
        }
        first = last;
    }
    patches
}

fn patch(grid: Grid, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>) -> Patch {
    let mut directions = Vec::with_capacity(rows.len() * columns.len());
    for row in rows {
        for column in columns.clone() {
            if row > 0 || column == 0 {
                directions.push((row * grid.n_phi() + column) as u32);
            }
        }
    }
    let vectors: Vec<Vec3> = directions
        .iter()
        .map(|d| grid.direction(*d as usize).to_vec3())
        .collect();
    let mut centre = [0.0; 3];
    for v in &vectors {
        for k in 0..3 {
            centre[k] += v[k];
        }
    }
    Patch {
        directions,
        vectors,
        centre: normalize(centre),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::angle_between;

    #[test]
    fn every_direction_is_in_one_patch_and_patches_are_small() {
        for (step, size) in [(2.0, 4.0), (2.0, 6.0), (6.0, 12.0), (4.0, 4.0)] {
            let grid = Grid::with_step_deg(step).unwrap();
            let mut seen = vec![0; grid.n_directions()];
            for patch in cover(grid, size) {
                for (d, v) in patch.directions.iter().zip(&patch.vectors) {
                    seen[*d as usize] += 1;
                    let off = angle_between(*v, patch.centre).to_degrees();
                    assert!(off < 0.95 * size, "{off} of {size}");
                }
            }
            assert_eq!(seen[0], 1);
            assert!(seen[1..grid.n_phi()].iter().all(|n| *n == 0));
            assert!(seen[grid.n_phi()..].iter().all(|n| *n == 1));
        }
    }
}
