//! The numbers of a BRDF measurement. No files, no clock, no hardware.
//!
//! Conventions: θ is measured from the sample's normal, φ anticlockwise from the sample's x axis
//! seen from above, both in radians unless a name ends in `_deg`; a unit vector is
//! `(sin θ cos φ, sin θ sin φ, cos θ)`.
pub mod bins;
pub mod cellwise;
pub mod dense;
pub mod direction;
pub mod fit;
pub mod grid;
pub mod hemisphere;
pub mod interpolate;
pub mod model;
pub mod sample;
pub mod shading;

pub use bins::{Bin, Bins};
pub use dense::DenseBrdf;
pub use direction::{Direction, Pose, Vec3};
pub use grid::Grid;
pub use model::Brdf;
pub use sample::Sample;
