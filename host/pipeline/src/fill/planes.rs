//! A fill in memory: a plane a channel, group by group.

use super::blocks::{Start, fill_bins_of};
use super::groups::{groups, groups_from_middle, spread_over};
use super::prepared::Prepared;
use super::symmetry::fit_of_others;
use crate::Error;
use crate::progress::{Progress, Step, step};
use gonia_brdf::interpolate::{AnyKernel, ErrorFall, FillSettings, NewBlock};
use gonia_brdf::scattered::ScatteredFit;
use gonia_brdf::{Bins, Grid, Symmetry};
use gonia_rig::SampleValues;

/// Planes that are filled group by group.
pub(super) struct Planes {
    grid: Grid,
    with_errors: bool,
    pub values: Vec<Vec<f32>>,
    /// Standard errors; of no length unless they are asked for.
    pub errors: Vec<Vec<f32>>,
    /// How errors fall with more frames, by the first group.
    pub fall: Option<ErrorFall>,
}

impl Planes {
    pub fn new(grid: Grid, channels: usize, with_errors: bool) -> Self {
        Self {
            grid,
            with_errors,
            values: vec![Vec::new(); channels],
            errors: vec![Vec::new(); channels],
            fall: None,
        }
    }

    /// A fit of few samples, three channels at a time.
    pub fn fill_by_fit(&mut self, fit: &ScatteredFit, samples: &SampleValues) {
        let n = self.values.len();
        for channels in groups::<3>(n) {
            let (dense, errors) = if channels == spread_over(n) {
                fit.dense(self.grid, self.with_errors)
            } else {
                let samples = samples.of_channels(channels);
                let fit = fit_of_others(fit, &samples, self.grid);
                fit.dense(self.grid, self.with_errors)
            };
            self.take(channels, dense.into_planes(), errors);
        }
    }

    /// Blocks, as many channels at a time as share a factorisation. Returns the settings. One channel or three
    /// need no samples: their bins are made.
    pub fn fill_by_blocks(
        &mut self,
        prepared: &Prepared,
        samples: &SampleValues,
        base: FillSettings,
        progress: &Progress<'_>,
    ) -> Result<FillSettings, Error> {
        let (n, start) = (self.values.len(), Start::Choose(base));
        let symmetry = prepared.completed_by;
        match n {
            1 => self.fill_group([0], &prepared.bins.channel(0), start, progress),
            3 => self.fill_group([0, 1, 2], &prepared.bins, start, progress),
            // Three times the work of three channels is more than that of 31.
            10.. => self.fill_groups::<31>(samples, symmetry, start, progress),
            _ => self.fill_groups::<3>(samples, symmetry, start, progress),
        }
    }

    fn fill_groups<const N: usize>(
        &mut self,
        samples: &SampleValues,
        symmetry: Symmetry,
        mut start: Start,
        progress: &Progress<'_>,
    ) -> Result<FillSettings, Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        for channels in groups_from_middle::<N>(self.values.len()) {
            let bins = bins_of(samples, channels, symmetry, self.grid, progress)?;
            let settings = self.fill_group(channels, &bins, start, progress)?;
            start = Start::Chosen(settings);
        }
        let (Start::Choose(settings) | Start::Chosen(settings)) = start;
        Ok(settings)
    }

    fn fill_group<const N: usize>(
        &mut self,
        channels: [usize; N],
        bins: &Bins<N>,
        start: Start,
        progress: &Progress<'_>,
    ) -> Result<FillSettings, Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let filled = fill_bins_of(bins, start, self.with_errors, progress)?;
        self.fall = self.fall.or(filled.fall);
        let errors = filled.errors.map(|bars| bars.standard_error);
        self.take(channels, filled.dense.into_planes(), errors);
        Ok(filled.settings)
    }

    /// Keeps the planes of channels that had none.
    pub fn take<const N: usize>(
        &mut self,
        channels: [usize; N],
        planes: [Vec<f32>; N],
        errors: Option<[Vec<f32>; N]>,
    ) {
        let errors = errors.unwrap_or_else(|| std::array::from_fn(|_| Vec::new()));
        for ((channel, plane), error) in channels.into_iter().zip(planes).zip(errors) {
            if self.values[channel].is_empty() {
                self.values[channel] = plane;
                self.errors[channel] = error;
            }
        }
    }
}

/// Some channels of the samples and of their images, in their bins.
pub(super) fn bins_of<const N: usize>(
    samples: &SampleValues,
    channels: [usize; N],
    symmetry: Symmetry,
    grid: Grid,
    progress: &Progress<'_>,
) -> Result<Bins<N>, Error> {
    step(progress, Step::Binning, |_| {
        let samples = samples.of_channels(channels);
        Ok(Bins::new(grid, &symmetry.completed(samples)))
    })
}
