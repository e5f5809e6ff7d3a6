//! All cells of the grid, one by one.

use super::predict::{Predictor, Workspace};
use super::settings::BaselineSettings;
use crate::bins::Bins;
use crate::dense::DenseBrdf;
use crate::grid::Grid;
use crate::interpolate::FillError;
use crate::interpolate::planes::spread_poles;
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};

/// A filled grid, and how it went.
#[derive(Clone, Debug, PartialEq)]
pub struct BaselineFill {
    /// The values: positive, finite, exactly reciprocal, one a pole.
    pub dense: DenseBrdf,
    /// Values that the method failed at, and that are their nearest bin's.
    pub failed: u64,
    /// Values (cells times channels) that came out zero or negative, and were raised to
    /// [`Predictor::floor`].
    pub raised: u64,
}

/// Interpolates every cell that has no bin; bins keep their medians; then reciprocal values are
/// averaged. Bins that stand at their reciprocal place too (`mirrored`) are reciprocal before, so that only one
/// side is interpolated. `progress` is called with the share done, 0 ..= 1, from any
/// thread.
///
/// # Errors
/// Too few bins, or cancelled.
pub fn fill(
    bins: &Bins,
    settings: &BaselineSettings,
    progress: &Progress<'_>,
) -> Result<BaselineFill, FillError> {
    let filler = BaselineFiller::new(bins, settings)?;
    let grid = bins.grid();
    let n = grid.n_directions();
    let mut planes = [(); 3].map(|()| vec![0f32; grid.n_cells()]);
    let [red, green, blue] = &mut planes;
    let done = AtomicUsize::new(0);
    red.par_chunks_mut(n)
        .zip(green.par_chunks_mut(n))
        .zip(blue.par_chunks_mut(n))
        .enumerate()
        // Rows get shorter; hand them out one by one.
        .with_max_len(1)
        .filter(|(light, _)| !is_pole_again(grid, *light))
        .try_for_each_init(Workspace::default, |work, (light, ((red, green), blue))| {
            for view in (light..n).filter(|view| !is_pole_again(grid, *view)) {
                let value = filler.pair(light, view, work);
                (red[view], green[view], blue[view]) = (value[0], value[1], value[2]);
            }
            let cells = done.fetch_add(n - light, Relaxed) + n - light;
            match progress((2.0 * cells as f64 / (n * (n + 1)) as f64).min(1.0)) {
                ControlFlow::Continue(()) => Ok(()),
                ControlFlow::Break(()) => Err(FillError::Cancelled),
            }
        })?;
    for plane in &mut planes {
        mirror(n, plane);
        spread_poles(grid, true, plane);
    }
    let tally = filler.tally();
    Ok(BaselineFill {
        dense: DenseBrdf::from_planes(grid, planes),
        failed: tally.failed,
        raised: tally.raised,
    })
}

/// Cells that [`fill()`] interpolates: all but those with a bin, each pole once; of pairs of
/// reciprocal cells only one, where the settings are `mirrored`, and none of those with a bin.
pub fn n_interpolated(bins: &Bins, mirrored: bool) -> usize {
    let grid = bins.grid();
    let n = 1 + (grid.n_theta() - 1) * grid.n_phi();
    if !mirrored {
        return n * n - bins.bins().len();
    }
    let filled = |cell: usize| bin_at(bins, cell).is_some();
    let measured = bins.bins().iter().filter(|bin| {
        let (light, view) = grid.light_and_view(bin.cell as usize);
        // Of two bins that are each other's mirror the second one counts.
        light >= view || !filled(grid.cell(view, light))
    });
    n * (n + 1) / 2 - measured.count()
}

/// Whether a direction is the pole at another azimuth than 0.
fn is_pole_again(grid: Grid, direction: usize) -> bool {
    (1..grid.n_phi()).contains(&direction)
}

fn bin_at(bins: &Bins, cell: usize) -> Option<[f32; 3]> {
    let found = bins
        .bins()
        .binary_search_by_key(&cell, |b| b.cell as usize)
        .ok()?;
    Some(bins.bins()[found].median)
}

