//! Analytic BRDF models: the simulator's materials, and what measurements are compared with.

pub mod kurt;

pub use kurt::{Kurt, KurtLobe};

use crate::direction::Vec3;

/// A BRDF in 1/sr, per channel.
pub trait Brdf: Send + Sync {
    /// Value for unit vectors towards the light and the viewer, both with z > 0. The cosine of the
    /// light is not included.
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3];
}
