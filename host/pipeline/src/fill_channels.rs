//! Samples of any number of channels → dense BRDF.
//!
//! Channels of the same samples have their places in common, so that a factorisation serves for many of them:
//! for as many as [`WIDTHS`] has. Up to nine go in groups of three, more in groups of 31: the last of the groups
//! share some channels with the others, and a group of fewer has some of them twice. Doubts, symmetry and the choice of the settings rest on three channels
//! that are spread over all.

use crate::Error;
use crate::doubts::{self, AlbedoRows, DirectionalAlbedo};
use crate::fill::{
    Binned, CELLS_IN_MEMORY, FillCounts, FillMethod, FillOptions, FilledFile, Origins, Start,
    chosen, few_of, fill_bins_of, first_three, fit_of_samples, provenance_of, sorted,
};
use crate::progress::{Progress, Step, step};
use crate::provenance::Provenance;
use gonia_brdf::interpolate::{
    AnyKernel, ByRows, FillSettings, NewBlock, OriginCounts, WIDTHS, origins,
};
use gonia_brdf::scattered::{ScatteredFit, is_few};
use gonia_brdf::{Bins, Grid, Symmetry, SymmetryKind};
use gonia_formats::dense::{ChannelErrors, RowsNote, write_dense_by_rows};
use gonia_rig::{ChannelSamples, Channels, DenseChannels, Remark, SampleSet, Scale};
use std::path::Path;

/// A dense BRDF of any channels, and how it came about: see [`Filled`](crate::Filled).
pub struct FilledChannels {
    /// The values with their scale and provenance.
    pub dense: DenseChannels,
    /// Standard errors, where asked for.
    pub errors: Option<ChannelErrors>,
    /// What became of the samples.
    pub counts: FillCounts,
    /// The method's settings, as chosen for the material, for people.
    pub settings: String,
    /// The symmetry that the values have, and why, for people.
    pub symmetry: String,
    /// Where the cells' values come from.
    pub origins: OriginCounts,
    /// The directional albedo of the channel that reflects most.
    pub albedo: DirectionalAlbedo,
    /// What in the samples and in the result speaks against what they are taken for.
    pub remarks: Vec<Remark>,
}

impl FillOptions {
    /// Whether so many channels on the grid fit memory: see [`FillOptions::fits_memory`].
    ///
    /// # Errors
    /// As [`FillOptions::check`]; a method or a number of channels for which there is no way.
    pub fn channels_fit_memory(&self, channels: &Channels) -> Result<bool, Error> {
        let (grid, _) = self.check()?;
        let n = channels.count();
        if self.method != FillMethod::Blocks {
            return Err(Error::Option {
                option: "--method",
                found: format!("with the channels {channels}"),
                remedy: "only the default method fills other channels than r, g, b; leave it out"
                    .into(),
            });
        }
        if grid.n_cells() * n <= 3 * CELLS_IN_MEMORY {
            return Ok(true);
        }
        if self.with_errors || !WIDTHS.contains(&n) {
            let gigabytes = grid.n_cells() as f64 * n as f64 * 4e-9;
            return Err(Error::Option {
                option: "--step",
                found: self.step_deg.to_string(),
                remedy: format!(
                    "{n} channels of this grid are {gigabytes:.1} GB, which are filled row by row, which 1, 3 or 31 channels without --error can be; take a coarser step"
                ),
            });
        }
        Ok(false)
    }
}

/// Bins samples of any channels, chooses the settings that suit the material, and interpolates every cell of the
/// grid, which must fit memory: see [`fill`](crate::fill).
///
/// # Errors
/// As [`fill`](crate::fill), and [`FillOptions::channels_fit_memory`].
pub fn fill_channels(
    mut samples: ChannelSamples,
    scale: Scale,
    options: &FillOptions,
    progress: &Progress<'_>,
) -> Result<FilledChannels, Error> {
    options.channels_fit_memory(&samples.channels)?;
    let (grid, base) = options.check()?;
    let mut remarks = doubts::of_oddities(&samples.keep_sound());
    let binned = binned(&samples, scale, grid, options, progress)?;
    let mut work = Work {
        samples: &samples,
        grid,
        with_errors: options.with_errors,
        planes: vec![Vec::new(); samples.channels.count()],
        errors: vec![Vec::new(); samples.channels.count()],
    };
    let settings = match &binned.fit {
        Some(fit) => step(progress, Step::Interpolating, |_| {
            work.by_fit(fit);
            Ok::<_, Error>(fit.choice().settings.to_string())
        })?,
        None => work.by_blocks(&binned, base, progress)?.to_string(),
    };
    let Work { planes, errors, .. } = work;
    let mut provenance = provenance_of(&settings);
    provenance.insert("symmetry".into(), binned.symmetry.clone());
    let dense = DenseChannels {
        channels: samples.channels.clone(),
        grid,
        planes,
        scale,
        provenance,
    };
    let albedo = DirectionalAlbedo::of_channels(&dense, binned.highest_deg());
    let counts = binned.counts();
    let errors = options.with_errors.then(|| ChannelErrors {
        channels: samples.channels.clone(),
        standard_error: errors,
        origin: match &binned.fit {
            Some(fit) => Origins::of(&binned.bins, fit).of_cells(),
            None => origins(&binned.bins),
        },
    });
    remarks.extend(binned.remarks);
    remarks.extend(doubts::remark_on_energy(&albedo, scale));
    Ok(FilledChannels {
        dense,
        errors,
        counts,
        settings,
        symmetry: binned.symmetry,
        origins: binned.origins,
        albedo,
        remarks,
    })
}

