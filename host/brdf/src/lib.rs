//! The numbers of a BRDF measurement: from samples to a dense anisotropic BRDF with an uncertainty, and
//! to the parameters of models. No files, no clock, no hardware.
//!
//! ```
//! use gonia_brdf::hemisphere::{paper_lights, paper_views};
//! use gonia_brdf::interpolate::{Data, FillSettings, fill, select};
//! use gonia_brdf::progress::silent;
//! use gonia_brdf::{Bins, Direction, Grid, Sample};
//!
//! // Samples as a rig measures them; here of a Lambertian surface, one a pose, of every fifth pose.
//! let samples: Vec<Sample> = (0..8505)
//!     .step_by(5)
//!     .map(|k| {
//!         let (light, view) = (paper_lights()[k / 81], paper_views()[k % 81]);
//!         Sample::new(light, view, [0.1, 0.2, 0.3]).in_frame(k as u32)
//!     })
//!     .collect();
//! let bins = Bins::new(Grid::with_step_deg(15.0)?, &samples);
//! let data = Data::new(&bins);
//! let base = FillSettings { block_deg: 30.0, ..FillSettings::DEFAULT };
//! let dense = fill(&data, &select(&data, base).settings, &silent)?;
//! let value = dense.lookup(Direction::from_deg(33.0, 10.0), Direction::from_deg(20.0, 200.0));
//! assert!((value[1] - 0.2).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | what it has |
//! |---|---|
//! | [`direction`], [`hemisphere`] | directions, poses, and the rings that the paper measures from |
//! | [`grid`], [`sample`], [`bins`] | the lattice of directions; a measured value; the median of those that share a cell |
//! | [`interpolate`] | the default method: bins → [`DenseBrdf`], cross-validation, error bars, kernels |
//! | [`scattered`], [`symmetry`] | few samples: a fit in double precision, asked anywhere, with the symmetry that they show |
//! | [`baselines`] | the paper's method and other known ones, one cell at a time |
//! | [`dense`] | a BRDF at every pair of directions of a grid |
//! | [`model`], [`fit`] | analytic models; their parameters, fitted to a table or to bins |
//! | [`Elementary`] | sine, logarithm and the like, with the same bits on every system |
//! | [`progress`] | what a caller hears of work that takes long |
//! | [`quantile`], [`random`] | medians; random numbers that are the same everywhere |
//!
//! Conventions: θ is the polar angle from the sample's normal, φ the azimuth, anticlockwise from the
//! sample's x axis seen from above, both in radians unless a name ends in `_deg`; a unit vector is
//! `(sin θ cos φ, sin θ sin φ, cos θ)`.
pub mod baselines;
pub mod bins;
pub mod dense;
pub mod direction;
mod elementary;
pub mod fit;
pub mod grid;
pub mod hemisphere;
pub mod interpolate;
mod isotropic_mean;
pub mod model;
pub mod progress;
pub mod quantile;
pub mod random;
pub mod sample;
pub mod scattered;
pub mod symmetry;

pub use bins::{Bin, Bins};
pub use dense::DenseBrdf;
pub use direction::{Direction, Pose, Vec3};
pub use elementary::Elementary;
pub use grid::Grid;
pub use isotropic_mean::IsotropicMean;
pub use model::Brdf;
pub use sample::Sample;
pub use symmetry::{MirrorPlane, Symmetry, SymmetryKind};
