//! From a frame to the values at its grid points: merging of exposures, registration by the four
//! fiducial lines, occlusion, sampling.
//!
//! | module or type | what it does |
//! |---|---|
//! | [`hdr`] | brackets of raw exposures to radiance and its variance |
//! | [`Registrar`], [`Registration`] | where the target is in a frame, and where the camera must have been |
//! | [`LinePoint`], [`Search`] | pieces of the fiducial lines, found from near or far, for a calibration |
//! | [`find_highlight`], [`Highlight`] | the light's image in a mirror, for a calibration |
//! | [`find_occlusion`], [`Mask`] | what hides the target |
//! | [`SamplingGrid`], [`PointValue`], [`LeftOut`] | the medians at the grid's points |
//! | [`IdealLight`] | the irradiance of a point light over the target |
//! | [`rectify`] | a frame as seen from straight above, for people |

mod growth;
pub mod hdr;
mod highlight;
mod hough;
mod ideal_light;
mod lines;
mod occlusion;
mod patch;
mod profile;
mod quantiles;
pub mod rectify;
mod refine;
mod register;
mod sampling;
mod turn;

pub use highlight::{Highlight, NoHighlight, find_highlight};
pub use ideal_light::IdealLight;
pub use occlusion::{Mask, find_occlusion};
pub use register::{
    LinePoint, OffPlace, Orientation, PoseOffset, Registrar, Registration, RegistrationFailure,
    RegistrationState, Search,
};
pub use sampling::{LeftOut, PointValue, SamplingGrid};
pub use turn::Turn;

/// Mean of the three channels: what fiducial lines and occlusions are looked for in.
fn luminance(rgb: [f32; 3]) -> f32 {
    (rgb[0] + rgb[1] + rgb[2]) * (1.0 / 3.0)
}
