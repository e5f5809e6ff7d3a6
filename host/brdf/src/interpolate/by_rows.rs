//! A fill row by row, for grids whose cells do not fit memory (1°: a thousand million, 12 GB), and for several
//! processes that share one.
//!
//! Every pair of patches is solved once. Its cells are kept elsewhere ([`KeptCells`]: on a disk) until what all
//! pairs give at their corners is known; then they are shifted to it, and written into the rows of either
//! patch. The same numbers in the same order give the same bits, so that the result is as reciprocal as one
//! in memory, and the same.

use super::FillSettings;
use super::blend::{AtCorners, Corners, Shifts};
use super::block::kernel::{AnyKernel, NewBlock};
use super::data::Data;
use super::exponential::exponentials;
use super::fill::{FillError, Task};
use super::patches::{Cover, Patch, cover};
use super::refine::Solved;
use crate::grid::Grid;
use crate::progress::Progress;
use pulp::Arch;
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// The first half: solves pairs of patches.
pub struct Solver<'a, const N: usize = 3> {
    task: Task<'a, N>,
}

/// The second half: makes rows of what was solved. It needs no data.
pub struct Rows {
    grid: Grid,
    cover: Cover,
    blend_limit: f32,
}

/// Keeps the logarithms of cells from the solving of their pairs to the writing of their rows: by patch, those of its
/// pairs with itself and all later ones that do not follow from their corners.
pub trait KeptCells<const N: usize>: Sync {
    /// Why it cannot.
    type Error: From<FillError> + Send;

    /// Keeps all that a patch has, and what its pairs give at their corners.
    ///
    /// # Errors
    /// When they cannot be kept.
    fn put(
        &self,
        patch: usize,
        at_corners: &AtCorners<N>,
        cells: &[[f32; N]],
    ) -> Result<(), Self::Error>;

    /// Some of a patch's cells, appended to `into`.
    ///
    /// # Errors
    /// When they cannot be had.
    fn get(
        &self,
        patch: usize,
        cells: Range<usize>,
        into: &mut Vec<[f32; N]>,
    ) -> Result<(), Self::Error>;
}

/// Neighbouring rings of patches: what writes whole polar angles of the light.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Band {
    /// Its patches.
    pub patches: Range<usize>,
    /// Its polar angles of the light, by their numbers on the grid.
    pub rings: Range<usize>,
}

/// Takes a row: its number, and of each channel a value a view.
pub type TakeRow<'a, const N: usize, E> =
    &'a (dyn Fn(usize, [&[f32]; N]) -> Result<(), E> + Sync + 'a);

/// Working memory of one thread.
struct Work<const N: usize> {
    logs: Vec<[f32; N]>,
    shifts: Shifts<N>,
    arch: Arch,
}

impl<'a, const N: usize> Solver<'a, N>
where
    dyn AnyKernel: NewBlock<N>,
{
    /// Of data and settings.
    ///
    /// # Errors
    /// Too few bins.
    pub fn new(data: &'a Data<'a, N>, settings: &'a FillSettings) -> Result<Self, FillError> {
        let task = Task::new(data, settings)?;
        Ok(Self { task })
    }

    /// Solves the pairs of some patches with themselves and all later ones. `progress` is called with the share
    /// done, from any thread.
    ///
    /// # Errors
    /// The first of `kept`'s; cancelled.
    pub fn solve<K: KeptCells<N>>(
        &self,
        patches: Vec<usize>,
        kept: &K,
        progress: &Progress<'_>,
    ) -> Result<Vec<AtCorners<N>>, K::Error> {
        let each = |cells: &mut Vec<[f32; N]>, solved: Solved<'_, N>, _: (&Patch, &Patch)| {
            if !solved.is_smooth {
                cells.extend_from_slice(solved.cells);
            }
        };
        let done = |patch, at_corners: &AtCorners<N>, cells: Vec<[f32; N]>| {
            kept.put(patch, at_corners, &cells)
        };
        self.task
            .solve_pairs(patches, false, progress, &each, &done)
    }
}

impl Rows {
    /// Of a grid, with the settings that its pairs of patches are solved with.
    pub fn new(grid: Grid, settings: &FillSettings) -> Self {
        Self {
            grid,
            cover: cover(grid, &settings.patch_sizes_deg()),
            blend_limit: settings.blend_limit(),
        }
    }

    /// How many patches there are.
    pub fn patches(&self) -> usize {
        self.cover.patches.len()
    }

    /// The bands, from the pole on: together all patches and all polar angles, each once.
    pub fn bands(&self) -> Vec<Band> {
        // Patches come ring by ring of patches.
        let mut bands: Vec<Band> = Vec::new();
        for (number, patch) in self.cover.patches.iter().enumerate() {
            match bands.last_mut() {
                Some(band) if band.rings == patch.rows => band.patches.end = number + 1,
                _ => bands.push(Band {
                    patches: number..number + 1,
                    rings: patch.rows.clone(),
                }),
            }
        }
        bands
    }

