//! Samples → bins → dense BRDF.
//!
//! | file | what it does |
//! |---|---|
//! | `options` | how to fill, and what of that goes together |
//! | `prepared` | sorts samples out, puts them into bins, remarks on them |
//! | `symmetry` | finds their symmetry, and fits few of them |
//! | `origins` | where the cells have their values from |
//! | `groups` | which channels are filled together |
//! | `blocks`, `planes` | bins → planes in memory |
//! | `rows` | the same, written row by row |
//! | `parts` | the same by several processes |
//! | `directions` | a fit that is asked without a grid |
//! | `behind` | the same of a dense BRDF, whose samples are still there |

mod behind;
mod blocks;
mod directions;
mod groups;
mod options;
mod origins;
mod parts;
mod planes;
mod prepared;
mod rows;
mod symmetry;

pub use behind::Behind;
pub use blocks::{FilledBins, fill_bins};
pub use directions::FitOfSamples;
pub use options::{FillMethod, FillOptions};
pub use parts::{Begun, FillInParts};
pub use rows::fill_to_file;

use crate::Error;
use crate::budget;
use crate::progress::{Progress, Step, step};
use crate::warnings::{self, DirectionalAlbedo};
use gonia_brdf::baselines;
use gonia_brdf::interpolate::OriginCounts;
use gonia_formats::dense::ChannelErrors;
use gonia_rig::{DenseChannels, DenseFile, Remark, SampleValues, Scale};
use groups::stand_for_themselves;
use origins::Origins;
use planes::Planes;
use prepared::Prepared;

/// How many samples and bins there were.
#[derive(Clone, Debug, PartialEq)]
pub struct FillCounts {
    /// Samples that fell into a bin.
    pub binned: usize,
    /// Samples outside the grid, or left out.
    pub outside: usize,
    /// Bins that hold a sample.
    pub bins: usize,
    /// Interpolations that failed and got the nearest value; baselines only.
    pub failed: u64,
    /// Values that were not positive and were raised; baselines only.
    pub raised: u64,
}

/// How a dense BRDF came about.
#[derive(Clone, Debug)]
pub struct FillAccount {
    /// What became of the samples.
    pub counts: FillCounts,
    /// The method's settings, as chosen for the material, for people.
    pub settings: String,
    /// The symmetry that the values have, and why, for people.
    pub symmetry: String,
    /// Where the cells' values come from.
    pub origins: OriginCounts,
    /// The directional albedo, its highest within the measured polar angles.
    pub albedo: DirectionalAlbedo,
    /// What in the samples and in the result speaks against what they are taken for.
    pub remarks: Vec<Remark>,
}

/// A dense BRDF, and how it came about.
pub struct Filled {
    /// The values with their scale and provenance.
    pub dense: DenseChannels,
    /// Standard errors, where asked for.
    pub errors: Option<ChannelErrors>,
    /// Cells with a sample, by number ([`Grid::cell`](gonia_brdf::Grid::cell)).
    pub cells: Vec<u64>,
    /// How it came about.
    pub account: FillAccount,
}

impl Filled {
    /// The dense BRDF of colours; one value is a grey.
    ///
    /// # Errors
    /// Bands, which are no colours: see [`colours_of`](crate::colours_of).
    pub fn into_rgb(self) -> Result<DenseFile, Error> {
        let channels = self.dense.channels.clone();
        self.dense.into_rgb().ok_or(Error::NoColours(channels))
    }

    /// Standard errors as shares of the values they belong to, mean over the channels, cell by cell; where they were
    /// asked for.
    pub fn relative_errors(&self) -> Option<Vec<f32>> {
        let errors = &self.errors.as_ref()?.standard_error;
        let of_cell = |cell: usize| {
            let planes = errors.iter().zip(&self.dense.planes);
            let shares = planes.map(|(error, value)| error[cell] / value[cell]);
            shares.sum::<f32>() / errors.len() as f32
        };
        Some((0..self.dense.grid.n_cells()).map(of_cell).collect())
    }
}

/// Bins samples of any channels, chooses the settings that suit the material, and interpolates every cell of the
/// grid. The result has the samples' channels and scale. The grid must fit memory. Samples below the horizon or
/// not finite are left out, negative polar angles are turned ([`keep_sound`](gonia_rig::keep_sound)); the remarks
/// say so, and what else speaks against the samples.
///
/// # Errors
/// Options that are not possible, samples that contradict what they are taken for, too few bins, or too few
/// frames for standard errors.
pub fn fill(
    samples: impl Into<SampleValues>,
    scale: Scale,
    options: &FillOptions,
    progress: &Progress<'_>,
) -> Result<Filled, Error> {
    let mut samples = samples.into();
    let channels = samples.channels().clone();
    options.fits_memory(&channels)?;
    let (grid, base) = options.check()?;
    let prepared = Prepared::new(&mut samples, grid, options, true, progress)?;
    if stand_for_themselves(channels.count()) {
        samples = Vec::new().into();
    }
    let mut counts = prepared.counts();
    let mut planes = Planes::new(grid, channels.count(), options.with_errors);
    let settings = match (options.method, &prepared.fit) {
        (FillMethod::Blocks, Some(fit)) => {
            step(progress, Step::Interpolating, |_| {
                planes.fill_by_fit(fit, &samples);
                Ok::<_, Error>(())
            })?;
            fit.choice().settings.to_string()
        }
        (FillMethod::Blocks, None) => {
            let settings = planes.fill_by_blocks(&prepared, &samples, base, progress)?;
            if prepared.turns {
                planes.take_means_over_turns(prepared.completed_by);
                format!("{settings}, mean over turns")
            } else {
                settings.to_string()
            }
        }
        (FillMethod::Cellwise(settings), _) => {
            let filled = step(progress, Step::Interpolating, |share| {
                baselines::fill(&prepared.bins, &settings, share).map_err(Error::from)
            })?;
            (counts.failed, counts.raised) = (filled.failed, filled.raised);
            planes.take([0, 1, 2], filled.dense.into_planes(), None);
            settings.to_string()
        }
    };
    let mut provenance = prepared.provenance(&settings, options);
    provenance.extend(planes.fall.as_ref().map(budget::fall_fact));
    let errors = options.with_errors.then(|| ChannelErrors {
        channels: channels.clone(),
        standard_error: planes.errors,
        origin: Origins::of(
            &prepared.bins,
            prepared.own.as_deref(),
            prepared.fit.as_ref(),
        )
        .of_cells(),
    });
    let dense = DenseChannels {
        channels,
        grid,
        planes: planes.values,
        scale,
        provenance,
    };
    let albedo = DirectionalAlbedo::of_channels(&dense, prepared.highest_deg());
    let cells = prepared.bins.bins().iter().map(|b| b.cell).collect();
    let mut remarks = prepared.remarks;
    remarks.extend(warnings::remark_on_energy(&albedo, scale));
    let account = FillAccount {
        counts,
        settings,
        symmetry: prepared.symmetry,
        origins: prepared.origins,
        albedo,
        remarks,
    };
    Ok(Filled {
        dense,
        errors,
        cells,
        account,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
