//! Where a cell's value comes from: measured, by reciprocity, by symmetry, interpolated or extrapolated.

use crate::bins::Bins;
use crate::direction::{Vec3, dot};
use crate::elementary::Elementary;
use crate::grid::Grid;
use rayon::prelude::*;
use std::ops::Range;

/// Where a cell's value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Origin {
    /// Samples fell into the cell.
    Measured = 0,
    /// Samples fell into the cell with light and view exchanged.
    Reciprocal = 1,
    /// Between measured directions.
    Interpolated = 2,
    /// Beyond all measured pairs of polar angles, or in a gap of the directions: a guess, however small
    /// its error seems.
    Extrapolated = 3,
    /// Samples fell into a cell that a symmetry of the material, alone or with reciprocity, makes the same.
    Symmetric = 4,
}

/// How many cells have their value from where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OriginCounts {
    /// [`Origin::Measured`].
    pub measured: u64,
    /// [`Origin::Reciprocal`].
    pub reciprocal: u64,
    /// [`Origin::Interpolated`].
    pub interpolated: u64,
    /// [`Origin::Extrapolated`].
    pub extrapolated: u64,
    /// [`Origin::Symmetric`].
    pub symmetric: u64,
}

impl OriginCounts {
    /// Counts what [`origins`] would give, without a visit to every cell.
    pub fn of<const N: usize>(bins: &Bins<N>) -> Self {
        let (grid, reach) = (bins.grid(), Reach::new(bins));
        let interpolated = reach.interpolated();
        let all = bins.bins();
        // Each bin's cell, and its reciprocal one where no bin is, come off what they would be else.
        let (reciprocal, known_interpolated) = all
            .par_iter()
            .map(|bin| {
                let (light, view) = grid.light_and_view(bin.cell as usize);
                let mirrored = grid.cell(view, light) as u64;
                let alone = all.binary_search_by_key(&mirrored, |b| b.cell).is_err();
                // Both have the same origin: what is near and within reach is so for either order.
                let within = reach.origin(light, view) == Origin::Interpolated;
                let cells = 1 + u64::from(alone);
                (u64::from(alone), cells * u64::from(within))
            })
            .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let measured = all.len() as u64;
        let interpolated = interpolated - known_interpolated;
        Self {
            measured,
            reciprocal,
            interpolated,
            extrapolated: grid.n_cells() as u64 - measured - reciprocal - interpolated,
            symmetric: 0,
        }
    }

    /// The same, of bins that hold images by a symmetry: `own` are the cells, ascending, into which samples fell themselves.
    pub fn with_images<const N: usize>(bins: &Bins<N>, own: &[u64]) -> Self {
        Self::of(bins).without_images(bins.grid(), own, |_| 1)
    }

    /// What is measured in more than one's own cells is so by symmetry; a cell stands for `repeats` ones.
    fn without_images(mut self, grid: Grid, own: &[u64], repeats: impl Fn(u64) -> u64) -> Self {
        let both = self.measured + self.reciprocal;
        let mirrored = |cell: u64| {
            let (light, view) = grid.light_and_view(cell as usize);
            grid.cell(view, light) as u64
        };
        let is_alone = |cell: &&u64| own.binary_search(&mirrored(**cell)).is_err();
        self.measured = own.iter().map(|cell| repeats(*cell)).sum();
        self.reciprocal = own.iter().filter(is_alone).map(|cell| repeats(*cell)).sum();
        self.symmetric = both - self.measured - self.reciprocal;
        self
    }

    /// Cells that are extrapolated, over all, 0 ..= 1.
    pub fn extrapolated_share(&self) -> f64 {
        let known = self.measured + self.reciprocal + self.symmetric;
        let all = known + self.interpolated + self.extrapolated;
        self.extrapolated as f64 / all.max(1) as f64
    }
}

/// Which cells are beyond all that was measured: beyond the pairs of polar angles (for each of one
/// direction, the largest of the other), or in a gap of the directions.
struct Reach {
    n_phi: usize,
    /// By row of the grid: one more than the highest row measured with this row or a higher one.
    rows: Vec<usize>,
    /// By direction: whether one near it was measured as light, and as view.
    near: [Vec<bool>; 2],
}

/// A direction farther than this from all measured ones lies in a gap: the paper's plan has steps of
/// 15°, and each frame spans some degrees.
const GAP_DEG: f64 = 15.0;

