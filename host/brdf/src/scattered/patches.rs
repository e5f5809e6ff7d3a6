//! Pairs of patches of directions that all cells of a grid follow from: by reciprocity, by half a turn, and where the
//! material has a plane of symmetry, side by side with those beyond it.

use super::quadratic::Cells;
use crate::elementary::Elementary;
use crate::grid::Grid;
use crate::symmetry::{MirrorPlane, Symmetry};
use std::ops::Range;

/// Side of the patches of directions that the work begins with, degrees.
const PATCH_DEG: f64 = 16.0;

/// The first row and column of a patch of directions, and their ends. Columns may go on beyond the last one, with the
/// first.
type Patch = [[usize; 2]; 2];

/// A pair of patches, and the pair beyond the plane of symmetry whose cells have the same systems.
#[derive(Clone, Copy, Debug)]
pub(super) struct PatchPair {
    pub cells: Cells,
    pub beyond: Option<Beyond>,
}

/// The cells beyond a plane of symmetry, to the nearest one: columns become those that they are less than these sums.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beyond {
    pub cells: Cells,
    sums: [usize; 2],
}

impl Beyond {
    /// Those of a part of the pair.
    pub fn of(&self, part: &Cells) -> Cells {
        let mut beyond = *part;
        for (sum, axis) in self.sums.iter().zip([1, 3]) {
            beyond.start[axis] = sum - part.end[axis];
            beyond.end[axis] = sum - part.start[axis];
        }
        beyond
    }
}

/// All patches, and which ones symmetries make of them.
struct Patches {
    all: Vec<Patch>,
    /// Numbers of the patches half a turn on, where half a turn is a symmetry.
    turned: Option<Vec<usize>>,
    /// Numbers of those beyond the plane of symmetry.
    beyond: Option<Vec<usize>>,
    /// What the ends of columns and of their images add up to, up to whole turns.
    sum: usize,
}

/// The pairs of patches that all others follow from, those beyond the plane of the symmetry as pairs of their own or side
/// by side.
pub(super) fn pairs(grid: Grid, symmetry: Symmetry, side_by_side: bool) -> Vec<PatchPair> {
    let plane = symmetry.plane().filter(|_| side_by_side);
    let patches = Patches::new(grid, symmetry.has_half_turn(), plane);
    let mut pairs = Vec::new();
    for p in 0..patches.all.len() {
        for q in p..patches.all.len() {
            pairs.extend(patches.pair((p, q), grid));
        }
    }
    pairs
}

/// Rings of lights whose cells are filled together, so many at most: whole rings of patches as far as that is possible, so
/// that few pairs of patches are filled twice.
pub(super) fn bands(grid: Grid, at_most: usize) -> Vec<Range<usize>> {
    let at_most = at_most.max(1);
    let mut bands: Vec<Range<usize>> = Vec::new();
    for ring in rings(grid) {
        let [[mut first, _], [end, _]] = ring[0];
        if let Some(last) = bands.last_mut()
            && end - last.start <= at_most
        {
            last.end = end;
            continue;
        }
        while first < end {
            let next = end.min(first + at_most);
            bands.push(first..next);
            first = next;
        }
    }
    bands
}

fn in_order(p: usize, q: usize) -> (usize, usize) {
    (p.min(q), p.max(q))
}

impl Patches {
    fn new(grid: Grid, has_half_turn: bool, plane: Option<MirrorPlane>) -> Self {
        let turn = grid.n_phi();
        let rings = rings(grid);
        // A plane lies half a sum of columns from azimuth 0, about.
        let sum = plane.map(|plane| {
            let columns = 2.0 * plane.azimuth_deg() / grid.step_deg();
            (columns.round() as usize + 1) % turn
        });
        let fits = |ring: &Vec<Patch>| ring.len() == 1 || turn >= 2 * symmetric_count(ring.len());
        let sum = sum.filter(|_| turn.is_multiple_of(2) && rings.iter().all(fits));
        let rings: Vec<Vec<Patch>> = match sum {
            Some(sum) => rings.iter().map(|r| symmetric(r, sum, turn)).collect(),
            None => rings,
        };
        let numbers = |image: &dyn Fn(usize, usize) -> usize| {
            let mut numbers = Vec::new();
            for ring in &rings {
                let (first, n) = (numbers.len(), ring.len());
                numbers.extend((0..n).map(|k| first + image(k, n)));
            }
            numbers
        };
        let turned = |k: usize, n: usize| (k + n / 2) % n;
        Self {
            turned: has_half_turn.then(|| numbers(&turned)),
            beyond: sum.map(|_| numbers(&|k, n| (n - k) % n)),
            sum: sum.unwrap_or(0),
            all: rings.into_iter().flatten().collect(),
        }
    }

    /// A pair, unless another one stands for it.
    fn pair(&self, (p, q): (usize, usize), grid: Grid) -> Option<PatchPair> {
        let image = |of: &Option<Vec<usize>>, (p, q): (usize, usize)| {
            of.as_ref().map(|of| in_order(of[p], of[q]))
        };
        let turned = image(&self.turned, (p, q));
        if turned.is_some_and(|turned| turned < (p, q)) {
            return None;
        }
        // The two orders of a pair of one patch are one beyond the other.
        let beyond = image(&self.beyond, (p, q)).filter(|_| p != q);
        let beyond = beyond.filter(|beyond| *beyond != (p, q) && Some(*beyond) != turned);
        let other = beyond.and_then(|beyond| image(&self.turned, beyond));
        let stands_for = |other: Option<(usize, usize)>| other.is_some_and(|o| o < (p, q));
        if stands_for(beyond) || beyond.is_some() && stands_for(other) {
            return None;
        }
        let ([a, b], [c, d]) = (self.all[p], self.all[q]);
        let cells = Cells {
            start: [a[0], a[1], c[0], c[1]],
            end: [b[0], b[1], d[0], d[1]],
            is_own: p == q,
            is_turned: turned.is_some_and(|turned| turned != (p, q)),
        };
        let beyond = beyond.map(|_| self.beyond(cells, grid));
        Some(PatchPair { cells, beyond })
    }