    /// Whether something may be what the pairs of a patch give at their corners.
    pub fn is_of_patch<const N: usize>(&self, patch: usize, at_corners: &AtCorners<N>) -> bool {
        let Some(later) = self.cover.patches.get(patch..) else {
            return false;
        };
        let of_later: usize = later.iter().map(|q| q.corners.len()).sum();
        let here = later.first().map_or(0, |p| p.corners.len());
        at_corners.smooth.len() == later.len() && at_corners.values.len() == here * of_later
    }

    /// Averages at the corners, of all patches in their order, each [as it must be](Self::is_of_patch).
    pub fn corners<const N: usize>(&self, of_patches: Vec<AtCorners<N>>) -> Corners<N> {
        Corners::new(&self.cover, of_patches, self.blend_limit)
    }

    /// Makes all rows of lights in some patches, and gives each to `take`, in no order and from several threads.
    /// A thread holds the rows of one patch.
    ///
    /// # Errors
    /// The first of `take`'s or `kept`'s; cancelled.
    pub fn each_row<K: KeptCells<N>, const N: usize>(
        &self,
        patches: Range<usize>,
        corners: &Corners<N>,
        kept: &K,
        progress: &Progress<'_>,
        take: TakeRow<'_, N, K::Error>,
    ) -> Result<(), K::Error> {
        let count = patches.len();
        let places = self.places(corners);
        let done = AtomicUsize::new(0);
        let work = || Work {
            logs: Vec::new(),
            shifts: Shifts::default(),
            arch: Arch::new(),
        };
        patches
            .into_par_iter()
            .with_max_len(1)
            .try_for_each_init(work, |work, p| {
                self.rows_of_patch(work, p, corners, &places, kept, take)?;
                match progress((done.fetch_add(1, Relaxed) + 1) as f64 / count as f64) {
                    ControlFlow::Continue(()) => Ok(()),
                    ControlFlow::Break(()) => Err(FillError::Cancelled.into()),
                }
            })
    }

    /// Where among the kept cells of each patch those of its pairs begin.
    fn places<const N: usize>(&self, corners: &Corners<N>) -> Vec<Vec<usize>> {
        let patches = &self.cover.patches;
        let of_patch = |p: usize| {
            let mut place = 0;
            let of_pair = |q: usize| {
                let here = place;
                if !corners.is_smooth(p, q) {
                    place += patches[p].directions.len() * patches[q].directions.len();
                }
                here
            };
            (p..patches.len()).map(of_pair).collect()
        };
        (0..patches.len()).map(of_patch).collect()
    }

    fn rows_of_patch<K: KeptCells<N>, const N: usize>(
        &self,
        work: &mut Work<N>,
        p: usize,
        corners: &Corners<N>,
        places: &[Vec<usize>],
        kept: &K,
        take: TakeRow<'_, N, K::Error>,
    ) -> Result<(), K::Error> {
        let patches = &self.cover.patches;
        let (n, n_phi) = (self.grid.n_directions(), self.grid.n_phi());
        let lights = &patches[p].directions;
        let mut rows: [Vec<f32>; N] = std::array::from_fn(|_| vec![0.0f32; lights.len() * n]);
        for q in 0..patches.len() {
            let (first, second) = (p.min(q), p.max(q));
            work.logs.clear();
            if !corners.is_smooth(first, second) {
                let from = places[first][second - first];
                let count = patches[first].directions.len() * patches[second].directions.len();
                kept.get(first, from..from + count, &mut work.logs)?;
            }
            self.write_pair(work, (p, q), corners, &mut rows);
        }
        for (k, light) in lights.iter().enumerate() {
            let mut row = rows.each_mut().map(|plane| &mut plane[k * n..(k + 1) * n]);
            // The pole's value, computed at azimuth 0, is that of all azimuths.
            for plane in &mut row {
                let pole = plane[0];
                plane[1..n_phi].fill(pole);
            }
            let row = row.map(|plane| &*plane);
            let copies = if *light == 0 { n_phi } else { 1 };
            for azimuth in 0..copies {
                take(*light as usize + azimuth, row)?;
            }
        }
        Ok(())
    }