impl Reach {
    fn new<const N: usize>(bins: &Bins<N>) -> Self {
        let grid = bins.grid();
        let n_phi = grid.n_phi();
        let mut measured = [(); 2].map(|()| vec![false; grid.n_directions()]);
        for bin in bins.bins() {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            measured[0][light] = true;
            measured[1][view] = true;
        }
        let near = measured.map(|measured| near(grid, &measured));
        let rows = rows_within_reach(bins);
        Self { n_phi, rows, near }
    }

    /// Cells within reach, those of bins among them.
    fn interpolated(&self) -> u64 {
        let [lights, views] = &self.near;
        // By row, how many directions are near measured lights, views, and both.
        let rows: Vec<[u64; 3]> = lights
            .chunks(self.n_phi)
            .zip(views.chunks(self.n_phi))
            .map(|(lights, views)| {
                let count = |near: &dyn Fn(bool, bool) -> bool| {
                    let both = lights.iter().zip(views);
                    both.filter(|(l, v)| near(**l, **v)).count() as u64
                };
                [count(&|l, _| l), count(&|_, v| v), count(&|l, v| l && v)]
            })
            .collect();
        (0..lights.len())
            .map(|light| {
                let rows = &rows[..self.rows[light / self.n_phi].min(rows.len())];
                let (as_light, as_view) = (lights[light], views[light]);
                rows.iter()
                    .map(
                        |[near_lights, near_views, both]| match (as_light, as_view) {
                            (true, true) => near_lights + near_views - both,
                            (true, false) => *near_views,
                            (false, true) => *near_lights,
                            (false, false) => 0,
                        },
                    )
                    .sum::<u64>()
            })
            .sum()
    }

    fn origin(&self, light: usize, view: usize) -> Origin {
        let [lights, views] = &self.near;
        let no_gap = lights[light] && views[view] || lights[view] && views[light];
        if no_gap && view / self.n_phi < self.rows[light / self.n_phi] {
            Origin::Interpolated
        } else {
            Origin::Extrapolated
        }
    }
}

/// By row of the grid: one more than the highest row measured with this row or a higher one, of light and view in either
/// order. Rows from there on lie beyond all that was measured.
pub(super) fn rows_within_reach<const N: usize>(bins: &Bins<N>) -> Vec<usize> {
    let grid = bins.grid();
    let mut rows = vec![0; grid.n_theta()];
    for bin in bins.bins() {
        let (light, view) = grid.light_and_view(bin.cell as usize);
        let (i, v) = (light / grid.n_phi(), view / grid.n_phi());
        rows[i] = rows[i].max(v + 1);
        rows[v] = rows[v].max(i + 1);
    }
    for row in (1..rows.len()).rev() {
        rows[row - 1] = rows[row - 1].max(rows[row]);
    }
    rows
}

/// The directions within a gap's width of a measured one.
fn near(grid: Grid, measured: &[bool]) -> Vec<bool> {
    let vector = |d: usize| grid.direction(d).to_vec3();
    let measured_at: Vec<Vec3> = (0..measured.len())
        .filter(|d| measured[*d])
        .map(vector)
        .collect();
    let closest = GAP_DEG.to_radians().cosine();
    (0..measured.len())
        .into_par_iter()
        .map(|d| {
            let here = vector(d);
            measured[d] || measured_at.iter().any(|k| dot(*k, here) >= closest)
        })
        .collect()
}

/// Where the values of an isotropic BRDF come from: what is measured at one azimuth is so at all.
pub struct IsotropicOrigins {
    grid: Grid,
    /// Cells into which samples fell, ascending.
    own: Vec<u64>,
    /// By rows of light and of view, and the difference of azimuths: an [`Origin`] each.
    table: Vec<u8>,
}

