//! Values at any pair of directions, one at a time.

use super::bin_tree::{BinTree, Neighbourhood};
use super::settings::{BaselineSettings, Transform};
use super::system::System;
use super::{Failure, Interpolant};
use crate::bins::Bins;
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::interpolate::FillError;
use crate::interpolate::fill::MIN_BINS;

/// Bins, and how to interpolate between them.
pub struct Predictor<'a> {
    settings: BaselineSettings,
    tree: BinTree<'a>,
    interpolant: Box<dyn Interpolant>,
}

/// The working memory of one thread.
#[derive(Default)]
pub struct Workspace {
    near: Neighbourhood,
    /// Where equations are solved; its condition number is that of the last one.
    pub system: System,
}

impl Workspace {
    /// One whose system estimates its condition number.
    pub fn measuring_condition() -> Self {
        Self {
            near: Neighbourhood::default(),
            system: System::measuring_condition(),
        }
    }
}

/// Logarithms are cut off here: e^±60 is far beyond any BRDF and far within single precision.
const LOG_LIMIT: f64 = 60.0;

impl<'a> Predictor<'a> {
    /// Builds the tree.
    ///
    /// # Errors
    /// Fewer bins than [`MIN_BINS`].
    pub fn new(bins: &'a Bins, settings: &BaselineSettings) -> Result<Self, FillError> {
        if bins.bins().len() < MIN_BINS {
            return Err(FillError::TooFewBins(bins.bins().len()));
        }
        Ok(Self {
            settings: *settings,
            tree: BinTree::new(bins, settings),
            interpolant: settings.interpolant(),
        })
    }

    /// What it was made with.
    pub fn settings(&self) -> &BaselineSettings {
        &self.settings
    }

    /// Smallest value per channel that counts as positive: a ten-thousandth of the median.
    pub fn floor(&self) -> [f32; 3] {
        self.tree.floor()
    }

    /// The value that the method gives at a pair of unit vectors: also a negative one.
    ///
    /// # Errors
    /// Where the method fails; [`Predictor::nearest`] then has what there is.
    pub fn at(&self, light: Vec3, view: Vec3, work: &mut Workspace) -> Result<[f64; 3], Failure> {
        work.system.forget();
        self.tree
            .gather(light, view, self.settings.neighbours, &mut work.near);
        let value = self.interpolant.estimate(&work.near, &mut work.system)?;
        let value = match self.settings.values {
            Transform::Linear => value,
            // A NaN stays one.
            Transform::Logarithm => value.map(|v| v.clamp(-LOG_LIMIT, LOG_LIMIT).exponential()),
        };
        // As the single-precision number that it will be.
        if value.iter().all(|v| (*v as f32).is_finite()) {
            Ok(value)
        } else {
            Err(Failure::NotFinite)
        }
    }

    /// The value of the nearest bin.
    pub fn nearest(&self, light: Vec3, view: Vec3, work: &mut Workspace) -> [f64; 3] {
        self.tree.gather(light, view, 1, &mut work.near);
        let value = work.near.values.first().copied().unwrap_or_default();
        match self.settings.values {
            Transform::Linear => value,
            Transform::Logarithm => value.map(f64::exponential),
        }
    }
}