    /// Writes the cells of lights in patch `p` and views in patch `q`, of which the logarithms are there unless they
    /// follow from their corners.
    fn write_pair<const N: usize>(
        &self,
        work: &mut Work<N>,
        (p, q): (usize, usize),
        corners: &Corners<N>,
        rows: &mut [Vec<f32>; N],
    ) {
        let patches = &self.cover.patches;
        let n = self.grid.n_directions();
        let (first, second) = (p.min(q), p.max(q));
        corners.blend(
            &self.cover,
            (first, second),
            &mut work.logs,
            &mut work.shifts,
        );
        exponentials(work.arch, &mut work.logs);
        let width = patches[second].directions.len();
        for a in 0..patches[p].directions.len() {
            for (b, view) in patches[q].directions.iter().enumerate() {
                // Within one patch the first order of a pair serves for both, as in memory.
                let swap = q < p || (p == q && b < a);
                let place = if swap { b * width + a } else { a * width + b };
                for c in 0..N {
                    rows[c][a * n + *view as usize] = work.logs[place][c];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fill;
    use super::*;
    use crate::bins::Bins;
    use crate::model::{Brdf, Kurt};
    use crate::progress::silent;
    use crate::sample::Sample;
    use std::collections::BTreeMap;
    use std::sync::Mutex;

    #[test]
    fn rows_are_those_of_a_fill_in_memory_to_the_bit() {
        assert_rows_are_those_in_memory(6.0, 24.0, 1);
    }

    #[test]
    fn rows_of_several_patches_at_the_pole_are_those_in_memory_too() {
        assert_rows_are_those_in_memory(4.0, 72.0, 2);
    }

    /// On a grid, with patches of a size, of which so many are at the pole.
    fn assert_rows_are_those_in_memory(step_deg: f64, block_deg: f64, at_pole: usize) {
        let model = Kurt::two_thread_fabric();
        let grid = Grid::with_step_deg(step_deg).unwrap();
        let samples: Vec<Sample> = (0..40_000)
            .map(|k| {
                let at = |a: f64, to: f64| ((k as f64 * a) % 1.0 * to) as f32;
                let (i, v) = (
                    [at(0.819_173, 84.0), at(0.671_044, 360.0)],
                    [at(0.549_700, 84.0), at(0.450_300, 360.0)],
                );
                let vector = |d: [f32; 2]| {
                    crate::direction::Direction::from_deg(d[0].into(), d[1].into()).to_vec3()
                };
                Sample {
                    theta_i_deg: i[0],
                    phi_i_deg: i[1],
                    theta_v_deg: v[0],
                    phi_v_deg: v[1],
                    rgb: model.eval(vector(i), vector(v)).map(|v| v as f32),
                    frame: k,
                }
            })
            .collect();
        let bins = Bins::new(grid, &samples);
        // Tight enough that some pairs are refined.
        let settings = FillSettings {
            block_deg,
            neighbours: 32,
            ..FillSettings::DEFAULT
        };
        let data = Data::new(&bins);
        let dense = fill(&data, &settings, &silent).unwrap();
        let n = grid.n_directions();
        let planes = Mutex::new([(); 3].map(|()| vec![f32::NAN; n * n]));
        let (rows, kept) = (Rows::new(grid, &settings), InMemory::default());
        let solver = Solver::new(&data, &settings).unwrap();
        let patches = &rows.cover.patches;
        let found = patches.iter().filter(|p| p.rows.start == 0).count();
        assert_eq!(found, at_pole);
        let half = rows.patches() / 2;
        // Two that solve, and then one a band that writes.
        let mut solved = solver.solve((0..half).collect(), &kept, &silent).unwrap();
        let others = solver.solve((half..rows.patches()).collect(), &kept, &silent);
        solved.extend(others.unwrap());
        let solved_right = |(p, of)| rows.is_of_patch(p, of);
        assert!(solved.iter().enumerate().all(solved_right));
        assert!(!rows.is_of_patch(1, &solved[0]));
        let corners = rows.corners(solved);
        for band in rows.bands() {
            let take = |light: usize, row: [&[f32]; 3]| {
                assert!(band.rings.contains(&(light / grid.n_phi())));
                let mut planes = planes.lock().unwrap();
                for c in 0..3 {
                    planes[c][light * n..(light + 1) * n].copy_from_slice(row[c]);
                }
                Ok(())
            };
            rows.each_row(band.patches.clone(), &corners, &kept, &silent, &take)
                .unwrap();
        }
        assert_eq!(dense.planes(), &planes.into_inner().unwrap());
        let cells: usize = kept.0.into_inner().unwrap().values().map(Vec::len).sum();
        assert!(cells > 0 && 3 * cells < 2 * n * n, "{cells} of {}", n * n);
    }

    #[derive(Default)]
    struct InMemory(Mutex<BTreeMap<usize, Vec<[f32; 3]>>>);

    impl KeptCells<3> for InMemory {
        type Error = FillError;

        fn put(&self, patch: usize, _: &AtCorners, cells: &[[f32; 3]]) -> Result<(), FillError> {
            self.0.lock().unwrap().insert(patch, cells.to_vec());
            Ok(())
        }

        fn get(
            &self,
            patch: usize,
            cells: Range<usize>,
            into: &mut Vec<[f32; 3]>,
        ) -> Result<(), FillError> {
            into.extend(&self.0.lock().unwrap()[&patch][cells]);
            Ok(())
        }
    }

    #[test]
    fn bands_hold_all_patches_and_all_polar_angles_once() {
        // The finer one has several patches at the pole.
        for step_deg in [2.0, 1.0] {
            let grid = Grid::with_step_deg(step_deg).unwrap();
            let rows = Rows::new(grid, &FillSettings::DEFAULT);
            let (mut patch, mut ring) = (0, 0);
            for band in rows.bands() {
                assert_eq!((band.patches.start, band.rings.start), (patch, ring));
                (patch, ring) = (band.patches.end, band.rings.end);
            }
            assert_eq!((patch, ring), (rows.patches(), grid.n_theta()));
        }
    }
}
