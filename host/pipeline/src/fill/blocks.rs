//! Bins → dense BRDF, block by block.

use crate::Error;
use crate::progress::{Progress, Step, step};
use gonia_brdf::interpolate::{
    self, AnyKernel, Calibration, Data, ErrorBars, ErrorFall, FillSettings, NewBlock,
};
use gonia_brdf::{Bins, DenseBrdf};

/// Bins, interpolated block by block.
#[derive(Clone, Debug)]
pub struct FilledBins<const N: usize = 3> {
    /// The values.
    pub dense: DenseBrdf<N>,
    /// Standard errors, where asked for.
    pub errors: Option<ErrorBars<N>>,
    /// How these would fall with more frames, where they were asked for.
    pub fall: Option<ErrorFall>,
    /// The settings, as chosen for the material.
    pub settings: FillSettings,
}

/// Interpolates bins block by block, with the settings that suit the material, starting from `base`.
///
/// # Errors
/// Too few bins, or too few frames for standard errors.
pub fn fill_bins(
    bins: &Bins,
    base: FillSettings,
    with_errors: bool,
    progress: &Progress<'_>,
) -> Result<FilledBins, Error> {
    fill_bins_of(bins, Start::Choose(base), with_errors, progress)
}

/// What the settings of a fill come from.
#[derive(Clone, Copy)]
pub(super) enum Start {
    /// The material's own, from these.
    Choose(FillSettings),
    /// As they were chosen for other channels of the same samples.
    Chosen(FillSettings),
}

/// [`fill_bins`] of any number of channels that has blocks.
pub(super) fn fill_bins_of<const N: usize>(
    bins: &Bins<N>,
    start: Start,
    with_errors: bool,
    progress: &Progress<'_>,
) -> Result<FilledBins<N>, Error>
where
    dyn AnyKernel: NewBlock<N>,
{
    let (Start::Choose(base) | Start::Chosen(base)) = start;
    let known = sorted(bins, base, progress)?;
    let settings = match start {
        Start::Choose(base) => chosen(&known, base, progress)?,
        Start::Chosen(settings) => settings,
    };
    let (dense, errors, fall) = if with_errors {
        let known = known.in_order_for(settings.coordinates);
        let (calibration, fall) = step(progress, Step::CalibratingErrorBars, |_| {
            let calibration = Calibration::new(&known, &settings).ok_or(Error::TooFewFrames)?;
            let fall = ErrorFall::measure(&known, &settings, &calibration);
            Ok::<_, Error>((calibration, fall))
        })?;
        let (dense, errors) = step(progress, Step::Interpolating, |share| {
            interpolate::fill_with_errors(&known, &settings, &calibration, share)
                .map_err(Error::from)
        })?;
        (dense, Some(errors), Some(fall))
    } else {
        let dense = step(progress, Step::Interpolating, |share| {
            interpolate::fill(&known, &settings, share).map_err(Error::from)
        })?;
        (dense, None, None)
    };
    Ok(FilledBins {
        dense,
        errors,
        fall,
        settings,
    })
}

pub(super) fn sorted<'a, const N: usize>(
    bins: &'a Bins<N>,
    base: FillSettings,
    progress: &Progress<'_>,
) -> Result<Data<'a, N>, Error> {
    step(progress, Step::Sorting, |_| {
        Ok(Data::thinned(bins, base.one_bin_in))
    })
}

pub(super) fn chosen<const N: usize>(
    known: &Data<'_, N>,
    base: FillSettings,
    progress: &Progress<'_>,
) -> Result<FillSettings, Error>
where
    dyn AnyKernel: NewBlock<N>,
{
    step(progress, Step::ChoosingSettings, |_| {
        Ok(interpolate::select(known, base).settings)
    })
}
