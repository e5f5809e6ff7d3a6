//! The fit behind a dense BRDF: asked instead of its grid, where the samples are still there.

use super::directions::FitOfSamples;
use crate::Error;
use gonia_brdf::random::Random;
use gonia_brdf::{Direction, Elementary};
use gonia_formats::dense::DenseLookup;
use gonia_formats::fit_source::{FitSource, SourceLost};
use gonia_formats::samples::read_channels_of_all;
use gonia_rig::Remark;
use std::path::{Path, PathBuf};

/// What there is behind the grid of a dense BRDF.
pub enum Behind {
    /// Nothing: its values are not those of a fit that can be made again.
    Grid,
    /// The fit that its values are of.
    Fit {
        /// The fit.
        fit: Box<FitOfSamples>,
        /// The files of its samples.
        samples: Vec<PathBuf>,
        /// What is to be said of these.
        remarks: Vec<Remark>,
    },
    /// A fit whose samples are not there.
    Missing(PathBuf),
    /// A fit of other samples, or of other values than the grid's.
    Other(Remark),
}

/// Pairs of directions at which fit and grid are compared.
const COMPARED: usize = 64;
/// Fit and grid are not of one BRDF when half of those pairs differ by more than this, in natural logarithms.
const AGREE: f32 = 0.1;

impl Behind {
    /// Makes the fit again that a dense BRDF's values are of, by what its file says of it, and looks whether they
    /// are.
    ///
    /// # Errors
    /// Samples that are there, and cannot be read or fitted; a value of the dense BRDF that cannot be read.
    pub fn of(path: &Path, dense: &mut DenseLookup) -> Result<Self, Error> {
        let Some(source) = FitSource::of(dense.provenance()) else {
            return Ok(Self::Grid);
        };
        let other = |what: String| {
            let remedy = "the grid is evaluated, linear between its nodes; make it anew with gonia fill, or give --grid";
            Ok(Self::Other(Remark::new(path.display(), what, remedy)))
        };
        let samples = match source.find(path) {
            Ok(samples) => samples,
            Err(SourceLost::Missing(file)) => return Ok(Self::Missing(file)),
            Err(SourceLost::Changed(file)) => {
                return other(format!(
                    "{} has changed since it was filled from it",
                    file.display()
                ));
            }
        };
        let read = read_channels_of_all(&samples, Some(dense.scale()))?;
        let mut remarks = read.remarks;
        let (fit, said) = match (source.symmetry, source.plane) {
            (Some(kind), Some(plane)) => FitOfSamples::about_plane(read.values, kind, plane)?,
            (symmetry, _) => FitOfSamples::new(read.values, symmetry)?,
        };
        remarks.extend(said);
        if fit.channels() != dense.channels() {
            return other(format!(
                "it has the channels {}, and its samples {}",
                dense.channels(),
                fit.channels()
            ));
        }
        let apart = difference(&fit, dense)?;
        if apart > AGREE {
            return other(format!(
                "its values are not those of its samples, half of them more than {:.0} % off",
                100.0 * apart
            ));
        }
        Ok(Self::Fit {
            fit: Box::new(fit),
            samples,
            remarks,
        })
    }
}

/// Median over nodes of the grid of how far fit and grid are apart, in natural logarithms.
fn difference(fit: &FitOfSamples, dense: &mut DenseLookup) -> Result<f32, Error> {
    let grid = dense.grid();
    let mut random = Random::new(1);
    let mut node = || {
        let light = Direction::from_deg(random.between(0.0, 75.0), random.between(0.0, 360.0));
        let nearest = grid.nearest(light.theta_deg(), light.phi_deg());
        nearest.map_or(light, |node| grid.direction(node))
    };
    let pairs: Vec<_> = (0..COMPARED).map(|_| (node(), node())).collect();
    let mut apart = Vec::new();
    for (values, (light, view)) in fit.at_all(&pairs).into_iter().zip(&pairs) {
        let of_grid = dense.lookup(*light, *view)?;
        for (fitted, value) in values.into_iter().zip(of_grid) {
            apart.push((fitted / value).natural_log().abs());
        }
    }
    apart.sort_by(f32::total_cmp);
    Ok(apart.get(apart.len() / 2).copied().unwrap_or(0.0))
}
