//! A fill in memory: a plane a channel, group by group.

use super::blocks::{Start, fill_bins_of};
use super::groups::{groups, groups_from_middle, spread_over, stand_for_themselves};
use super::prepared::Prepared;
use super::symmetry::fit_of_others;
use crate::Error;
use crate::progress::{Progress, Step, step};
use gonia_brdf::interpolate::{AnyKernel, ErrorFall, FillSettings, NewBlock};
use gonia_brdf::scattered::ScatteredFit;
use gonia_brdf::{Bins, Grid, Symmetry};
use gonia_rig::SampleValues;
use rayon::prelude::*;

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

    /// A fit of few samples, as many channels at a time as share a factorisation. One channel or three need no samples:
    /// the fit is theirs.
    pub fn fill_by_fit(&mut self, fit: &ScatteredFit, samples: &SampleValues) {
        let n = self.values.len();
        match n {
            _ if stand_for_themselves(n) => self.fill_fit(spread_over(n), fit),
            10.. => self.fill_fits::<31>(fit, samples),
            _ => self.fill_fits::<3>(fit, samples),
        }
    }

    fn fill_fits<const N: usize>(&mut self, fit: &ScatteredFit, samples: &SampleValues) {
        for channels in groups::<N>(self.values.len()) {
            let samples = samples.of_channels(channels);
            self.fill_fit(channels, &fit_of_others(fit, &samples, self.grid));
        }
    }

    fn fill_fit<const N: usize>(&mut self, channels: [usize; N], fit: &ScatteredFit<N>) {
        let (dense, errors) = fit.dense(self.grid, self.with_errors);
        self.take(channels, dense.into_planes(), errors);
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

    /// Each value becomes the mean over all turns of light and view together, and over their mirror images where the
    /// symmetry has these, each standard error the root of the mean
    /// square: as if turned cells had one error, which is cautious.
    pub fn take_means_over_turns(&mut self, symmetry: Symmetry) {
        let mirrored = symmetry == Symmetry::Isotropic;
        for plane in &mut self.values {
            take_means_over_turns(self.grid, mirrored, plane, |value| value, |mean| mean);
        }
        for plane in self.errors.iter_mut().filter(|plane| !plane.is_empty()) {
            take_means_over_turns(self.grid, mirrored, plane, |error| error * error, f64::sqrt);
        }
    }
}

/// Puts in place of the values of cells that turns make of each other `back` of the mean of `of` of them.
fn take_means_over_turns(
    grid: Grid,
    mirrored: bool,
    plane: &mut [f32],
    of: impl Fn(f64) -> f64 + Sync,
    back: impl Fn(f64) -> f64 + Sync,
) {
    let (n, n_theta, n_phi) = (grid.n_directions(), grid.n_theta(), grid.n_phi());
    let values = &*plane;
    // Of each pair of polar angles, one a difference of azimuths.
    let means: Vec<Vec<f32>> = (0..n_theta * n_theta)
        .into_par_iter()
        .map(|pair| {
            let (light, view) = (pair / n_theta * n_phi, pair % n_theta * n_phi);
            let mean = |apart: usize| {
                let turned = (0..n_phi).map(|phi| {
                    let cell = grid.cell(light + phi, view + (phi + apart) % n_phi);
                    of(f64::from(values[cell]))
                });
                turned.sum::<f64>() / n_phi as f64
            };
            let means: Vec<f64> = (0..n_phi).map(mean).collect();
            let at = |apart: usize| match mirrored {
                true => 0.5 * (means[apart] + means[(n_phi - apart) % n_phi]),
                false => means[apart],
            };
            (0..n_phi).map(|apart| back(at(apart)) as f32).collect()
        })
        .collect();
    plane
        .par_chunks_mut(n)
        .enumerate()
        .for_each(|(light, views)| {
            for (view, value) in views.iter_mut().enumerate() {
                let apart = (view % n_phi + n_phi - light % n_phi) % n_phi;
                *value = means[light / n_phi * n_theta + view / n_phi][apart];
            }
        });
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
