//! All cells, block by block.

use super::FillSettings;
use super::blend::{AtCorners, Corners, Shifts};
use super::block::kernel::{AnyKernel, NewBlock};
use super::data::Data;
use super::error_bars::{Calibration, ErrorBars};
use super::exponential::exponentials;
use super::extrapolation::Extrapolation;
use super::hierarchy::Hierarchy;
use super::origin::origins;
use super::patches::{Cover, Patch, cover};
use super::planes::{Planes, SharedPlanes};
use super::refine::{Refiner, Solved};
use crate::dense::DenseBrdf;
use crate::grid::Grid;
use crate::progress::Progress;
use pulp::Arch;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Fewer filled bins than this say nothing about a four-dimensional function.
pub const MIN_BINS: usize = 8;

/// Why a set of bins cannot be interpolated.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FillError {
    /// Too little to go by.
    #[error("only {0} bins are filled, and at least {MIN_BINS} are needed: measure more poses")]
    TooFewBins(usize),
    /// The caller's progress callback ended the work.
    #[error("cancelled")]
    Cancelled,
}

/// Interpolates every cell of the bins' grid. Positive, finite, exactly reciprocal, one value a
/// pole. `progress` is called with the share done, 0 ..= 1, from any thread.
///
/// # Errors
/// Too few bins.
pub fn fill<const N: usize>(
    data: &Data<N>,
    settings: &FillSettings,
    progress: &Progress<'_>,
) -> Result<DenseBrdf<N>, FillError>
where
    dyn AnyKernel: NewBlock<N>,
{
    Ok(DenseBrdf::from_planes(
        data.bins().grid(),
        solve(data, settings, None, progress)?.0,
    ))
}

/// The same with a standard error for each cell. It takes about half as long again.
///
/// # Errors
/// Too few bins.
pub fn fill_with_errors<const N: usize>(
    data: &Data<N>,
    settings: &FillSettings,
    calibration: &Calibration,
    progress: &Progress<'_>,
) -> Result<(DenseBrdf<N>, ErrorBars<N>), FillError>
where
    dyn AnyKernel: NewBlock<N>,
{
    let bins = data.bins();
    let grid = bins.grid();
    let (values, standard_error) = solve(data, settings, Some(calibration), progress)?;
    let bars = ErrorBars {
        standard_error,
        origin: origins(bins),
    };
    Ok((DenseBrdf::from_planes(grid, values), bars))
}

/// Values of all cells, and with a calibration their standard errors (else planes of no length).
fn solve<const N: usize>(
    data: &Data<N>,
    settings: &FillSettings,
    calibration: Option<&Calibration>,
    progress: &Progress<'_>,
) -> Result<(Planes<N>, Planes<N>), FillError>
where
    dyn AnyKernel: NewBlock<N>,
{
    let task = Task::new(data, settings)?;
    let (grid, patches) = (task.grid, &task.cover.patches);
    let values = SharedPlanes::new(grid.n_cells());
    let errors = SharedPlanes::new(calibration.map_or(0, |_| grid.n_cells()));
    // First the logarithms of the cells of each pair, and their relative errors.
    let each = |(): &mut (), solved: Solved<'_, N>, (p, q): (&Patch, &Patch)| {
        if !solved.is_smooth {
            values.store(grid, (p, q), solved.cells);
        }
        if let Some(calibration) = calibration {
            let factor = task.error_factor((p, q));
            let directions = p
                .vectors
                .iter()
                .flat_map(|light| q.vectors.iter().map(move |view| (*light, *view)));
            let relative: Vec<[f32; N]> = directions
                .zip(solved.cells.iter().zip(solved.variances))
                .map(|((light, view), (log, variance))| {
                    let errors = calibration.standard_error(light, view, *log, *variance);
                    errors.map(|error| factor * error)
                })
                .collect();
            errors.store(grid, (p, q), &relative);
        }
    };
    let of_patches = task.solve_pairs(
        (0..patches.len()).collect(),
        calibration.is_some(),
        progress,
        &each,
        &|_, _, ()| Ok::<_, FillError>(()),
    )?;
    let corners = task.corners(of_patches);
    // Then, shifted to what they agree on with their neighbours, the values.
    (0..patches.len())
        .into_par_iter()
        .with_max_len(1)
        .for_each_init(Blended::default, |work, p| {
            for q in p..patches.len() {
                let pair = (&patches[p], &patches[q]);
                if !corners.is_smooth(p, q) {
                    values.load(grid, pair, &mut work.logs);
                }
                corners.blend(&task.cover, (p, q), &mut work.logs, &mut work.shifts);
                exponentials(work.arch, &mut work.logs);
                values.store_both(grid, pair, &work.logs);
                if calibration.is_some() {
                    errors.load(grid, pair, &mut work.errors);
                    let gain = corners.mean_square_shift(&task.cover, (p, q), &mut work.shifts);
                    let share = blended_over_block(&work.errors, gain);
                    for (error, value) in work.errors.iter_mut().zip(&work.logs) {
                        *error = std::array::from_fn(|c| share[c] * error[c] * value[c]);
                    }
                    errors.store_both(grid, pair, &work.errors);
                }
            }
        });
    Ok((values.into_planes(grid), errors.into_planes(grid)))
}

