//! The grid's directions, divided into patches of about the same size on the sphere, and these into
//! smaller ones. The cells of a pair of patches share one factorisation.
//!
//! Patches meet at *corners*, half a step between cells. Along the border of two rows of patches lie
//! the corners of both, so that what is linear between the corners of an edge is the same seen from
//! either side.

use super::corner_weights::Weights;
use crate::direction::{Direction, Vec3, normalize};
use crate::elementary::Elementary;
use crate::grid::Grid;
use std::collections::BTreeMap;
use std::ops::Range;

/// All directions of a grid in patches.
pub struct Cover {
    /// Patches of the largest size.
    pub patches: Vec<Patch>,
    /// Unit vectors of the corners of the smallest patches.
    pub corners: Vec<Vec3>,
}

/// Neighbouring directions.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Direction indices; of the pole only azimuth 0.
    pub directions: Vec<u32>,
    /// Unit vectors of the directions, in the same order.
    pub vectors: Vec<Vec3>,
    /// Unit vector in the middle.
    pub centre: Vec3,
    /// Numbers of the corners of the smallest patches in this one, its border included, ascending.
    pub corners: Vec<u32>,
    /// Unit vectors of the corners.
    pub corner_vectors: Vec<Vec3>,
    /// How each direction lies between corners, by their places in `corners`.
    pub between: Vec<Between>,
    /// How its cells follow from its corners where a block is smooth; `None` where that gains nothing,
    /// and in parts.
    pub weights: Option<Weights>,
    /// Smaller patches of the same directions; none where the patch is of the smallest size.
    pub parts: Vec<Part>,
    /// Polar angles of its directions, by their numbers on the grid.
    pub rows: Range<usize>,
    columns: Range<usize>,
}

/// Four corners and their weights, which add up to 1.
pub type Between = [(u32, f32); 4];

/// A part of a patch.
#[derive(Clone, Debug)]
pub struct Part {
    /// The part as a patch of its own.
    pub patch: Patch,
    /// Where each of its directions stands in the parent.
    pub places: Vec<u32>,
    /// Where each of its corners stands in the parent.
    pub corner_places: Vec<u32>,
}

/// Covers the grid with patches of about `sizes_deg[0]` × `sizes_deg[0]`, each divided into parts of
/// about the next size, and so on. Every direction is in one patch of each size, the pole once.
pub fn cover(grid: Grid, sizes_deg: &[f64]) -> Cover {
    let mut patches = divide(grid, 0..grid.n_theta(), 0..grid.n_phi(), sizes_deg);
    let mut edges = Edges::default();
    patches.iter().for_each(|patch| edges.add(grid, patch));
    let corners = edges.number(grid);
    for patch in &mut patches {
        edges.give_corners(grid, patch);
        give_vectors(&corners, patch);
        patch.weights = Weights::new(&patch.corner_vectors, &patch.vectors, patch.centre);
    }
    Cover { patches, corners }
}

/// Most directions of a patch at the pole, where a grid's azimuths crowd: its cells with all views are in memory at a time. One
/// on a grid of 2° or coarser stays whole.
const MOST_OF_CAP: usize = 1500;

