//! A fill row by row, for grids whose cells do not fit memory (1°: a thousand million, 12 GB).
//!
//! Every pair of patches is solved three times: once for what it says at its corners, and then for the
//! rows of either patch. The same numbers in the same order give the same bits, so that the result is as
//! reciprocal as one in memory.

use super::FillSettings;
use super::blend::{Corners, Shifts};
use super::block::kernel::{AnyKernel, NewBlock};
use super::data::Data;
use super::exponential::exponentials;
use super::fill::{FillError, Task};
use super::refine::Refiner;
use crate::progress::Progress;
use pulp::Arch;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// A fill of which the rows are still to be made.
pub struct ByRows<'a, const N: usize = 3> {
    task: Task<'a, N>,
    corners: Corners<N>,
}

/// Working memory of one thread.
struct Work<const N: usize> {
    refiner: Refiner<N>,
    logs: Vec<[f32; N]>,
    shifts: Shifts<N>,
    arch: Arch,
}

impl<'a, const N: usize> ByRows<'a, N>
where
    dyn AnyKernel: NewBlock<N>,
{
    /// Solves all pairs of patches once. `progress` is called with the share done, from any thread.
    ///
    /// # Errors
    /// Too few bins.
    pub fn new(
        data: &'a Data<'a, N>,
        settings: &'a FillSettings,
        progress: &Progress<'_>,
    ) -> Result<Self, FillError> {
        let task = Task::new(data, settings)?;
        let corners = task.solve_pairs(false, progress, &|_, _| ())?;
        Ok(Self { task, corners })
    }

    /// Makes all rows, and gives each (its number, and three channels of a value a view) to `take`, in
    /// no order and from several threads. A thread holds the rows of one patch.
    ///
    /// # Errors
    /// The first of `take`'s; or `cancelled`'s, when `progress` ends the work.
    pub fn each_row<E: Send>(
        &self,
        progress: &Progress<'_>,
        take: &(impl Fn(usize, [&[f32]; N]) -> Result<(), E> + Sync),
        cancelled: impl Fn() -> E + Sync,
    ) -> Result<(), E> {
        let grid = self.task.grid;
        let (n, n_phi) = (grid.n_directions(), grid.n_phi());
        let patches = &self.task.cover.patches;
        let done = AtomicUsize::new(0);
        let work = || Work {
            refiner: Refiner::new(self.task.settings),
            logs: Vec::new(),
            shifts: Shifts::default(),
            arch: Arch::new(),
        };
        (0..patches.len())
            .into_par_iter()
            .with_max_len(1)
            .try_for_each_init(work, |work, p| {
                let lights = &patches[p].directions;
                let mut rows: [Vec<f32>; N] =
                    std::array::from_fn(|_| vec![0.0f32; lights.len() * n]);
                for q in 0..patches.len() {
                    self.write_pair(work, p, q, &mut rows);
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
                match progress((done.fetch_add(1, Relaxed) + 1) as f64 / patches.len() as f64) {
                    ControlFlow::Continue(()) => Ok(()),
                    ControlFlow::Break(()) => Err(cancelled()),
                }
            })
    }

    /// Writes the cells of lights in patch `p` and views in patch `q`.
    fn write_pair(&self, work: &mut Work<N>, p: usize, q: usize, rows: &mut [Vec<f32>; N]) {
        let patches = &self.task.cover.patches;
        let (settings, n) = (self.task.settings, self.task.grid.n_directions());
        let (first, second) = (p.min(q), p.max(q));
        let pair = (&patches[first], &patches[second]);
        let solved = work
            .refiner
            .solve(self.task.hierarchy(), settings, pair, false);
        work.logs.clear();
        work.logs.extend_from_slice(solved.cells);
        let numbers = (first, second);
        self.corners
            .blend(&self.task.cover, numbers, &mut work.logs, &mut work.shifts);
        exponentials(work.arch, &mut work.logs);
        let width = pair.1.directions.len();
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
    use crate::grid::Grid;
    use crate::model::{Brdf, Kurt};
    use crate::progress::silent;
    use crate::sample::Sample;
    use std::sync::Mutex;

    #[test]
    fn rows_are_those_of_a_fill_in_memory_to_the_bit() {
        let model = Kurt::two_thread_fabric();
        let grid = Grid::with_step_deg(6.0).unwrap();
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
            block_deg: 24.0,
            neighbours: 32,
            ..FillSettings::DEFAULT
        };
        let data = Data::new(&bins);
        let dense = fill(&data, &settings, &silent).unwrap();
        let n = grid.n_directions();
        let planes = Mutex::new([(); 3].map(|()| vec![f32::NAN; n * n]));
        ByRows::new(&data, &settings, &silent)
            .unwrap()
            .each_row(
                &silent,
                &|light, row| {
                    let mut planes = planes.lock().map_err(|_| ())?;
                    for c in 0..3 {
                        planes[c][light * n..(light + 1) * n].copy_from_slice(row[c]);
                    }
                    Ok::<(), ()>(())
                },
                || (),
            )
            .unwrap();
        assert_eq!(dense.planes(), &planes.into_inner().unwrap());
    }
}
