//! Where the cells have their values from.

use gonia_brdf::interpolate::{self, IsotropicOrigins, OriginCounts};
use gonia_brdf::scattered::ScatteredFit;
use gonia_brdf::{Bins, Symmetry};

/// Where the cells have their values from.
pub(super) enum Origins<'a> {
    Isotropic(IsotropicOrigins),
    Anisotropic(&'a Bins),
}

impl<'a> Origins<'a> {
    /// Of cells that a fit fills, or the bins alone.
    pub fn of(bins: &'a Bins, fit: Option<&ScatteredFit>) -> Self {
        match fit.map(|fit| fit.choice().settings.symmetry) {
            Some(Symmetry::Isotropic) => Origins::Isotropic(IsotropicOrigins::of(bins, true)),
            Some(Symmetry::Turns) => Origins::Isotropic(IsotropicOrigins::of(bins, false)),
            _ => Origins::Anisotropic(bins),
        }
    }

    pub fn counts(&self) -> OriginCounts {
        match self {
            Origins::Isotropic(origins) => origins.counts(),
            Origins::Anisotropic(bins) => OriginCounts::of(bins),
        }
    }

    pub fn of_cells(&self) -> Vec<u8> {
        match self {
            Origins::Isotropic(origins) => origins.of_cells(),
            Origins::Anisotropic(bins) => interpolate::origins(bins),
        }
    }
}