impl IsotropicOrigins {
    /// Of bins; with `sides_alike`, what is measured on one side of the plane of incidence is so on the other.
    pub fn of<const N: usize>(bins: &Bins<N>, sides_alike: bool) -> Self {
        let grid = bins.grid();
        let (n_theta, n_phi) = (grid.n_theta(), grid.n_phi());
        let rows = rows_within_reach(bins);
        let mut measured = [(); 2].map(|()| vec![false; n_theta]);
        let mut cells = Vec::new();
        for bin in bins.bins() {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            let (i, v) = (light / n_phi, view / n_phi);
            let turn = (view % n_phi + n_phi - light % n_phi) % n_phi;
            measured[0][i] = true;
            measured[1][v] = true;
            cells.push([i, v, turn]);
            if sides_alike {
                cells.push([i, v, (n_phi - turn) % n_phi]);
            }
        }
        let gap = (GAP_DEG / grid.step_deg()) as usize;
        let near = measured.map(|rows| {
            let near = |row: usize| (0..n_theta).any(|k| rows[k] && k.abs_diff(row) <= gap);
            (0..n_theta).map(near).collect::<Vec<bool>>()
        });
        let mut table = vec![Origin::Extrapolated as u8; n_theta * n_theta * n_phi];
        for (pair, ring) in table.chunks_mut(n_phi).enumerate() {
            let (i, v) = (pair / n_theta, pair % n_theta);
            let no_gap = near[0][i] && near[1][v] || near[0][v] && near[1][i];
            if no_gap && v < rows[i] {
                ring.fill(Origin::Interpolated as u8);
            }
        }
        let mut set = |[i, v, turn]: [usize; 3], origin: Origin| {
            let ring = &mut table[(i * n_theta + v) * n_phi..][..n_phi];
            if i == 0 || v == 0 {
                ring.fill(origin as u8);
            } else {
                ring[turn] = origin as u8;
            }
        };
        for [i, v, turn] in &cells {
            set([*v, *i, (n_phi - turn) % n_phi], Origin::Reciprocal);
        }
        for cell in &cells {
            set(*cell, Origin::Measured);
        }
        let own = bins.bins().iter().map(|bin| bin.cell).collect();
        Self { grid, own, table }
    }

    /// How many cells have their value from where.
    pub fn counts(&self) -> OriginCounts {
        let count = |origin: Origin| {
            let cells = self.table.iter().filter(|o| **o == origin as u8).count();
            (cells * self.grid.n_phi()) as u64
        };
        let counts = OriginCounts {
            measured: count(Origin::Measured),
            reciprocal: count(Origin::Reciprocal),
            interpolated: count(Origin::Interpolated),
            extrapolated: count(Origin::Extrapolated),
            symmetric: 0,
        };
        counts.without_images(self.grid, &self.own, |cell| {
            let (light, view) = self.grid.light_and_view(cell as usize);
            (repeats(self.grid, light).len() * repeats(self.grid, view).len()) as u64
        })
    }

    /// An [`Origin`] a cell of the grid.
    pub fn of_cells(&self) -> Vec<u8> {
        let (n_theta, n_phi) = (self.grid.n_theta(), self.grid.n_phi());
        let n = self.grid.n_directions();
        let mut origins: Vec<u8> = (0..n)
            .into_par_iter()
            .flat_map_iter(|light| {
                (0..n).map(move |view| {
                    let (i, v) = (light / n_phi, view / n_phi);
                    let turn = (view % n_phi + n_phi - light % n_phi) % n_phi;
                    match self.table[(i * n_theta + v) * n_phi + turn] {
                        origin if origin <= Origin::Reciprocal as u8 => Origin::Symmetric as u8,
                        origin => origin,
                    }
                })
            })
            .collect();
        mark(&mut origins, self.grid, &self.own, |direction| {
            repeats(self.grid, direction)
        });
        origins
    }
}

/// The directions that are the same as this one: at the pole all of its azimuths.
fn repeats(grid: Grid, direction: usize) -> Range<usize> {
    match direction < grid.n_phi() {
        true => 0..grid.n_phi(),
        false => direction..direction + 1,
    }
}

/// Puts down which cells samples fell into, and which by reciprocity.
fn mark(origins: &mut [u8], grid: Grid, own: &[u64], repeats: impl Fn(usize) -> Range<usize>) {
    for origin in [Origin::Reciprocal, Origin::Measured] {
        for cell in own {
            let (light, view) = grid.light_and_view(*cell as usize);
            for light in repeats(light) {
                for view in repeats(view) {
                    let cell = match origin {
                        Origin::Measured => grid.cell(light, view),
                        _ => grid.cell(view, light),
                    };
                    origins[cell] = origin as u8;
                }
            }
        }
    }
}

/// Where each cell's value comes from, as an [`Origin`] a cell.
pub fn origins<const N: usize>(bins: &Bins<N>) -> Vec<u8> {
    let own: Vec<u64> = bins.bins().iter().map(|bin| bin.cell).collect();
    origins_with_images(bins, &own)
}

