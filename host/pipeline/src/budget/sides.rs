//! From which side a cell's value comes: from samples at its light and view, or with both exchanged.

use crate::budget::patches::Patches;
use gonia_brdf::direction::{Vec3, dot, normalize};
use gonia_brdf::interpolate::Origin;
use gonia_brdf::{Direction, Elementary, Grid};

/// Directions of a patch, about so wide, have samples about them in the same proportion.
const PATCH_DEG: f64 = 10.0;
/// Samples count by Gaussians of these widths over the distance, each of the same mass: about by its fourth power, as the
/// nearest count most where values are interpolated.
const REACHES_DEG: [f64; 4] = [5.0, 10.0, 20.0, 40.0];

/// Directions of samples without a table are those of the nearest nodes of a grid of this step.
const STEP_DEG: f64 = 6.0;

/// Which samples lie where, of a fit that has no table.
pub(crate) struct SidesOfSamples {
    grid: Grid,
    sides: Sides,
}

impl SidesOfSamples {
    /// Of the directions of light and view of samples that no symmetry is taken for.
    pub fn of(samples: impl Iterator<Item = (Direction, Direction)>) -> Option<Self> {
        let grid = Grid::with_step_deg(STEP_DEG).ok()?;
        let mut origins = vec![Origin::Interpolated as u8; grid.n_cells()];
        for (light, view) in samples {
            origins[grid.cell(node(grid, light), node(grid, view))] = Origin::Measured as u8;
        }
        let sides = Sides::of(grid, &origins);
        Some(Self { grid, sides })
    }

    /// The share, 0 ..= 1, of a value that comes from samples at these directions, not at the exchanged ones.
    pub fn there(&self, light: Direction, view: Direction) -> f64 {
        let [light, view] = [light, view].map(|d| node(self.grid, d));
        self.sides.there(light, view)
    }
}

/// The node nearest to a direction; beyond the last ring one of that.
fn node(grid: Grid, direction: Direction) -> usize {
    let (theta, phi) = (direction.theta_deg(), direction.phi_deg());
    let last = (grid.n_theta() - 1) as f64 * grid.step_deg();
    grid.nearest(theta.min(last), phi).unwrap_or(0)
}

/// Of each cell, which share of its value comes from samples at its own light and view.
pub(super) struct Sides {
    /// The patch of each direction …
    patches: Vec<u32>,
    /// … and by patches of light and view the share; empty where it is not known.
    shares: Vec<f32>,
    count: usize,
    /// Of each light the views that samples have with it, ascending …
    views: Vec<Vec<u32>>,
    /// … and of each view the lights.
    lights: Vec<Vec<u32>>,
}

impl Sides {
    /// Of a table of which it is not known: half of a value comes from either.
    pub fn unknown() -> Self {
        Self {
            patches: Vec::new(),
            shares: Vec::new(),
            count: 0,
            views: Vec::new(),
            lights: Vec::new(),
        }
    }

    /// Of a table's origins ([`Origin`]), in the grid's order. Values that a symmetry makes the same have samples elsewhere
    /// about them: of such a table it is not known, nor of one whose origins are not.
    pub fn of(grid: Grid, origins: &[u8]) -> Self {
        let measured = |origin: &u8| *origin == Origin::Measured as u8;
        let is_unknown = origins.len() != grid.n_cells()
            || !origins.iter().any(measured)
            || origins.contains(&(Origin::Symmetric as u8));
        if is_unknown {
            return Self::unknown();
        }
        let patches = Patches::of(grid, PATCH_DEG);
        let (n, count) = (grid.n_directions(), patches.count);
        let of: Vec<u32> = (0..n).map(|d| patches.of_direction(d) as u32).collect();
        let mut centres = vec![[0.0; 3]; count];
        for (index, patch) in of.iter().enumerate() {
            let d = grid.direction(index).to_vec3();
            (0..3).for_each(|k| centres[*patch as usize][k] += d[k]);
        }
        let centres: Vec<Vec3> = centres.into_iter().map(normalize).collect();
        let mut found = vec![0.0; count * count];
        let [mut views, mut lights] = [(); 2].map(|()| vec![Vec::new(); n]);
        for (cell, origin) in origins.iter().enumerate() {
            if measured(origin) {
                let (light, view) = grid.light_and_view(cell);
                found[of[light] as usize * count + of[view] as usize] += 1.0;
                views[light].push(view as u32);
                lights[view].push(light as u32);
            }
        }
        let about = densities(&centres, &found);
        let share = |k: usize| {
            let (there, exchanged) = (about[k], about[k % count * count + k / count]);
            let both = there + exchanged;
            (if both > 0.0 { there / both } else { 0.5 }) as f32
        };
        Self {
            patches: of,
            shares: (0..count * count).map(share).collect(),
            count,
            views,
            lights,
        }
    }