/// Gives single cells the values that [`fill()`] gives them.
pub struct BaselineFiller<'a> {
    predictor: Predictor<'a>,
    bins: &'a Bins,
    interpolated: AtomicU64,
    failed: AtomicU64,
    raised: AtomicU64,
}

/// What a [`BaselineFiller`] has done so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tally {
    /// Interpolations; a cell without a bin and its mirror take two, or one if `mirrored`.
    pub interpolated: u64,
    /// Those that failed, and were replaced by the nearest bin's value.
    pub failed: u64,
    /// Values (cells times channels) raised because they were not positive.
    pub raised: u64,
}

impl<'a> BaselineFiller<'a> {
    /// Makes the bins ready.
    ///
    /// # Errors
    /// Too few bins.
    pub fn new(bins: &'a Bins, settings: &BaselineSettings) -> Result<Self, FillError> {
        Ok(Self {
            predictor: Predictor::new(bins, settings)?,
            bins,
            interpolated: AtomicU64::new(0),
            failed: AtomicU64::new(0),
            raised: AtomicU64::new(0),
        })
    }

    /// What was done so far.
    pub fn tally(&self) -> Tally {
        Tally {
            interpolated: self.interpolated.load(Relaxed),
            failed: self.failed.load(Relaxed),
            raised: self.raised.load(Relaxed),
        }
    }

    /// The value of a pair of direction indices, in either order. Of a pole only azimuth 0 has
    /// a bin.
    pub fn pair(&self, light: usize, view: usize, work: &mut Workspace) -> [f32; 3] {
        let grid = self.bins.grid();
        let one = bin_at(self.bins, grid.cell(light, view));
        let other = bin_at(self.bins, grid.cell(view, light));
        let value = if light == view {
            one.unwrap_or_else(|| self.interpolated(light, view, work))
        } else if self.predictor.settings().mirrored {
            match (one, other) {
                (Some(one), Some(other)) => mean(one, other),
                (Some(value), None) | (None, Some(value)) => value,
                (None, None) => self.interpolated(light, view, work),
            }
        } else {
            mean(
                one.unwrap_or_else(|| self.interpolated(light, view, work)),
                other.unwrap_or_else(|| self.interpolated(view, light, work)),
            )
        };
        let negative = value.iter().filter(|v| **v <= 0.0).count() as u64;
        if negative == 0 {
            return value;
        }
        self.raised.fetch_add(negative, Relaxed);
        let floor = self.predictor.floor();
        [0, 1, 2].map(|c| if value[c] > 0.0 { value[c] } else { floor[c] })
    }

    fn interpolated(&self, light: usize, view: usize, work: &mut Workspace) -> [f32; 3] {
        self.interpolated.fetch_add(1, Relaxed);
        let grid = self.bins.grid();
        let (light, view) = (
            grid.direction(light).to_vec3(),
            grid.direction(view).to_vec3(),
        );
        let value = self.predictor.at(light, view, work).unwrap_or_else(|_| {
            self.failed.fetch_add(1, Relaxed);
            self.predictor.nearest(light, view, work)
        });
        value.map(|v| v as f32)
    }
}

fn mean(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|c| 0.5 * (a[c] + b[c]))
}

