//! From bins to every cell of the grid.
//!
//! The paper interpolates each missing cell from its 200 nearest bins with radial basis functions,
//! and averages reciprocal values at the end. Here the cells of a *pair of patches* (a few degrees
//! of light directions × a few of view directions) share one neighbourhood and one factorisation;
//! values are logarithms at the mean measured directions, each bin counts at its reciprocal place
//! too, and only half of the pairs are solved, so the result is positive and exactly reciprocal.

pub mod block;
pub mod cholesky;
pub mod coordinates;
pub mod fill;
pub mod neighbours;
pub mod nodes;
pub mod patches;
pub mod select;

pub use coordinates::Coordinates;
pub use fill::{FillError, fill};
pub use select::{Selection, Trial, select};

/// How to interpolate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Size of the patches of directions, degrees.
    pub patch_deg: f64,
    /// Nodes a block.
    pub nodes: usize,
    /// Where distances are taken.
    pub coordinates: Coordinates,
    /// Range of the kernel in radii of the neighbourhood.
    pub range: f32,
    /// Variance of the natural logarithm of one sample.
    pub noise_variance: f32,
    /// Smallest nugget.
    pub nugget_min: f32,
}

impl Settings {
    /// What suits most materials; [`select`] finds what suits one.
    pub const DEFAULT: Settings = Settings {
        patch_deg: 4.0,
        nodes: 128,
        coordinates: Coordinates::HalfDifference { weight: 0.5 },
        range: 8.0,
        noise_variance: 1e-4,
        nugget_min: 1e-4,
    };

    fn block(&self) -> block::BlockSettings {
        block::BlockSettings {
            range: self.range,
            noise_variance: self.noise_variance,
            nugget_min: self.nugget_min,
        }
    }
}

impl std::fmt::Display for Settings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "blocks of {} deg, {} nodes, {}, range {} radii, noise {:.2} %, nugget at least {:e}",
            self.patch_deg,
            self.nodes,
            self.coordinates,
            self.range,
            100.0 * self.noise_variance.sqrt(),
            self.nugget_min
        )
    }
}
