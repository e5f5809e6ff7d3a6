//! From bins to every cell of the grid.
//!
//! The paper interpolates each missing cell from its 200 nearest bins with radial basis functions,
//! and averages reciprocal values at the end. Here the cells of a *pair of patches* (a few degrees
//! of light directions × a few of view directions) share one neighbourhood and one factorisation;
//! values are logarithms at the mean measured directions, each bin counts at its reciprocal place
//! too, and only half of the pairs are solved, so the result is positive and exactly reciprocal.

pub mod blend;
pub mod block;
pub mod budget;
pub mod by_rows;
pub mod cholesky;
pub mod coordinates;
pub mod corner_weights;
pub mod cross_validation;
pub mod data;
pub mod datum;
pub mod error_bars;
mod error_factor;
mod error_fall;
pub mod exponential;
pub mod fill;
pub mod from_corners;
pub mod hierarchy;
mod obliquity;
pub mod origin;
pub mod patches;
pub(crate) mod planes;
pub mod refine;
pub mod select;

pub use blend::{AtCorners, Corners};
pub use block::kernel::{AnyKernel, Kernel, Matern32, NewBlock, WIDTHS};
pub use by_rows::{Band, KeptCells, Rows, Solver};
pub use coordinates::Coordinates;
pub use data::Data;
pub use error_bars::{Calibration, ErrorBars};
pub use error_fall::ErrorFall;
pub use fill::{FillError, fill, fill_with_errors};
pub use origin::{IsotropicOrigins, Origin, OriginCounts, origins, origins_with_images};
pub use select::{Candidate, Selection, select};

/// How to interpolate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillSettings {
    /// Size of the patches of directions that share a block, degrees; half of it where they are refined.
    pub block_deg: f64,
    /// A block is refined where a finer one differs from it by more than this many standard deviations
    /// of one sample: with 0 everywhere, with infinity nowhere.
    pub tolerance: f32,
    /// And by more than this relative difference, whatever the noise, 0 ..= ∞: [`select()`] raises the tolerance to it.
    /// The smaller the noise, the more blocks differ by it; what nobody needs to know is not refined.
    pub target_error: f32,
    /// What refinement may cost, in fine blocks a pair of patches, on average: [`select()`] raises the
    /// tolerance to it.
    pub budget: f32,
    /// Size of a block's neighbourhood: so many data; three quarters of them in a coarse block that may be
    /// refined.
    pub neighbours: usize,
    /// The most data that [`select()`] may take instead, where twice as many predict so much better that it pays.
    pub neighbours_most: usize,
    /// Of many bins, one in so many is used: for [`Data::thinned`].
    pub one_bin_in: usize,
    /// Where neighbours are looked for.
    pub coordinates: Coordinates,
    /// How values correlate by their distance.
    pub kernel: &'static dyn AnyKernel,
    /// Weight of the difference of light and view in the kernel's distances. Over the one in the
    /// coordinates it is the kernel's anisotropy ratio: which data are near, and how much each counts, are
    /// two questions.
    pub kernel_weight: f64,
    /// Range of the kernel in radii of the neighbourhood; raised to [`Kernel::range_min`].
    pub range: f32,
    /// Variance of the natural logarithm of one sample.
    pub noise_variance: f32,
    /// Smallest nugget.
    pub nugget_min: f32,
}

/// Points of the front of speed against accuracy; docs/src/figures/accuracy.md has their figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// A first look.
    Preview,
    /// Two thirds of the work of the default (0.61 to 0.67 of its CPU time on the paper's plan).
    Fast,
    /// Accurate to the noise on most materials.
    Default,
    /// What is left to gain, for several times the work.
    Best,
}

impl Preset {
    /// All, from quick to accurate.
    pub const ALL: [Preset; 4] = [Preset::Preview, Preset::Fast, Preset::Default, Preset::Best];

    /// Its word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Preset::Preview => "preview",
            Preset::Fast => "fast",
            Preset::Default => "default",
            Preset::Best => "best",
        }
    }

    /// Its settings; [`select()`] chooses the coordinates and measures the noise.
    pub const fn settings(self) -> FillSettings {
        let (block_deg, tolerance, budget, neighbours, one_bin_in) = match self {
            Preset::Preview => (10.0, f32::INFINITY, 0.0, 64, 8),
            Preset::Fast => (8.0, 1.0, 3.0, 64, 1),
            Preset::Default => (8.0, 0.7, 8.0, 128, 1),
            Preset::Best => (8.0, 0.5, f32::INFINITY, 256, 1),
        };
        FillSettings {
            block_deg,
            tolerance,
            target_error: TARGET_ERROR,
            budget,
            neighbours,
            // A preview is what is quick.
            neighbours_most: if one_bin_in > 1 {
                neighbours
            } else {
                2 * neighbours
            },
            one_bin_in,
            coordinates: data::SORTED_IN,
            kernel: &Matern32,
            kernel_weight: 0.3,
            range: 8.0,
            noise_variance: 1e-4,
            nugget_min: 1e-4,
        }
    }
}

impl FillSettings {
    /// What suits most materials; [`select()`] finds what suits one.
    pub const DEFAULT: FillSettings = Preset::Default.settings();

    /// Sizes of the patches, coarse to fine, degrees. Where none are refined, the corners of the fine ones
    /// still serve to blend the coarse.
    fn patch_sizes_deg(&self) -> [f64; 2] {
        [self.block_deg, 0.5 * self.block_deg]
    }

    /// Whether pairs of patches may be refined.
    fn refines(&self) -> bool {
        self.tolerance.is_finite()
    }

    /// Data of a coarse block. Where finer ones may take its place, it needs no more to find where they must.
    fn coarse_neighbours(&self) -> usize {
        if self.refines() {
            3 * self.neighbours / 4
        } else {
            self.neighbours
        }
    }

    /// By how much blending may shift a block in any case, in natural logarithms.
    fn blend_limit(&self) -> f32 {
        2.0 * self.noise_sigma()
    }

    /// Standard deviation of the logarithm of one sample, as far as two fits can agree.
    fn noise_sigma(&self) -> f32 {
        self.noise_variance.sqrt().max(NOISE_MIN)
    }

    fn block(&self) -> block::BlockSettings {
        block::BlockSettings {
            range: self.range,
            anisotropy: (self.kernel_weight / self.coordinates.weight) as f32,
            noise_variance: self.noise_variance,
            nugget_min: self.nugget_min,
            drift: self.coordinates.drift(),
        }
    }
}

/// Relative errors below this are not refined: of a grey they are 116/3 · ∛Y · 0.002 in L*, less than a tenth at any Y.
const TARGET_ERROR: f32 = 0.002;
/// Two fits through different data never agree better than this, whatever the samples' noise.
const NOISE_MIN: f32 = 0.003;

impl std::fmt::Display for FillSettings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "blocks of {} deg, tolerance {:.2} noise, {} data, {}, kernel {} w={}, range {} radii, noise {:.2} %, nugget at least {:e}",
            self.block_deg,
            self.tolerance,
            self.neighbours,
            self.coordinates,
            self.kernel.name(),
            self.kernel_weight,
            self.range,
            100.0 * self.noise_variance.sqrt(),
            self.nugget_min
        )?;
        if self.one_bin_in > 1 {
            write!(f, ", one bin in {}", self.one_bin_in)?;
        }
        Ok(())
    }
}