    /// The share, 0 ..= 1, of a cell's value that comes from samples at its own light and view.
    pub fn there(&self, light: usize, view: usize) -> f64 {
        if self.shares.is_empty() {
            return 0.5;
        }
        let has = |of: &[Vec<u32>]| of[light].binary_search(&(view as u32)).is_ok();
        match (has(&self.views), has(&self.lights)) {
            (true, true) => 0.5,
            (true, false) => 1.0,
            (false, true) => 0.0,
            (false, false) => {
                let [light, view] = [light, view].map(|d| self.patches[d] as usize);
                f64::from(self.shares[light * self.count + view])
            }
        }
    }

    /// The same of all views of a light, of a grid with so many directions.
    pub fn row(&self, light: usize, directions: usize) -> Vec<f32> {
        if self.shares.is_empty() {
            return vec![0.5; directions];
        }
        let of_patch = &self.shares[self.patches[light] as usize * self.count..][..self.count];
        let shares = self.patches.iter().map(|patch| of_patch[*patch as usize]);
        let mut row: Vec<f32> = shares.collect();
        for view in self.views[light].iter().chain(&self.lights[light]) {
            row[*view as usize] = self.there(light, *view as usize) as f32;
        }
        row
    }
}

/// How many samples lie about each pair of patches, in proportion.
fn densities(centres: &[Vec3], found: &[f64]) -> Vec<f64> {
    let count = centres.len();
    let mut sum = vec![0.0; count * count];
    for reach in REACHES_DEG {
        let per_square = 0.5 / reach.to_radians().powi(2);
        // Of light and of view alike: the Gaussian of both is their product.
        let near: Vec<f64> = (0..count * count)
            .map(|k| {
                let square = 2.0 - 2.0 * dot(centres[k / count], centres[k % count]);
                (-square.max(0.0) * per_square).exponential()
            })
            .collect();
        let over_views = product(found, &near, count);
        let over_both = product(&near, &over_views, count);
        let mass = reach.powi(-4);
        for (sum, of) in sum.iter_mut().zip(over_both) {
            *sum += mass * of;
        }
    }
    sum
}

/// The product of two square matrices; rows of the first are mostly empty.
fn product(a: &[f64], b: &[f64], count: usize) -> Vec<f64> {
    let mut out = vec![0.0; count * count];
    for (row, out) in a.chunks(count).zip(out.chunks_mut(count)) {
        for (factor, line) in row.iter().zip(b.chunks(count)) {
            if *factor > 1e-12 {
                for (out, of) in out.iter_mut().zip(line) {
                    *out += factor * of;
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_follow_the_side_on_which_their_samples_lie() {
        let grid = Grid::with_step_deg(6.0).unwrap();
        let at = |theta: f64, phi: f64| grid.nearest(theta, phi).unwrap();
        let mut origins = vec![Origin::Interpolated as u8; grid.n_cells()];
        let mut measure = |light: usize, view: usize| {
            origins[grid.cell(view, light)] = Origin::Reciprocal as u8;
            origins[grid.cell(light, view)] = Origin::Measured as u8;
        };
        let (steep, low) = (at(60.0, 0.0), at(12.0, 180.0));
        measure(steep, low);
        // A pair that is measured in both ways.
        let (one, other) = (at(30.0, 90.0), at(30.0, 270.0));
        measure(one, other);
        origins[grid.cell(other, one)] = Origin::Measured as u8;
        let sides = Sides::of(grid, &origins);
        assert_eq!(sides.there(steep, low), 1.0);
        assert_eq!(sides.there(low, steep), 0.0);
        assert_eq!(sides.there(one, other), 0.5);
        let n = grid.n_directions();
        for light in [steep, low, one, other] {
            let row = sides.row(light, n);
            assert!((0..n).all(|view| f64::from(row[view]) == sides.there(light, view)));
        }
        // Near one of them nearly so, and of both orders all.
        let (beside, below) = (at(66.0, 12.0), at(18.0, 180.0));
        let there = sides.there(beside, below);
        assert!(there > 0.9, "{there}");
        assert!((there + sides.there(below, beside) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_fit_of_samples_knows_its_side_and_the_horizon_is_no_matter() {
        let at = Direction::from_deg;
        let sides = SidesOfSamples::of([(at(60.0, 1.0), at(13.0, 181.0))].into_iter()).unwrap();
        assert_eq!(sides.there(at(61.0, 0.0), at(12.0, 180.0)), 1.0);
        assert_eq!(sides.there(at(12.0, 180.0), at(61.0, 0.0)), 0.0);
        assert!(sides.there(at(90.0, 0.0), at(20.0, 180.0)) > 0.8);
        let none = SidesOfSamples::of(std::iter::empty()).unwrap();
        assert_eq!(none.there(at(10.0, 0.0), at(20.0, 0.0)), 0.5);
    }

    #[test]
    fn of_a_table_that_is_symmetric_or_whose_origins_nobody_knows_it_is_half() {
        let grid = Grid::with_step_deg(10.0).unwrap();
        let mut origins = vec![Origin::Interpolated as u8; grid.n_cells()];
        origins[5] = Origin::Measured as u8;
        origins[7] = Origin::Symmetric as u8;
        for origins in [&origins[..], &[]] {
            assert_eq!(Sides::of(grid, origins).there(0, 5), 0.5);
        }
    }
}
