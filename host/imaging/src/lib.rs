//! From a frame to the values at its grid points: registration by the four lines, occlusion,
//! sampling.

pub mod hdr;
mod hough;
pub mod ideal_light;
mod lines;
pub mod occlusion;
mod patch;
mod profile;
mod quantiles;
pub mod rectify;
mod refine;
pub mod register;
pub mod sampling;

pub use ideal_light::IdealLight;
pub use occlusion::Mask;
pub use register::{PoseOffset, Reason, Registrar, Registration, State};
pub use sampling::{LeftOut, PointValue, SamplingGrid};

/// Mean of the three channels: what marks and occlusions are looked for in.
fn luminance(rgb: [f32; 3]) -> f32 {
    (rgb[0] + rgb[1] + rgb[2]) * (1.0 / 3.0)
}