/// Copies what is above the diagonal to its place below.
fn mirror(n: usize, plane: &mut [f32]) {
    /// Rows and columns walked together, so that few pages are touched at a time.
    const TILE: usize = 64;
    for first_row in (0..n).step_by(TILE) {
        for first_column in (0..=first_row).step_by(TILE) {
            for row in first_row..n.min(first_row + TILE) {
                for column in first_column..row.min(first_column + TILE) {
                    plane[row * n + column] = plane[column * n + row];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elementary::Elementary;
    use crate::model::{Brdf, Kurt};
    use crate::progress::silent;
    use crate::sample::Sample;

    /// Every third cell of a grid without those whose light is a pole, in their own frames.
    fn bins(grid: Grid, model: &dyn Brdf) -> Bins {
        let n = grid.n_directions();
        let samples: Vec<Sample> = (0..grid.n_cells())
            .step_by(3)
            .map(|cell| (cell / n, cell * 7 % n))
            .filter(|(light, _)| *light >= grid.n_phi())
            .map(|(light, view)| {
                let (light, view) = (grid.direction(light), grid.direction(view));
                Sample::new(
                    light,
                    view,
                    model
                        .eval(light.to_vec3(), view.to_vec3())
                        .map(|v| v as f32),
                )
                .in_frame(0)
            })
            .collect();
        Bins::new(grid, &samples)
    }

    #[test]
    fn every_method_fills_a_grid_reciprocally_and_keeps_what_is_measured() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let model = Kurt::white_reference_fabric();
        let bins = bins(grid, &model);
        let n = grid.n_directions();
        for name in [
            "paper",
            "paper,k=20",
            "rbf-matern,log,mirrored,half=0.5,k=40",
            "nearest",
            "shepard,angles",
            "mls1",
            "mls2,mirrored",
        ] {
            let settings: BaselineSettings = name.parse().unwrap();
            let heard = |share| {
                assert!(share <= 1.0);
                std::ops::ControlFlow::Continue(())
            };
            let filled = fill(&bins, &settings, &heard).unwrap();
            assert_eq!((filled.failed, filled.raised), (0, 0), "{name}");
            let dense = &filled.dense;
            for light in 0..n {
                for view in 0..n {
                    let value = dense.at(light, view);
                    assert_eq!(value, dense.at(view, light), "{name}");
                    assert!(value.iter().all(|v| *v > 0.0 && v.is_finite()), "{name}");
                    if light < grid.n_phi() {
                        assert_eq!(value, dense.at(0, view), "{name}");
                    }
                    let truth = model.eval(
                        grid.direction(light).to_vec3(),
                        grid.direction(view).to_vec3(),
                    );
                    let off = (f64::from(value[1]) / truth[1]).natural_log().abs();
                    // A node of 30° is far from its neighbours; the nearest may be 40° away.
                    assert!(off < 0.25, "{name}: {off} at {light}, {view}");
                }
            }
            for bin in bins.bins() {
                let (light, view) = grid.light_and_view(bin.cell as usize);
                if bin_at(&bins, grid.cell(view, light)).is_some() {
                    let off = dense.at(light, view)[0] / bin.median[0] - 1.0;
                    assert!(off.abs() < 1e-5, "{name}: measured on both sides");
                }
            }
        }
    }

    #[test]
    fn the_bytes_do_not_depend_on_the_number_of_threads() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let model = Kurt::two_thread_fabric();
        let samples = bins(grid, &model);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| fill(&samples, &BaselineSettings::PAPER, &silent).unwrap())
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn what_is_to_be_interpolated_is_counted_as_it_is_done() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let bins = bins(grid, &Kurt::white_reference_fabric());
        let n = grid.n_directions();
        let once = |d: &usize| !is_pole_again(grid, *d);
        let (mut plain, mut mirrored) = (0, 0);
        for light in (0..n).filter(once) {
            for view in (0..n).filter(once) {
                let is_empty = |l, v| bin_at(&bins, grid.cell(l, v)).is_none();
                plain += usize::from(is_empty(light, view));
                let both = is_empty(light, view) && is_empty(view, light);
                mirrored += usize::from(light <= view && both);
            }
        }
        assert_eq!(n_interpolated(&bins, false), plain);
        assert_eq!(n_interpolated(&bins, true), mirrored);
    }

    #[test]
    fn overshoot_below_zero_is_raised_and_counted() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let spike = bins(grid, &Spike);
        let filled = fill(&spike, &"rbf-cubic,nugget=0,k=30".parse().unwrap(), &silent).unwrap();
        assert!(filled.raised > 0);
        let least = filled.dense.planes()[0]
            .iter()
            .fold(f32::MAX, |a, b| a.min(*b));
        assert!(least > 0.0);
    }

    /// A thousand times brighter in one small place.
    struct Spike;
    impl Brdf for Spike {
        fn eval(&self, light: [f64; 3], view: [f64; 3]) -> [f64; 3] {
            let far = (light[0] - 0.5).abs() + (view[0] + 0.5).abs() > 0.3;
            [if far { 0.01 } else { 10.0 }; 3]
        }
    }
}