/// The same, of bins that hold images by a symmetry: `own` are the cells, ascending, into which samples fell themselves.
pub fn origins_with_images<const N: usize>(bins: &Bins<N>, own: &[u64]) -> Vec<u8> {
    let grid = bins.grid();
    let (reach, n) = (Reach::new(bins), grid.n_directions());
    let mut origins: Vec<u8> = (0..n)
        .into_par_iter()
        .flat_map_iter(|light| {
            let reach = &reach;
            (0..n).map(move |view| reach.origin(light, view) as u8)
        })
        .collect();
    if own.len() < bins.bins().len() {
        for bin in bins.bins() {
            let (light, view) = grid.light_and_view(bin.cell as usize);
            for cell in [grid.cell(light, view), grid.cell(view, light)] {
                origins[cell] = Origin::Symmetric as u8;
            }
        }
    }
    mark(&mut origins, grid, own, |direction| {
        direction..direction + 1
    });
    origins
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::direction::Direction;
    use crate::sample::Sample;
    use crate::symmetry::Symmetry;

    #[test]
    fn counts_are_those_of_the_cells() {
        let grid = Grid::with_step_deg(10.0).unwrap();
        // In plane; one azimuth of incidence; all over.
        for (light_turn, view_turn) in [(0.0, 180.0), (0.0, 37.0), (71.0, 37.0)] {
            let samples: Vec<Sample> = (0..60)
                .map(|k| {
                    let k = f64::from(k);
                    let light = Direction::from_deg(k * 7.0 % 70.0, k * light_turn);
                    let view = Direction::from_deg(k * 13.0 % 84.0, k * view_turn);
                    Sample::new(light, view, [1.0; 3])
                })
                .collect();
            let bins = Bins::new(grid, &samples);
            let cells = origins(&bins);
            let count =
                |origin: Origin| cells.iter().filter(|o| **o == origin as u8).count() as u64;
            let counted = OriginCounts {
                measured: count(Origin::Measured),
                reciprocal: count(Origin::Reciprocal),
                interpolated: count(Origin::Interpolated),
                extrapolated: count(Origin::Extrapolated),
                symmetric: 0,
            };
            assert_eq!(OriginCounts::of(&bins), counted);
            assert!(counted.reciprocal > 0 && counted.extrapolated > 0);
        }
    }

    #[test]
    fn what_an_image_shows_is_by_symmetry_and_not_measured() {
        let grid = Grid::with_step_deg(10.0).unwrap();
        let samples: Vec<Sample> = (0..40)
            .map(|k| {
                let k = f64::from(k);
                let light = Direction::from_deg(k * 7.0 % 70.0, 10.0);
                let view = Direction::from_deg(k * 13.0 % 84.0, k * 37.0);
                Sample::new(light, view, [1.0; 3])
            })
            .collect();
        let plain = Bins::new(grid, &samples);
        let own: Vec<u64> = plain.bins().iter().map(|bin| bin.cell).collect();
        let completed = Bins::new(grid, &Symmetry::HalfTurn.completed(samples));
        let isotropic = IsotropicOrigins::of(&plain, true);
        let both = [
            (
                origins_with_images(&completed, &own),
                OriginCounts::with_images(&completed, &own),
            ),
            (isotropic.of_cells(), isotropic.counts()),
        ];
        for (cells, counted) in both {
            let count =
                |origin: Origin| cells.iter().filter(|o| **o == origin as u8).count() as u64;
            let found = OriginCounts {
                measured: count(Origin::Measured),
                reciprocal: count(Origin::Reciprocal),
                interpolated: count(Origin::Interpolated),
                extrapolated: count(Origin::Extrapolated),
                symmetric: count(Origin::Symmetric),
            };
            assert_eq!(found, counted);
            assert!(
                own.iter()
                    .all(|cell| cells[*cell as usize] == Origin::Measured as u8)
            );
            assert!(counted.symmetric > 30, "{counted:?}");
            // Half a turn on, the same was measured; nothing was there.
            let (light, view) = (grid.nearest(7.0, 190.0), grid.nearest(13.0, 217.0));
            let cell = grid.cell(light.unwrap(), view.unwrap());
            assert_eq!(cells[cell], Origin::Symmetric as u8);
        }
    }
}
