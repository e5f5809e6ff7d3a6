//! The symmetry of a material, and the fit of few samples that shows it.

use super::options::{CELLS_IN_MEMORY, FillMethod, FillOptions};
use crate::Error;
use crate::progress::{Progress, Step, step};
use crate::warnings;
use gonia_brdf::scattered::{ScatteredFit, are_images, is_few};
use gonia_brdf::{Bins, Direction, Grid, Sample, Symmetry, SymmetryKind};
use gonia_rig::Remark;

/// A fit of few samples, or of those of a material that is said to be isotropic; `None` of others.
pub(super) fn scattered_fit(
    samples: &[Sample],
    grid: Grid,
    options: &FillOptions,
    progress: &Progress<'_>,
) -> Result<Option<ScatteredFit>, Error> {
    let asked = options.symmetry;
    let possible = options.method == FillMethod::Blocks && grid.n_cells() <= CELLS_IN_MEMORY;
    if !possible {
        return Ok(None);
    }
    step(progress, Step::ChoosingSettings, |_| {
        Ok(if is_few(samples) {
            fit_about(samples, options)
        } else if asked == Some(SymmetryKind::Isotropic) {
            ScatteredFit::new(&few_of(samples, grid), asked)
        } else {
            None
        })
    })
}

/// The fit of other channels of the samples that a fit is of.
pub(super) fn fit_of_others<const N: usize>(
    fit: &ScatteredFit,
    samples: &[Sample<N>],
    grid: Grid,
) -> ScatteredFit<N> {
    if is_few(samples) {
        fit.of_channels(samples)
    } else {
        fit.of_channels(&few_of(samples, grid))
    }
}

/// Whether images of an isotropic material see it from all around. Blocks in all four dimensions are nearer then, by
/// a factor of four on plans of even rings, than a fit in three: lights of other azimuths show the same highlight between the
/// rings, where it falls between frames that are turned to one azimuth.
pub(super) fn is_seen_from_all_around(samples: &[Sample]) -> bool {
    let mut seen = [false; SECTORS];
    for sample in samples.iter().filter(|s| s.theta_i_deg > AZIMUTH_FROM_DEG) {
        let sector = sample.phi_i_deg / 360.0 * SECTORS as f32;
        seen[sector as usize % SECTORS] = true;
    }
    seen == [true; SECTORS] && are_images(samples)
}

/// Lights are all around when each of so many sectors has one …
const SECTORS: usize = 12;
/// … at a larger polar angle than this: nearer to the normal, one frame sees lights of all azimuths. Degrees.
const AZIMUTH_FROM_DEG: f32 = 30.0;

/// So many of many samples, at most, are looked at for a plane of symmetry, and for what contradicts it.
const LOOKED_AT: usize = 6000;

/// The fit of samples with the stated symmetry, about its plane where that is known.
fn fit_about(samples: &[Sample], options: &FillOptions) -> Option<ScatteredFit> {
    match options.symmetry_of_plane() {
        Some((kind, plane)) => ScatteredFit::about_plane(samples, kind, plane),
        None => ScatteredFit::new(samples, options.symmetry),
    }
}

/// The symmetry of many samples that is stated, with the plane that is known or that some of them show, and what
/// these say against it.
pub(super) fn symmetry_of_many(
    samples: &[Sample],
    options: &FillOptions,
) -> (Symmetry, Vec<Remark>) {
    if matches!(
        options.symmetry,
        None | Some(SymmetryKind::None | SymmetryKind::Isotropic)
    ) {
        return (Symmetry::None, Vec::new());
    }
    let step = samples.len().div_ceil(LOOKED_AT).max(1);
    let some: Vec<Sample> = samples.iter().step_by(step).copied().collect();
    match fit_about(&some, options) {
        Some(fit) => (
            fit.choice().settings.symmetry,
            warnings::remarks_on_symmetry(&fit),
        ),
        None => (Symmetry::None, Vec::new()),
    }
}

/// Of many samples of an isotropic material, the medians of those that share a cell when all are turned to
/// one azimuth of light.
fn few_of<const N: usize>(samples: &[Sample<N>], grid: Grid) -> Vec<Sample<N>> {
    let turned = samples.iter().map(|s| Sample {
        phi_i_deg: 0.0,
        phi_v_deg: (s.phi_v_deg - s.phi_i_deg).rem_euclid(360.0),
        ..*s
    });
    let bins = Bins::new(grid, &turned.collect::<Vec<Sample<N>>>());
    let bins = bins.bins().iter();
    bins.map(|bin| {
        let direction = |v: [f32; 3]| Direction::from_vec3(v.map(f64::from));
        Sample::new(direction(bin.light), direction(bin.view), bin.median)
    })
    .collect()
}
