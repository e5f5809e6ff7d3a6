//! Where the cells have their values from.

use gonia_brdf::interpolate::{self, IsotropicOrigins, OriginCounts};
use gonia_brdf::scattered::ScatteredFit;
use gonia_brdf::{Bins, Symmetry};

/// Where the cells have their values from.
pub(super) enum Origins<'a> {
    Isotropic(IsotropicOrigins),
    Anisotropic {
        bins: &'a Bins,
        /// Cells into which samples fell themselves, where the bins hold their images too.
        own: Option<&'a [u64]>,
    },
}

impl<'a> Origins<'a> {
    /// Of cells that a fit fills, or the bins alone; `own` are the cells of samples themselves where the bins hold images.
    pub fn of(bins: &'a Bins, own: Option<&'a [u64]>, fit: Option<&ScatteredFit>) -> Self {
        match fit.map(|fit| fit.choice().settings.symmetry) {
            Some(Symmetry::Isotropic) => Origins::Isotropic(IsotropicOrigins::of(bins, true)),
            Some(Symmetry::Turns) => Origins::Isotropic(IsotropicOrigins::of(bins, false)),
            _ => Origins::Anisotropic { bins, own },
        }
    }

    pub fn counts(&self) -> OriginCounts {
        match self {
            Origins::Isotropic(origins) => origins.counts(),
            Origins::Anisotropic { bins, own: None } => OriginCounts::of(bins),
            Origins::Anisotropic {
                bins,
                own: Some(own),
            } => OriginCounts::with_images(bins, own),
        }
    }

    pub fn of_cells(&self) -> Vec<u8> {
        match self {
            Origins::Isotropic(origins) => origins.of_cells(),
            Origins::Anisotropic { bins, own: None } => interpolate::origins(bins),
            Origins::Anisotropic {
                bins,
                own: Some(own),
            } => interpolate::origins_with_images(bins, own),
        }
    }
}
