//! Pictures of a BRDF in linear light: a sphere and a draped cylinder under directional lights.
//!
//! Camera space: x right, y up, z towards the viewer, who is far away (parallel projection). There
//! are no cast shadows and no inter-reflections; what is seen is f · E · cos θi.

mod bent;
pub mod color;
pub mod color_map;
mod cylinder;
mod environment;
mod light;
mod picture;
pub mod png;
mod shade;
mod spectrum;
mod sphere;
pub mod svg;
mod tabulated;
pub mod tone;

pub use bent::bent;
pub use cylinder::cylinder;
pub use environment::Environment;
pub use gonia_brdf::model::shading::Light;
pub use light::{from_above, single, studio};
pub use picture::Picture;
pub use spectrum::SpectrumColours;
pub use sphere::sphere;
pub use tabulated::Tabulated;

use gonia_brdf::direction::Vec3;
use gonia_brdf::model::shading::TangentFrame;

/// Towards the viewer.
const VIEWER: Vec3 = [0.0, 0.0, 1.0];