/// Fills a grid that does not fit memory with so many channels, and writes it row by row: see
/// [`fill_to_file`](crate::fill_to_file).
///
/// # Errors
/// As [`fill_channels`], and when the file cannot be written.
pub fn fill_channels_to_file(
    mut samples: ChannelSamples,
    scale: Scale,
    options: &FillOptions,
    path: &Path,
    facts: &Provenance,
    progress: &Progress<'_>,
) -> Result<FilledFile, Error> {
    options.channels_fit_memory(&samples.channels)?;
    let (grid, base) = options.check()?;
    let mut remarks = doubts::of_oddities(&samples.keep_sound());
    let binned = binned(&samples, scale, grid, options, progress)?;
    let rows = ToRows {
        samples: &samples,
        scale,
        grid,
        base,
        path,
        facts,
        binned: &binned,
    };
    let (settings, albedo) = match samples.channels.count() {
        1 => rows.write::<1>(&binned.bins.channel(0), progress),
        31 => rows.write::<31>(&rows.bins(), progress),
        _ => rows.write::<3>(&rows.bins(), progress),
    }?;
    remarks.extend(binned.remarks.iter().cloned());
    remarks.extend(doubts::remark_on_energy(&albedo, scale));
    Ok(FilledFile {
        counts: binned.counts(),
        settings,
        origins: binned.origins,
        albedo,
        remarks,
    })
}

/// Fits of some of the samples' channels, each with the numbers of its three.
pub type ChannelFits = Vec<([usize; 3], ScatteredFit)>;

/// Fits of samples of any channels that are asked at any directions, without a grid, and what is to be said of
/// the samples: see [`fit_of_samples`]. One symmetry is found for all.
///
/// # Errors
/// As [`fit_of_samples`].
pub fn fits_of_channels(
    samples: &mut ChannelSamples,
    symmetry: Option<SymmetryKind>,
) -> Result<(ChannelFits, Vec<Remark>), Error> {
    let mut remarks = doubts::of_oddities(&samples.keep_sound());
    let n = samples.channels.count();
    let (spread, said) = fit_of_samples(samples.of_channels(spread_over(n)), symmetry)?;
    remarks.extend(said);
    let of_group = |first: usize| {
        let channels = group(first, n);
        (channels, spread.of_channels(&samples.of_channels(channels)))
    };
    Ok((groups(n, 3).into_iter().map(of_group).collect(), remarks))
}

/// Three channels of so many that stand for all.
fn spread_over(channels: usize) -> [usize; 3] {
    [1, 3, 5].map(|sixth| sixth * channels / 6)
}

/// Three channels that stand for all, in their bins.
fn binned(
    samples: &ChannelSamples,
    scale: Scale,
    grid: Grid,
    options: &FillOptions,
    progress: &Progress<'_>,
) -> Result<Binned, Error> {
    let of_all = SampleSet {
        samples: samples.of_channels(spread_over(samples.channels.count())),
        scale,
    };
    Binned::new(of_all, grid, options, progress)
}

/// First channels of the groups of `width` that some channels are filled in, evenly spread.
fn groups(channels: usize, width: usize) -> Vec<usize> {
    let count = channels.div_ceil(width);
    let spread = channels.saturating_sub(width);
    (0..count)
        .map(|k| k * spread / (count - 1).max(1))
        .collect()
}

/// The channels of the group that begins with `first`, of so many channels; of fewer than the group's some twice.
fn group<const N: usize>(first: usize, channels: usize) -> [usize; N] {
    std::array::from_fn(|c| {
        if channels < N {
            c * channels / N
        } else {
            first + c
        }
    })
}