/// Divides a lattice of rows and columns into patches.
fn divide(grid: Grid, rows: Range<usize>, columns: Range<usize>, sizes_deg: &[f64]) -> Vec<Patch> {
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
        // The circumference of the cap around the pole is short all over: it is divided only where its directions are many.
        let n_around = if first == 0 {
            (columns.len() * height).div_ceil(MOST_OF_CAP)
        } else {
            let width_deg = columns.len() as f64 * step * middle_deg.to_radians().sine();
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
    let parts = divide(grid, rows.clone(), columns.clone(), smaller_deg)
        .into_iter()
        .map(|patch| Part {
            places: places_of(&patch.directions, &directions),
            corner_places: Vec::new(),
            patch,
        })
        .collect();
    Patch {
        directions,
        vectors,
        centre: normalize(centre),
        corners: Vec::new(),
        corner_vectors: Vec::new(),
        between: Vec::new(),
        weights: None,
        parts,
        rows,
        columns,
    }
}

fn give_vectors(corners: &[Vec3], patch: &mut Patch) {
    let vectors = patch.corners.iter().map(|c| corners[*c as usize]);
    patch.corner_vectors = vectors.collect();
    for part in &mut patch.parts {
        give_vectors(corners, &mut part.patch);
    }
}

/// Where each of some ascending numbers stands among more of them.
fn places_of(some: &[u32], all: &[u32]) -> Vec<u32> {
    some.iter()
        .map(|number| all.partition_point(|x| x < number) as u32)
        .collect()
}

/// The corners, edge by edge: for the border above each row where patches end, the columns before
/// which they end, and the number of the first corner there.
#[derive(Default)]
struct Edges(BTreeMap<usize, (Vec<usize>, u32)>);

impl Edges {
    fn add(&mut self, grid: Grid, patch: &Patch) {
        if !patch.parts.is_empty() {
            patch.parts.iter().for_each(|c| self.add(grid, &c.patch));
            return;
        }
        for row in [patch.rows.start, patch.rows.end] {
            for column in [patch.columns.start, patch.columns.end] {
                // All azimuths of the pole are one corner.
                let column = if row == 0 { 0 } else { column % grid.n_phi() };
                let (columns, _) = self.0.entry(row).or_default();
                if let Err(place) = columns.binary_search(&column) {
                    columns.insert(place, column);
                }
            }
        }
    }

    /// Numbers the corners, and gives their directions.
    fn number(&mut self, grid: Grid) -> Vec<Vec3> {
        let (step, mut corners) = (grid.step_deg(), Vec::new());
        for (row, (columns, first)) in &mut self.0 {
            *first = corners.len() as u32;
            let theta = (*row as f64 - 0.5).max(0.0) * step;
            for column in columns {
                let phi = (*column as f64 - 0.5) * step;
                corners.push(Direction::from_deg(theta, phi).to_vec3());
            }
        }
        corners
    }

    fn give_corners(&self, grid: Grid, patch: &mut Patch) {
        if patch.parts.is_empty() {
            self.give_leaf_corners(grid, patch);
            return;
        }
        for part in &mut patch.parts {
            self.give_corners(grid, &mut part.patch);
            patch.corners.extend(&part.patch.corners);
        }
        patch.corners.sort_unstable();
        patch.corners.dedup();
        patch.between = vec![[(0, 0.0); 4]; patch.directions.len()];
        for part in &mut patch.parts {
            part.corner_places = places_of(&part.patch.corners, &patch.corners);
            for (place, between) in part.places.iter().zip(&part.patch.between) {
                let in_parent =
                    |(corner, weight): (u32, f32)| (part.corner_places[corner as usize], weight);
                patch.between[*place as usize] = between.map(in_parent);
            }
        }
    }

    fn give_leaf_corners(&self, grid: Grid, patch: &mut Patch) {
        let (top, bottom) = (patch.rows.start, patch.rows.end);
        let between: Vec<Between> = patch
            .directions
            .iter()
            .map(|direction| {
                let (row, column) = (
                    *direction as usize / grid.n_phi(),
                    *direction as usize % grid.n_phi(),
                );
                // The pole is a row itself; all other borders lie half a step before theirs.
                let at = |row: usize| (row as f64 - 0.5).max(0.0);
                let down = ((row as f64 - at(top)) / (at(bottom) - at(top))) as f32;
                let [a, b] = self.along(grid, top, column);
                let [c, d] = self.along(grid, bottom, column);
                let up = 1.0 - down;
                [
                    (a.0, up * a.1),
                    (b.0, up * b.1),
                    (c.0, down * c.1),
                    (d.0, down * d.1),
                ]
            })
            .collect();
        patch.corners = between
            .iter()
            .flatten()
            .map(|(corner, _)| *corner)
            .collect();
        patch.corners.sort_unstable();
        patch.corners.dedup();
        let place = |(corner, weight)| {
            let place = patch.corners.partition_point(|c| *c < corner);
            (place as u32, weight)
        };
        patch.between = between.into_iter().map(|b| b.map(place)).collect();
    }

    /// The corners before and after the middle of a column, on an edge, with their weights.
    fn along(&self, grid: Grid, edge: usize, column: usize) -> [(u32, f32); 2] {
        let Some((columns, first)) = self.0.get(&edge) else {
            return [(0, 0.0); 2];
        };
        let (n, turn) = (columns.len(), grid.n_phi());
        let after = columns.partition_point(|c| *c <= column);
        let before = (after + n - 1) % n;
        let from = if after == 0 { turn } else { 0 };
        let start = columns[before] as f32 - from as f32;
        let end = columns.get(after).map_or(columns[0] + turn, |c| *c) as f32;
        let far = (column as f32 + 0.5 - start) / (end - start);
        let after = after % n;
        [
            (first + before as u32, 1.0 - far),
            (first + after as u32, far),
        ]
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
        for (step, sizes) in [
            (2.0, [8.0, 4.0]),
            (6.0, [12.0, 6.0]),
            (4.0, [8.0, 4.0]),
            (0.5, [8.0, 4.0]),
        ] {
            let grid = Grid::with_step_deg(step).unwrap();
            let patches = cover(grid, &sizes).patches;
            let at_pole = patches.iter().filter(|p| p.rows.start == 0).count();
            assert_eq!(at_pole, if step < 1.0 { 8 } else { 1 });
            let most = patches.iter().map(|p| p.directions.len()).max();
            assert!(most.unwrap() <= MOST_OF_CAP, "{most:?}");
            check(grid, &patches.iter().collect::<Vec<_>>(), sizes[0]);
            let parts: Vec<&Patch> = patches
                .iter()
                .flat_map(|p| p.parts.iter().map(|c| &c.patch))
                .collect();
            check(grid, &parts, sizes[1]);
        }
    }

    #[test]
    fn a_part_knows_its_places_in_the_whole() {
        for patch in cover(Grid::PAPER, &[8.0, 4.0]).patches {
            for part in &patch.parts {
                assert!(part.patch.parts.is_empty());
                for (place, direction) in part.places.iter().zip(&part.patch.directions) {
                    assert_eq!(patch.directions[*place as usize], *direction);
                }
                for (place, corner) in part.corner_places.iter().zip(&part.patch.corners) {
                    assert_eq!(patch.corners[*place as usize], *corner);
                }
            }
        }
    }

    #[test]
    fn corners_surround_each_direction_and_are_shared_by_neighbours() {
        for (step, sizes) in [(2.0, vec![8.0, 4.0]), (6.0, vec![12.0]), (1.0, vec![16.0])] {
            let grid = Grid::with_step_deg(step).unwrap();
            let cover = cover(grid, &sizes);
            let mut patches_at = vec![0; cover.corners.len()];
            for patch in &cover.patches {
                patch
                    .corners
                    .iter()
                    .for_each(|c| patches_at[*c as usize] += 1);
                let size = sizes[sizes.len() - 1];
                for (between, vector) in patch.between.iter().zip(&patch.vectors) {
                    // Linear between the corners is the direction itself, but for the sphere's
                    // curvature; the cap's widest edge is a third of a circle.
                    let mut sum = [0.0; 3];
                    let mut total = 0.0;
                    for (corner, weight) in between {
                        let at = cover.corners[patch.corners[*corner as usize] as usize];
                        assert!((0.0..=1.0).contains(weight));
                        total += weight;
                        for k in 0..3 {
                            sum[k] += f64::from(*weight) * at[k];
                        }
                    }
                    assert!((total - 1.0).abs() < 1e-6);
                    let off = angle_between(normalize(sum), *vector).to_degrees();
                    assert!(off < 0.15 * size, "{off} of {size}");
                }
            }
            // The pole, and corners of two rows of patches that never meet three at a time.
            let at_pole = cover.patches.iter().filter(|p| p.rows.start == 0);
            assert_eq!(patches_at[0], at_pole.count());
            let inner = cover
                .corners
                .iter()
                .zip(&patches_at)
                .filter(|(at, _)| at[2] > 0.2 && at[2] < 0.9);
            if sizes.len() == 1 {
                assert!(inner.into_iter().all(|(_, n)| (3..=4).contains(n)));
            }
        }
    }
}
