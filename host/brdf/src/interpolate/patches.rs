//! The grid's directions, cut into patches of about the same size on the sphere, and these into
//! smaller ones. The cells of a pair of patches share one factorisation.

use crate::direction::{Vec3, normalize};
use crate::grid::Grid;
use std::ops::Range;

/// Neighbouring directions.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Direction indices; of the pole only azimuth 0.
    pub directions: Vec<u32>,
    /// Unit vectors of the directions, in the same order.
    pub vectors: Vec<Vec3>,
    /// Unit vector in the middle.
    pub centre: Vec3,
    /// Smaller patches of the same directions; none where the patch is of the smallest size.
    pub children: Vec<Child>,
}

/// A part of a patch.
#[derive(Clone, Debug)]
pub struct Child {
    /// The part as a patch of its own.
    pub patch: Patch,
    /// Where each of its directions stands in the parent.
    pub places: Vec<u32>,
}

/// Covers the grid with patches of about `sizes_deg[0]` × `sizes_deg[0]`, each cut into parts of
/// about the next size, and so on. Every direction is in one patch of each size, the pole once.
pub fn cover(grid: Grid, sizes_deg: &[f64]) -> Vec<Patch> {
    cut(grid, 0..grid.n_theta(), 0..grid.n_phi(), sizes_deg)
}

/// Cuts a lattice of rows and columns into patches.
fn cut(grid: Grid, rows: Range<usize>, columns: Range<usize>, sizes_deg: &[f64]) -> Vec<Patch> {
    let Some((size_deg, smaller)) = sizes_deg.split_first() else {
        return Vec::new();
    };
    let step = grid.step_deg();
    let height = ((size_deg / step).round() as usize).max(1);
    let mut patches = Vec::new();
    let mut first = rows.start;
    while first < rows.end {
        let last = (first + height).min(rows.end);
        let middle_deg = 0.5 * (first + last - 1) as f64 * step;
        // The cap around the pole is one patch: its circumference is short all over.
        let n_around = if first == 0 {
            1
        } else {
            let width_deg = columns.len() as f64 * step * middle_deg.to_radians().sin();
            ((width_deg / size_deg).round() as usize).clamp(1, columns.len())
        };
        for k in 0..n_around {
            let at = |k: usize| columns.start + k * columns.len() / n_around;
            patches.push(patch(grid, first..last, at(k)..at(k + 1), smaller));
        }
        first = last;
    }
    patches
}

fn patch(grid: Grid, rows: Range<usize>, columns: Range<usize>, smaller_deg: &[f64]) -> Patch {
    let mut directions = Vec::with_capacity(rows.len() * columns.len());
    for row in rows.clone() {
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
    let children = cut(grid, rows, columns, smaller_deg)
        .into_iter()
        .map(|patch| Child {
            // Directions are in ascending order in parent and child.
            places: patch
                .directions
                .iter()
                .map(|d| directions.partition_point(|x| x < d) as u32)
                .collect(),
            patch,
        })
        .collect();
    Patch {
        directions,
        vectors,
        centre: normalize(centre),
        children,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::angle_between;

    fn check(grid: Grid, patches: &[&Patch], size: f64) {
        let mut seen = vec![0; grid.n_directions()];
        for patch in patches {
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

    #[test]
    fn every_direction_is_in_one_patch_of_each_size_and_patches_are_small() {
        for (step, sizes) in [(2.0, [8.0, 4.0]), (6.0, [12.0, 6.0]), (4.0, [8.0, 4.0])] {
            let grid = Grid::with_step_deg(step).unwrap();
            let patches = cover(grid, &sizes);
            check(grid, &patches.iter().collect::<Vec<_>>(), sizes[0]);
            let parts: Vec<&Patch> = patches
                .iter()
                .flat_map(|p| p.children.iter().map(|c| &c.patch))
                .collect();
            check(grid, &parts, sizes[1]);
        }
    }

    #[test]
    fn a_part_knows_its_places_in_the_whole() {
        for patch in cover(Grid::PAPER, &[8.0, 4.0]) {
            for child in &patch.children {
                assert!(child.patch.children.is_empty());
                for (place, direction) in child.places.iter().zip(&child.patch.directions) {
                    assert_eq!(patch.directions[*place as usize], *direction);
                }
            }
        }
    }
}