/// Planes that are filled group by group.
struct Work<'a> {
    samples: &'a ChannelSamples,
    grid: Grid,
    with_errors: bool,
    planes: Vec<Vec<f32>>,
    /// Standard errors; of no length unless they are asked for.
    errors: Vec<Vec<f32>>,
}

impl Work<'_> {
    /// A fit of few samples, three channels at a time.
    fn by_fit(&mut self, fit: &ScatteredFit) {
        let n = self.planes.len();
        for first in groups(n, 3) {
            let channels = group(first, n);
            let samples = self.samples.of_channels(channels);
            let fit = if is_few(&samples) {
                fit.of_channels(&samples)
            } else {
                fit.of_channels(&few_of(&samples, self.grid))
            };
            let (dense, errors) = fit.dense(self.grid, self.with_errors);
            self.take(channels, dense.into_planes(), errors);
        }
    }

    /// Blocks, as many channels at a time as share a factorisation. Returns the settings.
    fn by_blocks(
        &mut self,
        binned: &Binned,
        base: FillSettings,
        progress: &Progress<'_>,
    ) -> Result<FillSettings, Error> {
        match self.planes.len() {
            1 => {
                let bins = binned.bins.channel(0);
                let filled = fill_bins_of(&bins, Start::Choose(base), self.with_errors, progress)?;
                let errors = filled.errors.map(|bars| bars.standard_error);
                self.take([0], filled.dense.into_planes(), errors);
                Ok(filled.settings)
            }
            // Three times the work of three channels is more than that of 31.
            10.. => self.in_groups::<31>(binned.completed_by, base, progress),
            _ => self.in_groups::<3>(binned.completed_by, base, progress),
        }
    }

    fn in_groups<const N: usize>(
        &mut self,
        symmetry: Symmetry,
        base: FillSettings,
        progress: &Progress<'_>,
    ) -> Result<FillSettings, Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let n = self.planes.len();
        let mut firsts = groups(n, N);
        // The middle of a spectrum chooses for all.
        let middle = firsts.len() / 2;
        firsts.swap(0, middle);
        let mut start = Start::Choose(base);
        for first in firsts {
            let channels: [usize; N] = group(first, n);
            let bins = bins_of(self.samples, channels, symmetry, self.grid, progress)?;
            let filled = fill_bins_of(&bins, start, self.with_errors, progress)?;
            let errors = filled.errors.map(|bars| bars.standard_error);
            self.take(channels, filled.dense.into_planes(), errors);
            start = Start::Chosen(filled.settings);
        }
        let (Start::Choose(settings) | Start::Chosen(settings)) = start;
        Ok(settings)
    }

    /// Keeps the planes of channels that had none.
    fn take<const N: usize>(
        &mut self,
        channels: [usize; N],
        planes: [Vec<f32>; N],
        errors: Option<[Vec<f32>; N]>,
    ) {
        let errors = errors.unwrap_or_else(|| std::array::from_fn(|_| Vec::new()));
        for ((channel, plane), error) in channels.into_iter().zip(planes).zip(errors) {
            if self.planes[channel].is_empty() {
                self.planes[channel] = plane;
                self.errors[channel] = error;
            }
        }
    }
}

/// Some channels of the samples and of their images, in their bins.
fn bins_of<const N: usize>(
    samples: &ChannelSamples,
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

/// A fill that is written row by row.
struct ToRows<'a> {
    samples: &'a ChannelSamples,
    scale: Scale,
    grid: Grid,
    base: FillSettings,
    path: &'a Path,
    facts: &'a Provenance,
    binned: &'a Binned,
}

