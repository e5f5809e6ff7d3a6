//! All cells, block by block.

use super::Settings;
use super::blend::{Corners, Shifts};
use super::error_bars::{Calibration, ErrorBars, origins};
use super::exponential::exponentials;
use super::known::Known;
use super::levels::Levels;
use super::patches::{Cover, Patch, cover};
use super::refine::Refiner;
use crate::dense::DenseBrdf;
use crate::grid::Grid;
use pulp::Arch;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering::Relaxed};

/// Fewer filled bins than this say nothing about a four-dimensional function.
pub const MIN_BINS: usize = 8;

/// Why a set of bins cannot be interpolated.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FillError {
    /// Too little to go by.
    #[error("only {0} bins are filled, and at least {MIN_BINS} are needed: measure more poses")]
    TooFewBins(usize),
}

/// Interpolates every cell of the bins' grid. Positive, finite, exactly reciprocal, one value a
/// pole. `progress` is told the share done, 0 ..= 1, from any thread.
pub fn fill(
    known: &Known,
    settings: &Settings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<DenseBrdf, FillError> {
    Ok(DenseBrdf::from_planes(
        known.bins().grid(),
        solve(known, settings, None, progress)?.0,
    ))
}

/// The same with a standard error for each cell. It takes about twice the time.
pub fn fill_with_errors(
    known: &Known,
    settings: &Settings,
    calibration: &Calibration,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(DenseBrdf, ErrorBars), FillError> {
    let bins = known.bins();
    let grid = bins.grid();
    let (values, standard_error) = solve(known, settings, Some(calibration), progress)?;
    let bars = ErrorBars {
        standard_error,
        origin: origins(bins),
    };
    Ok((DenseBrdf::from_planes(grid, values), bars))
}

type Planes = [Vec<f32>; 3];

/// Values of all cells, and with a calibration their standard errors (else planes of no length).
fn solve(
    known: &Known,
    settings: &Settings,
    calibration: Option<&Calibration>,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(Planes, Planes), FillError> {
    let fit = Fit::new(known, settings)?;
    let (grid, patches) = (fit.grid, &fit.cover.patches);
    let values = SharedPlanes::new(grid.n_cells());
    let errors = SharedPlanes::new(calibration.map_or(0, |_| grid.n_cells()));
    // First the logarithms of the cells of each pair, and their relative errors.
    let corners = fit.solve_pairs(calibration.is_some(), progress, &|refiner, p, q| {
        let logs = refiner.logs();
        if !refiner.is_smooth() {
            values.store(grid, (p, q), logs);
        }
        if let Some(calibration) = calibration {
            let variances = refiner.variances();
            let directions = p
                .vectors
                .iter()
                .flat_map(|light| q.vectors.iter().map(move |view| (*light, *view)));
            let relative: Vec<[f32; 3]> = directions
                .zip(logs.iter().zip(variances))
                .map(|((light, view), (log, variance))| {
                    calibration.standard_error(light, view, *log, *variance)
                })
                .collect();
            errors.store(grid, (p, q), &relative);
        }
    });
    // Then, with what the neighbours say, the values.
    (0..patches.len())
        .into_par_iter()
        .with_max_len(1)
        .for_each_init(Blended::default, |work, p| {
            for q in p..patches.len() {
                let pair = (&patches[p], &patches[q]);
                if !corners.is_smooth(p, q) {
                    values.load(grid, pair, &mut work.logs);
                }
                corners.blend(&fit.cover, (p, q), &mut work.logs, &mut work.shifts);
                exponentials(work.arch, &mut work.logs);
                values.store_both(grid, pair, &work.logs);
                if calibration.is_some() {
                    errors.load(grid, pair, &mut work.errors);
                    for (error, value) in work.errors.iter_mut().zip(&work.logs) {
                        *error = [0, 1, 2].map(|c| error[c] * value[c]);
                    }
                    errors.store_both(grid, pair, &work.errors);
                }
            }
        });
    Ok((values.into_planes(grid), errors.into_planes(grid)))
}

/// What a fill is made of.
pub(super) struct Fit<'a> {
    pub grid: Grid,
    pub settings: &'a Settings,
    known: &'a Known<'a>,
    moved: Option<Levels>,
    pub cover: Cover,
}

impl<'a> Fit<'a> {
    pub(super) fn new(known: &'a Known, settings: &'a Settings) -> Result<Self, FillError> {
        let bins = known.bins();
        if bins.bins().len() < MIN_BINS {
            return Err(FillError::TooFewBins(bins.bins().len()));
        }
        let grid = bins.grid();
        Ok(Self {
            grid,
            settings,
            known,
            moved: known.moved(settings.coordinates),
            cover: cover(grid, &settings.patch_sizes_deg()),
        })
    }

    /// The nodes, in the coordinates of the settings.
    pub(super) fn levels(&self) -> &Levels {
        self.moved.as_ref().unwrap_or(self.known.levels())
    }

    /// Solves all pairs of patches, shows each to `each`, and averages at their corners.
    pub(super) fn solve_pairs(
        &self,
        with_variances: bool,
        progress: &(dyn Fn(f64) + Sync),
        each: &(dyn Fn(&Refiner, &Patch, &Patch) + Sync),
    ) -> Corners {
        let patches = &self.cover.patches;
        let pairs = patches.len() * (patches.len() + 1) / 2;
        let done = AtomicUsize::new(0);
        let at_corners = (0..patches.len())
            .into_par_iter()
            // Early patches have the most partners; hand them out one by one.
            .with_max_len(1)
            .map_init(Refiner::default, |refiner, p| {
                refiner.with_variances = with_variances;
                let (mut at_corners, mut smooth) = (Vec::new(), Vec::new());
                for q in &patches[p..] {
                    refiner.solve(self.levels(), self.settings, &patches[p], q);
                    at_corners.extend_from_slice(refiner.corners());
                    smooth.push(refiner.is_smooth());
                    each(refiner, &patches[p], q);
                }
                let before = done.fetch_add(patches.len() - p, Relaxed);
                progress((before + patches.len() - p) as f64 / pairs as f64);
                (at_corners, smooth)
            })
            .collect();
        Corners::new(&self.cover, at_corners, self.settings.blend_limit())
    }
}

/// Working memory of one thread.
#[derive(Default)]
struct Blended {
    logs: Vec<[f32; 3]>,
    errors: Vec<[f32; 3]>,
    shifts: Shifts,
    arch: Arch,
}

/// Planes that many threads write to, each cell once. Relaxed atomic stores are plain stores, and
/// spare an argument about which thread owns which row.
struct SharedPlanes([Vec<AtomicU32>; 3]);

impl SharedPlanes {
    fn new(length: usize) -> Self {
        let plane = || (0..length).into_par_iter().map(|_| AtomicU32::new(0));
        Self([(); 3].map(|()| plane().collect()))
    }

    /// Stores the cells of a pair, light by light.
    fn store(&self, grid: Grid, (p, q): (&Patch, &Patch), cells: &[[f32; 3]]) {
        let width = q.directions.len();
        for (light, row) in p.directions.iter().zip(cells.chunks_exact(width)) {
            for (first, view, length) in runs(q) {
                let cells = &row[first..first + length];
                self.store_run(grid.cell(*light as usize, view), cells.iter());
            }
        }
    }

    /// What [`Self::store`] stored.
    fn load(&self, grid: Grid, (p, q): (&Patch, &Patch), cells: &mut Vec<[f32; 3]>) {
        cells.clear();
        for light in &p.directions {
            for (_, view, length) in runs(q) {
                let from = grid.cell(*light as usize, view);
                let planes = [0, 1, 2].map(|c| &self.0[c][from..from + length]);
                cells.extend(
                    (0..length).map(|k| planes.map(|p| f32::from_bits(p[k].load(Relaxed)))),
                );
            }
        }
    }

    /// Stores the cells of a pair and their mirror images. Within one patch both orders of a pair are
    /// there; the first serves for both.
    fn store_both(&self, grid: Grid, (p, q): (&Patch, &Patch), cells: &[[f32; 3]]) {
        self.store(grid, (p, q), cells);
        let (same, width) = (std::ptr::eq(p, q), q.directions.len());
        for (b, view) in q.directions.iter().enumerate() {
            for (first, light, length) in runs(p) {
                let length = if same {
                    length.min((b + 1).saturating_sub(first))
                } else {
                    length
                };
                let column = cells.iter().skip(first * width + b).step_by(width);
                self.store_run(grid.cell(*view as usize, light), column.take(length));
            }
        }
    }

    /// Stores cells that follow each other.
    fn store_run<'a>(&self, from: usize, cells: impl ExactSizeIterator<Item = &'a [f32; 3]>) {
        let [red, green, blue] = [0, 1, 2].map(|c| &self.0[c][from..from + cells.len()]);
        for (k, cell) in cells.enumerate() {
            red[k].store(cell[0].to_bits(), Relaxed);
            green[k].store(cell[1].to_bits(), Relaxed);
            blue[k].store(cell[2].to_bits(), Relaxed);
        }
    }

    fn into_planes(self, grid: Grid) -> Planes {
        self.0.map(|plane| {
            // Same size and alignment: the vector is reused in place.
            let mut plane: Vec<f32> = plane
                .into_iter()
                .map(|bits| f32::from_bits(bits.into_inner()))
                .collect();
            spread_poles(grid, &mut plane);
            plane
        })
    }
}

/// Directions of a patch that follow each other: where the first stands in the patch, its number, and how
/// many they are.
fn runs(patch: &Patch) -> impl Iterator<Item = (usize, usize, usize)> {
    let mut first = 0;
    patch
        .directions
        .chunk_by(|a, b| a + 1 == *b)
        .map(move |run| {
            let place = first;
            first += run.len();
            (place, run[0] as usize, run.len())
        })
}

/// Copies the pole's value, computed at azimuth 0, to all azimuths, for light and view.
pub(crate) fn spread_poles(grid: Grid, plane: &mut [f32]) {
    if plane.is_empty() {
        return;
    }
    let (n, n_phi) = (grid.n_directions(), grid.n_phi());
    for row in plane.chunks_exact_mut(n) {
        let pole = row[0];
        row[1..n_phi].fill(pole);
    }
    for row in 1..n_phi {
        plane.copy_within(0..n, row * n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bins::Bins;
    use crate::direction::Direction;
    use crate::model::{Brdf, Kurt};
    use crate::sample::Sample;

    fn samples(model: &dyn Brdf, n: usize) -> Vec<Sample> {
        // A Halton sequence over the four angles, uniform in solid angle.
        let halton = |mut k: usize, base: usize| {
            let (mut f, mut x) = (1.0, 0.0);
            while k > 0 {
                f /= base as f64;
                x += f * (k % base) as f64;
                k /= base;
            }
            x
        };
        let cos_max = 87f64.to_radians().cos();
        (1..=n)
            .map(|k| {
                let theta = |u: f64| (1.0 - u * (1.0 - cos_max)).acos().to_degrees();
                let light = Direction::from_deg(theta(halton(k, 2)), 360.0 * halton(k, 3));
                let view = Direction::from_deg(theta(halton(k, 5)), 360.0 * halton(k, 7));
                Sample {
                    theta_i_deg: light.theta_deg() as f32,
                    phi_i_deg: light.phi_deg() as f32,
                    theta_v_deg: view.theta_deg() as f32,
                    phi_v_deg: view.phi_deg() as f32,
                    rgb: model
                        .eval(light.to_vec3(), view.to_vec3())
                        .map(|v| v as f32),
                    frame: 0,
                }
            })
            .collect()
    }

    #[test]
    fn a_smooth_material_is_filled_reciprocally_and_close_to_the_truth() {
        let model = Kurt::white_reference_fabric();
        let grid = Grid::with_step_deg(10.0).unwrap();
        let fine = Grid::with_step_deg(2.0).unwrap();
        let bins = Bins::new(fine, &samples(&model, 60_000));
        let coarse = Bins::new(grid, &samples(&model, 60_000));
        assert!(coarse.bins().len() < bins.bins().len());
        let settings = Settings {
            block_deg: 20.0,
            ..Settings::DEFAULT
        };
        let dense = fill(&Known::new(&coarse), &settings, &|_| ()).unwrap();
        let n = grid.n_directions();
        let mut sum = 0.0;
        for light in 0..n {
            for view in 0..n {
                let value = dense.at(light, view);
                assert_eq!(value, dense.at(view, light), "reciprocity");
                assert!(value.iter().all(|v| *v > 0.0 && v.is_finite()));
                if light < grid.n_phi() {
                    assert_eq!(value, dense.at(0, view), "one value at the pole");
                }
                let truth = model.eval(
                    grid.direction(light).to_vec3(),
                    grid.direction(view).to_vec3(),
                );
                sum += (f64::from(value[1]) / truth[1]).ln().powi(2);
            }
        }
        let rms = (sum / (n * n) as f64).sqrt();
        assert!(rms < 0.03, "log-RMS {rms}");
    }

    #[test]
    fn too_few_bins_are_refused() {
        let model = Kurt::white_reference_fabric();
        let bins = Bins::new(Grid::PAPER, &samples(&model, 7));
        assert_eq!(
            fill(&Known::new(&bins), &Settings::DEFAULT, &|_| ()),
            Err(FillError::TooFewBins(7))
        );
    }
}