/// The error of blended values over that of the pair's own block, by the mean square that blending shifts its cells by. One
/// pair's shifts are uncertain, so that at most three quarters of the variance are taken off.
fn blended_over_block<const N: usize>(errors: &[[f32; N]], gain: [f32; N]) -> [f32; N] {
    let mut variance = [0.0f32; N];
    for error in errors {
        for c in 0..N {
            variance[c] += error[c] * error[c] / errors.len() as f32;
        }
    }
    let of_channel = |c: usize| (1.0 - gain[c] / variance[c].max(f32::MIN_POSITIVE)).max(0.25);
    std::array::from_fn(|c| of_channel(c).sqrt())
}

/// Takes a pair of patches: into what is kept of the first one's, what was solved, and the two.
type TakePair<'a, const N: usize, K> = &'a (dyn Fn(&mut K, Solved<'_, N>, (&Patch, &Patch)) + Sync);

/// What a fill is made of.
pub(super) struct Task<'a, const N: usize> {
    pub grid: Grid,
    pub settings: &'a FillSettings,
    data: &'a Data<'a, N>,
    moved: Option<Hierarchy<N>>,
    /// How pairs beyond all that was measured are solved; `None` where they are solved as all others.
    extrapolation: Option<Extrapolation<'a, N>>,
    pub cover: Cover,
}

impl<'a, const N: usize> Task<'a, N>
where
    dyn AnyKernel: NewBlock<N>,
{
    pub(super) fn new(
        data: &'a Data<'a, N>,
        settings: &'a FillSettings,
    ) -> Result<Self, FillError> {
        let bins = data.bins();
        if bins.bins().len() < MIN_BINS {
            return Err(FillError::TooFewBins(bins.bins().len()));
        }
        let grid = bins.grid();
        let cover = cover(grid, &settings.patch_sizes_deg());
        Ok(Self {
            grid,
            settings,
            data,
            moved: data.moved(settings.coordinates),
            extrapolation: Extrapolation::new(data, settings, &cover.patches),
            cover,
        })
    }

    /// The data, in the coordinates of the settings.
    pub(super) fn hierarchy(&self) -> &Hierarchy<N> {
        self.moved.as_ref().unwrap_or(self.data.hierarchy())
    }

    /// By what the standard errors of a pair of patches are multiplied.
    fn error_factor(&self, pair: (&Patch, &Patch)) -> f32 {
        let beyond = self.extrapolation.as_ref().filter(|e| e.is_beyond(pair));
        beyond.map_or(1.0, Extrapolation::error_factor)
    }

    /// What a pair of patches is solved from.
    fn data_and_settings(&self, pair: (&Patch, &Patch)) -> (&Hierarchy<N>, &FillSettings) {
        let beyond = self.extrapolation.as_ref().filter(|e| e.is_beyond(pair));
        beyond.map_or((self.hierarchy(), self.settings), |e| {
            (e.hierarchy(), e.settings())
        })
    }

    /// Solves the pairs of some patches with themselves and all later ones. Each pair is given to `each`, and
    /// with the last of a patch's what `each` kept of them to `done`. What they give at their corners is in the
    /// order of `patches`.
    ///
    /// # Errors
    /// Cancelled, and the first of `done`'s.
    pub(super) fn solve_pairs<K: Default, E: From<FillError> + Send>(
        &self,
        patches: Vec<usize>,
        with_variances: bool,
        progress: &Progress<'_>,
        each: TakePair<'_, N, K>,
        done: &(dyn Fn(usize, &AtCorners<N>, K) -> Result<(), E> + Sync),
    ) -> Result<Vec<AtCorners<N>>, E> {
        let all = &self.cover.patches;
        let pairs: usize = patches.iter().map(|p| all.len() - p).sum();
        let solved_pairs = AtomicUsize::new(0);
        patches
            .into_par_iter()
            // Early patches have the most partners; hand them out one by one.
            .with_max_len(1)
            .map_init(
                || Refiner::new(self.settings),
                |refiner, p| {
                    let (mut at_corners, mut kept) = (AtCorners::default(), K::default());
                    for q in &all[p..] {
                        let pair = (&all[p], q);
                        let (data, settings) = self.data_and_settings(pair);
                        let solved = refiner.solve(data, settings, pair, with_variances);
                        at_corners.values.extend_from_slice(solved.corners);
                        at_corners.smooth.push(solved.is_smooth);
                        each(&mut kept, solved, pair);
                    }
                    done(p, &at_corners, kept)?;
                    let here = all.len() - p;
                    let before = solved_pairs.fetch_add(here, Relaxed);
                    match progress((before + here) as f64 / pairs as f64) {
                        ControlFlow::Continue(()) => Ok(at_corners),
                        ControlFlow::Break(()) => Err(FillError::Cancelled.into()),
                    }
                },
            )
            .collect()
    }

    /// Averages what all pairs of patches give at their corners.
    pub(super) fn corners(&self, of_patches: Vec<AtCorners<N>>) -> Corners<N> {
        Corners::new(&self.cover, of_patches, self.settings.blend_limit())
    }
}

/// Working memory of one thread.
#[derive(Default)]
struct Blended<const N: usize> {
    logs: Vec<[f32; N]>,
    errors: Vec<[f32; N]>,
    shifts: Shifts<N>,
    arch: Arch,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bins::Bins;
    use crate::direction::Direction;
    use crate::elementary::Elementary;
    use crate::model::{Brdf, Kurt};
    use crate::progress::silent;
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
        let cos_max = 87f64.to_radians().cosine();
        (1..=n)
            .map(|k| {
                let theta = |u: f64| (1.0 - u * (1.0 - cos_max)).arc_cosine().to_degrees();
                let light = Direction::from_deg(theta(halton(k, 2)), 360.0 * halton(k, 3));
                let view = Direction::from_deg(theta(halton(k, 5)), 360.0 * halton(k, 7));
                Sample::new(
                    light,
                    view,
                    model
                        .eval(light.to_vec3(), view.to_vec3())
                        .map(|v| v as f32),
                )
                .in_frame(0)
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
        let settings = FillSettings {
            block_deg: 20.0,
            ..FillSettings::DEFAULT
        };
        let dense = fill(&Data::new(&coarse), &settings, &silent).unwrap();
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
                sum += (f64::from(value[1]) / truth[1]).natural_log().powi(2);
            }
        }
        let rms = (sum / (n * n) as f64).sqrt();
        assert!(rms < 0.03, "log-RMS {rms}");
    }

    /// Log-RMS over all cells of each channel, where channel c is c + 1 times a mixture of red and blue.
    fn errors_of_channels<const N: usize>() -> [f64; N]
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let model = Kurt::white_reference_fabric();
        let mixed = |rgb: [f64; 3]| -> [f64; N] {
            std::array::from_fn(|c| {
                let blue = c as f64 / N as f64;
                (c + 1) as f64 * ((1.0 - blue) * rgb[0] + blue * rgb[2] * rgb[2])
            })
        };
        let of_channels: Vec<Sample<N>> = samples(&model, 20_000)
            .iter()
            .map(|s| {
                let light = Direction::from_deg(s.theta_i_deg.into(), s.phi_i_deg.into());
                let view = Direction::from_deg(s.theta_v_deg.into(), s.phi_v_deg.into());
                let value = mixed(model.eval(light.to_vec3(), view.to_vec3()));
                Sample::new(light, view, value.map(|v| v as f32))
            })
            .collect();
        let grid = Grid::with_step_deg(15.0).unwrap();
        let bins = Bins::new(grid, &of_channels);
        let settings = FillSettings {
            block_deg: 30.0,
            ..FillSettings::DEFAULT
        };
        let dense = fill(&Data::new(&bins), &settings, &silent).unwrap();
        let n = grid.n_directions();
        let mut sums = [0.0; N];
        for light in 0..n {
            for view in 0..n {
                let value = dense.at(light, view);
                assert_eq!(value, dense.at(view, light), "reciprocity");
                let vectors = [light, view].map(|d| grid.direction(d).to_vec3());
                let truth = mixed(model.eval(vectors[0], vectors[1]));
                for c in 0..N {
                    sums[c] += (f64::from(value[c]) / truth[c]).natural_log().powi(2);
                }
            }
        }
        sums.map(|sum| (sum / (n * n) as f64).sqrt())
    }

    #[test]
    fn channels_of_every_width_are_filled_each_close_to_its_own_truth() {
        let errors = [
            errors_of_channels::<1>().to_vec(),
            errors_of_channels::<3>().to_vec(),
            errors_of_channels::<31>().to_vec(),
        ];
        assert_eq!(errors.each_ref().map(Vec::len), super::super::WIDTHS);
        for error in errors.concat() {
            assert!(error < 0.06, "log-RMS {error}");
        }
    }

    #[test]
    fn too_few_bins_are_refused() {
        let model = Kurt::white_reference_fabric();
        let bins = Bins::new(Grid::PAPER, &samples(&model, 7));
        assert_eq!(
            fill(&Data::new(&bins), &FillSettings::DEFAULT, &silent),
            Err(FillError::TooFewBins(7))
        );
    }

    #[test]
    fn a_break_ends_the_fill_early() {
        let grid = Grid::with_step_deg(15.0).unwrap();
        let bins = Bins::new(grid, &samples(&Kurt::two_thread_fabric(), 500));
        let data = Data::new(&bins);
        let settings = FillSettings {
            block_deg: 30.0,
            ..FillSettings::DEFAULT
        };
        let heard = AtomicUsize::new(0);
        let cancelled = fill(&data, &settings, &|_| {
            heard.fetch_add(1, Relaxed);
            ControlFlow::Break(())
        });
        assert_eq!(cancelled, Err(FillError::Cancelled));
        let all = cover(grid, &settings.patch_sizes_deg()).patches.len();
        assert!(heard.into_inner() < all);
    }
}