impl ToRows<'_> {
    fn bins<const N: usize>(&self) -> Bins<N> {
        let samples = self.samples.of_channels(std::array::from_fn(|c| c));
        Bins::new(self.grid, &self.binned.completed_by.completed(samples))
    }

    /// Returns the settings, and the directional albedo of the three channels that stand for all.
    fn write<const N: usize>(
        &self,
        bins: &Bins<N>,
        progress: &Progress<'_>,
    ) -> Result<(String, DirectionalAlbedo), Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let known = sorted(bins, self.base, progress)?;
        let settings = chosen(&known, self.base, progress)?;
        let rows = step(progress, Step::FittingBlocks, |share| {
            ByRows::new(&known, &settings, share).map_err(Error::from)
        })?;
        let text = settings.to_string();
        let mut provenance = provenance_of(&text);
        provenance.insert("symmetry".into(), self.binned.symmetry.clone());
        provenance.extend(self.facts.clone());
        let sums = AlbedoRows::new(self.grid);
        let spread = spread_over(N);
        let seen = |light: usize, row: &[&[f32]]| {
            sums.add(light, first_three(&spread.map(|c| row[c])));
        };
        let note = RowsNote {
            channels: &self.samples.channels,
            scale: self.scale,
            provenance: &provenance,
        };
        step(progress, Step::InterpolatingAndWriting, |share| {
            write_dense_by_rows(self.path, self.grid, &rows, &note, &seen, share)
                .map_err(Error::from)
        })?;
        let mut albedo = sums.finish(self.binned.highest_deg());
        albedo.channel = spread[albedo.channel];
        Ok((text, albedo.named(&self.samples.channels)))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::progress::silent;
    use gonia_brdf::random::Random;
    use gonia_brdf::{Direction, Elementary, Sample};
    use gonia_formats::dense::read_dense_channels;

    /// Channel c of a broad lobe is c + 1 times its value, to a power that falls with c.
    fn truth(light: Direction, view: Direction, channel: usize, of: usize) -> f32 {
        let (i, v) = (light.to_vec3(), view.to_vec3());
        let along = 0.6 + 0.2 * (i[0] + v[0]) + 0.1 * (i[2] * v[2]);
        let scale = (channel + 1) as f64;
        (scale * along.power(1.0 + channel as f64 / of as f64)) as f32
    }

    fn samples(channels: Channels) -> ChannelSamples {
        let (n, mut random) = (channels.count(), Random::new(3));
        let mut samples = ChannelSamples {
            channels,
            ..ChannelSamples::default()
        };
        for frame in 0..6000 {
            let mut direction =
                || Direction::from_deg(random.between(0.0, 80.0), random.between(0.0, 360.0));
            let (light, view) = (direction(), direction());
            samples
                .places
                .push(Sample::new(light, view, []).in_frame(frame / 20));
            let values = (0..n).map(|c| truth(light, view, c, n));
            samples.values.extend(values);
        }
        samples
    }

    /// Blocks, whatever the samples are.
    fn options(with_errors: bool) -> FillOptions {
        FillOptions {
            tolerance: Some(0.7),
            symmetry: Some(SymmetryKind::None),
            with_errors,
            ..FillOptions::with_step_deg(15.0)
        }
    }

    fn bands(n: usize) -> Channels {
        Channels::Bands((0..n).map(|k| 400.0 + k as f64).collect())
    }

    #[test]
    fn channels_of_every_number_have_their_own_values_and_error_bars() {
        for channels in [Channels::Single, bands(2), bands(5), bands(31), bands(40)] {
            let n = channels.count();
            let filled =
                fill_channels(samples(channels), Scale::Absolute, &options(true), &silent).unwrap();
            let (grid, errors) = (filled.dense.grid, filled.errors.unwrap());
            for c in 0..n {
                let (plane, error) = (&filled.dense.planes[c], &errors.standard_error[c]);
                let (mut sum, mut count) = (0.0, 0.0);
                for light in (0..grid.n_directions()).step_by(7) {
                    for view in (0..grid.n_directions()).step_by(5) {
                        let cell = grid.cell(light, view);
                        let truth = truth(grid.direction(light), grid.direction(view), c, n);
                        sum += f64::from(plane[cell] / truth - 1.0).powi(2);
                        count += 1.0;
                        assert!(error[cell] > 0.0 && error[cell] < truth);
                    }
                }
                let rms = (sum / count).sqrt();
                assert!(rms < 0.05, "{n} channels, {c}: {rms}");
            }
        }
    }

    #[test]
    fn rows_are_those_of_a_fill_in_memory() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.exr");
        for channels in [Channels::Single, bands(31)] {
            let (of, scale) = (samples(channels), Scale::Relative);
            let options = options(false);
            let whole = fill_channels(of.clone(), scale, &options, &silent).unwrap();
            let facts = Provenance::new();
            fill_channels_to_file(of, scale, &options, &path, &facts, &silent).unwrap();
            let rows = read_dense_channels(&path).unwrap();
            assert_eq!(rows.channels, whole.dense.channels);
            assert!(rows.planes == whole.dense.planes);
        }
    }

    #[test]
    fn groups_hold_every_channel_and_no_channel_beyond() {
        fn check<const N: usize>(channels: usize) {
            let firsts = groups(channels, N);
            let mut held = vec![false; channels];
            for first in &firsts {
                for channel in group::<N>(*first, channels) {
                    held[channel] = true;
                }
            }
            assert!(held.iter().all(|held| *held), "{channels} {firsts:?}");
            assert_eq!(firsts.len(), channels.div_ceil(N));
        }
        for channels in [1, 2, 3, 4, 8, 9] {
            check::<3>(channels);
        }
        for channels in [10, 30, 31, 32, 62, 63, 200] {
            check::<31>(channels);
        }
    }
}
