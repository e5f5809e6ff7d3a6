//! A table as a BRDF of any two directions.

use gonia_brdf::direction::Vec3;
use gonia_brdf::{Brdf, DenseBrdf, Direction};

/// A dense BRDF looked up between its nodes, times a factor.
#[derive(Clone, Copy, Debug)]
pub struct Tabulated<'a> {
    dense: &'a DenseBrdf,
    factor: f64,
}

impl<'a> Tabulated<'a> {
    /// The table as it is.
    pub fn new(dense: &'a DenseBrdf) -> Self {
        Self { dense, factor: 1.0 }
    }

    /// The table times a factor, to bring a relative one to another's scale.
    pub fn scaled(dense: &'a DenseBrdf, factor: f64) -> Self {
        Self { dense, factor }
    }
}

impl Brdf for Tabulated<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        self.dense
            .lookup(Direction::from_vec3(light), Direction::from_vec3(view))
            .map(|value| self.factor * f64::from(value))
    }
}