    fn beyond(&self, cells: Cells, grid: Grid) -> Beyond {
        let turn = grid.n_phi();
        let sums = [1, 3].map(|axis| match cells.start[axis - 1] {
            // All azimuths of the pole are one direction.
            0 => 1,
            _ => cells.end[axis] + (self.sum + 2 * turn - cells.end[axis]) % turn,
        });
        let mut beyond = Beyond { cells, sums };
        beyond.cells = beyond.of(&cells);
        beyond
    }
}

/// Patches of directions, about as wide as high, ring by ring: the pole, then even numbers of them.
fn rings(grid: Grid) -> Vec<Vec<Patch>> {
    let (n_theta, n_phi) = (grid.n_theta(), grid.n_phi());
    let count = ((n_theta - 1) as f64 * grid.step_deg() / PATCH_DEG).ceil() as usize;
    let count = count.clamp(1, (n_theta - 1).max(1));
    // All azimuths of the pole are one direction.
    let mut rings = vec![vec![[[0, 0], [1, 1]]]];
    for ring in 0..count {
        let [first, end] = [ring, ring + 1].map(|r| 1 + r * (n_theta - 1) / count);
        let theta = (0.5 * (first + end - 1) as f64 * grid.step_deg()).to_radians();
        let across = 2 * (180.0 * theta.sine() / PATCH_DEG).ceil() as usize;
        let across = across.clamp(4, n_phi);
        let patch = |k: usize| {
            let [left, right] = [k, k + 1].map(|k| k * n_phi / across);
            [[first, left], [end, right]]
        };
        rings.push((0..across).map(patch).collect());
    }
    rings
}

/// As many patches as make four equal quarters.
fn symmetric_count(across: usize) -> usize {
    across.next_multiple_of(4)
}

/// A ring whose patches are images of each other beyond the plane at half a sum of columns, and half a turn on: the
/// first lies about the plane.
fn symmetric(ring: &[Patch], sum: usize, turn: usize) -> Vec<Patch> {
    if ring.len() == 1 {
        return ring.to_vec();
    }
    let [[first, _], [end, _]] = ring[0];
    let n = symmetric_count(ring.len());
    // Ends of patches in a quarter of a turn from the plane on; the others are their images.
    let half_turn = turn / 2;
    let quarter = |k: usize| {
        let columns = (0.5 * sum as f64 + (k as f64 + 0.5) * turn as f64 / n as f64).round();
        columns as usize
    };
    let half: Vec<usize> = (0..n / 2)
        .map(|k| match k < n / 4 {
            true => quarter(k),
            false => sum + half_turn - quarter(n / 2 - 1 - k),
        })
        .collect();
    let ends: Vec<usize> = half
        .iter()
        .copied()
        .chain(half.iter().map(|end| end + half_turn))
        .collect();
    (0..n)
        .map(|k| {
            let right = ends[k] + turn;
            let left = match k {
                0 => ends[n - 1],
                _ => ends[k - 1] + turn,
            };
            let start = left % turn;
            [[first, start], [end, start + right - left]]
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// How often each cell is filled.
    fn filled(grid: Grid, symmetry: Symmetry) -> (Vec<u8>, usize, usize) {
        let mut filled = vec![0u8; grid.n_cells()];
        let (mut all, mut shared) = (0, 0);
        for pair in pairs(grid, symmetry, true) {
            all += pair.cells.count();
            shared += pair.beyond.map_or(0, |beyond| beyond.cells.count());
            for cells in [Some(pair.cells), pair.beyond.map(|b| b.cells)] {
                let Some(cells) = cells else { continue };
                let turns: &[usize] = match cells.is_turned {
                    true => &[0, grid.n_phi() / 2],
                    false => &[0],
                };
                for turn in turns {
                    let [lights, views] = [0, 2].map(|axis| cells.directions(axis, grid, *turn));
                    for l in &lights {
                        for v in &views {
                            filled[grid.cell(*l, *v)] += 1;
                            if !cells.is_own {
                                filled[grid.cell(*v, *l)] += 1;
                            }
                        }
                    }
                }
            }
        }
        (filled, all, shared)
    }

    #[test]
    fn every_cell_is_filled_once_and_with_a_plane_nearly_half_of_them_by_systems_of_others() {
        for step_deg in [5.0, 7.5, 30.0] {
            let grid = Grid::with_step_deg(step_deg).unwrap();
            let is_pole = |d: usize| d > 0 && d < grid.n_phi();
            let mut symmetries = vec![Symmetry::None, Symmetry::HalfTurn];
            for azimuth_deg in [0.0, 22.8, 113.1, 179.99] {
                let plane = MirrorPlane::at_deg(azimuth_deg);
                symmetries.push(Symmetry::Bilateral(plane));
                symmetries.push(Symmetry::HalfTurnBilateral(plane));
            }
            for symmetry in symmetries {
                let (filled, all, shared) = filled(grid, symmetry);
                for l in 0..grid.n_directions() {
                    for v in 0..grid.n_directions() {
                        let expected = u8::from(!is_pole(l) && !is_pole(v));
                        let found = filled[grid.cell(l, v)];
                        assert_eq!(found, expected, "{symmetry}, {step_deg}: {l} {v}");
                    }
                }
                if symmetry.plane().is_some() && step_deg < 30.0 {
                    assert!(10 * shared > 8 * all, "{symmetry}: {shared} of {all}");
                }
            }
        }
    }
}
