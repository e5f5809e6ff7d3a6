//! A fill that does not fit memory: written row by row, or a few channels at a time. What its blocks give is kept on the
//! disk of the file, at most half as much as will be in that, until all are solved.

use super::FillAccount;
use super::blocks::{chosen, sorted};
use super::groups::{groups, groups_from_middle, spread_over, stand_for_themselves};
use super::options::{CELLS_IN_MEMORY, FillOptions};
use super::planes::bins_of;
use super::prepared::Prepared;
use super::symmetry::fit_of_others;
use crate::Error;
use crate::progress::{Progress, Step, step};
use crate::provenance::Provenance;
use crate::warnings::{self, AlbedoRows, DirectionalAlbedo};
use gonia_brdf::interpolate::{
    AnyKernel, AtCorners, Data, FillSettings, KeptCells, NewBlock, Rows, Solver,
};
use gonia_brdf::scattered::ScatteredFit;
use gonia_brdf::{Bins, Grid};
use gonia_formats::Scratch;
use gonia_formats::dense::{RowsNote, TakeRow, write_dense_by_rows};
use gonia_rig::{Channels, SampleValues, Scale};
use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::OnceLock;

/// Fills a grid that does not fit memory, and writes it row by row, or three channels at a time. `facts` are added
/// to the file's provenance. The values are those of [`fill`](super::fill) on a grid that fits.
///
/// # Errors
/// As [`fill`](super::fill), and when the file cannot be written; no standard errors can be.
pub fn fill_to_file(
    samples: impl Into<SampleValues>,
    scale: Scale,
    options: &FillOptions,
    path: &Path,
    facts: &Provenance,
    progress: &Progress<'_>,
) -> Result<FillAccount, Error> {
    let mut samples = samples.into();
    let channels = samples.channels().clone();
    options.check_rows(&channels)?;
    let (grid, base) = options.check()?;
    let prepared = Prepared::new(&mut samples, grid, options, false, progress)?;
    let n = channels.count();
    if stand_for_themselves(n) {
        samples = Vec::new().into();
    }
    let rows = ToRows {
        samples: &samples,
        channels: &channels,
        scale,
        grid,
        options,
        base,
        path,
        facts,
        prepared: &prepared,
    };
    let (settings, albedo) = match (&prepared.fit, n) {
        (Some(fit), _) => rows.write_fit(fit, progress),
        (None, 1) => rows.write_blocks(&prepared.bins.channel(0), &[[0]], progress),
        (None, 3) => rows.write_blocks(&prepared.bins, &[[0, 1, 2]], progress),
        (None, 10..) => rows.write_groups::<31>(progress),
        (None, _) => rows.write_groups::<3>(progress),
    }?;
    let counts = prepared.counts();
    let mut remarks = prepared.remarks;
    remarks.extend(warnings::remark_on_energy(&albedo, scale));
    Ok(FillAccount {
        counts,
        settings,
        symmetry: prepared.symmetry,
        origins: prepared.origins,
        albedo,
        remarks,
    })
}

/// A fill that is written row by row.
struct ToRows<'a> {
    samples: &'a SampleValues,
    channels: &'a Channels,
    scale: Scale,
    grid: Grid,
    options: &'a FillOptions,
    base: FillSettings,
    path: &'a Path,
    facts: &'a Provenance,
    prepared: &'a Prepared,
}

/// Which of a group's channels have no values yet: their places in the group, and their numbers.
struct Fresh {
    places: Vec<usize>,
    channels: Vec<usize>,
}

impl Fresh {
    fn of(group: &[usize], written: &mut [bool]) -> Self {
        let (mut places, mut channels) = (Vec::new(), Vec::new());
        for (place, channel) in group.iter().enumerate() {
            if !std::mem::replace(&mut written[*channel], true) {
                places.push(place);
                channels.push(*channel);
            }
        }
        Self { places, channels }
    }
}

/// Why rows are not all written.
enum Stopped {
    /// The file does not take them.
    Writing(io::Error),
    /// They cannot be made.
    Making(Error),
}

impl<E: Into<Error>> From<E> for Stopped {
    fn from(error: E) -> Self {
        Stopped::Making(error.into())
    }
}

/// Takes of a row of light the values of a group's channels.
type TakeGroup<'a> = dyn Fn(usize, &Fresh, &[&[f32]]) -> Result<(), Stopped> + Sync + 'a;
/// Takes how much is done, and says whether to go on.
type Share<'a> = gonia_brdf::progress::Progress<'a>;

impl ToRows<'_> {
    /// Writes the file whole from what `make` gives; returns the settings, and the albedo of all channels.
    fn write(
        &self,
        settings: String,
        mut make: impl FnMut(&TakeGroup<'_>) -> Result<(), Stopped>,
    ) -> Result<(String, DirectionalAlbedo), Error> {
        let mut provenance = self.prepared.provenance(&settings, self.options);
        provenance.extend(self.facts.clone());
        let note = RowsNote {
            channels: self.channels,
            scale: self.scale,
            provenance: &provenance,
        };
        let sums = AlbedoRows::new(self.grid, self.channels);
        // What is not the file's fault comes out as what it was.
        let mut failed = None;
        let written = write_dense_by_rows(self.path, self.grid, &note, &mut |take: &TakeRow<
            '_,
        >| {
            let taken = make(&|light, fresh: &Fresh, group: &[&[f32]]| {
                let rows: Vec<&[f32]> = fresh.places.iter().map(|place| group[*place]).collect();
                sums.add(light, &fresh.channels, &rows);
                take(light, &fresh.channels, &rows).map_err(Stopped::Writing)
            });
            taken.map_err(|stopped| match stopped {
                Stopped::Writing(error) => error,
                Stopped::Making(error) => {
                    failed = Some(error);
                    io::Error::other("not made")
                }
            })
        });
        if let Some(error) = failed {
            return Err(error);
        }
        written?;
        Ok((settings, sums.finish(self.prepared.highest_deg())))
    }

    /// Of as many channels as share a factorisation, some rings of lights at a time are in memory.
    fn write_fit(
        &self,
        fit: &ScatteredFit,
        progress: &Progress<'_>,
    ) -> Result<(String, DirectionalAlbedo), Error> {
        let n = self.channels.count();
        self.write(fit.choice().settings.to_string(), |take| {
            step(progress, Step::InterpolatingAndWriting, |share| {
                let mut written = vec![false; n];
                match n {
                    _ if stand_for_themselves(n) => {
                        self.write_rings(spread_over(n), fit, &mut written, (take, share))
                    }
                    10.. => self.write_fits::<31>(fit, &mut written, (take, share)),
                    _ => self.write_fits::<3>(fit, &mut written, (take, share)),
                }
            })
        })
    }

    fn write_fits<const N: usize>(
        &self,
        fit: &ScatteredFit,
        written: &mut [bool],
        (take, share): (&TakeGroup<'_>, &Share<'_>),
    ) -> Result<(), Stopped> {
        for channels in groups::<N>(written.len()) {
            let samples = self.samples.of_channels(channels);
            let fit = fit_of_others(fit, &samples, self.grid);
            self.write_rings(channels, &fit, written, (take, share))?;
        }
        Ok(())
    }

    fn write_rings<const N: usize>(
        &self,
        channels: [usize; N],
        fit: &ScatteredFit<N>,
        written: &mut [bool],
        (take, share): (&TakeGroup<'_>, &Share<'_>),
    ) -> Result<(), Stopped> {
        let (grid, side) = (self.grid, self.grid.n_directions());
        let before = written.iter().filter(|written| **written).count() as f64;
        let fresh = Fresh::of(&channels, written);
        let at_a_time = 3 * CELLS_IN_MEMORY / (grid.n_phi() * side * N);
        fit.by_rings(grid, at_a_time, |rings, planes| {
            let done = rings.start as f64 / grid.n_theta() as f64;
            let done = before + done * fresh.channels.len() as f64;
            if share(done / written.len() as f64).is_break() {
                return Err(Error::Cancelled.into());
            }
            let first = rings.start * grid.n_phi();
            for light in first..rings.end * grid.n_phi() {
                let cells = (light - first) * side..(light - first + 1) * side;
                // One plane stands for all channels where these are alike.
                let row = |c: usize| &planes[c.min(planes.len() - 1)][cells.clone()];
                let group: [&[f32]; N] = std::array::from_fn(row);
                take(light, &fresh, &group)?;
            }
            Ok(())
        })
    }

    /// As many channels at a time as share a factorisation.
    fn write_groups<const N: usize>(
        &self,
        progress: &Progress<'_>,
    ) -> Result<(String, DirectionalAlbedo), Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let groups = groups_from_middle::<N>(self.channels.count());
        let first = self.bins_of(groups.first().copied().unwrap_or([0; N]), progress)?;
        self.write_blocks(&first, &groups, progress)
    }

    /// The bins are those of the first group.
    fn write_blocks<const N: usize>(
        &self,
        first: &Bins<N>,
        groups: &[[usize; N]],
        progress: &Progress<'_>,
    ) -> Result<(String, DirectionalAlbedo), Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let first = sorted(first, self.base, progress)?;
        let settings = chosen(&first, self.base, progress)?;
        let mut written = vec![false; self.channels.count()];
        self.write(settings.to_string(), |take| {
            for (k, channels) in groups.iter().enumerate() {
                let fresh = Fresh::of(channels, &mut written);
                if k == 0 {
                    write_group(&first, &settings, &fresh, self.path, take, progress)?;
                } else {
                    let bins = self.bins_of(*channels, progress)?;
                    let known = sorted(&bins, settings, progress)?;
                    write_group(&known, &settings, &fresh, self.path, take, progress)?;
                }
            }
            Ok(())
        })
    }

    fn bins_of<const N: usize>(
        &self,
        channels: [usize; N],
        progress: &Progress<'_>,
    ) -> Result<Bins<N>, Error> {
        let symmetry = self.prepared.completed_by;
        bins_of(self.samples, channels, symmetry, self.grid, progress)
    }
}

fn write_group<const N: usize>(
    known: &Data<'_, N>,
    settings: &FillSettings,
    fresh: &Fresh,
    path: &Path,
    take: &TakeGroup<'_>,
    progress: &Progress<'_>,
) -> Result<(), Stopped>
where
    dyn AnyKernel: NewBlock<N>,
{
    let solver = Solver::new(known, settings).map_err(Error::from)?;
    let rows = Rows::new(known.bins().grid(), settings);
    let all = 0..rows.patches();
    let kept = OnDisk::beside(path, rows.patches())?;
    let of_patches = step(progress, Step::FittingBlocks, |share| {
        solver.solve(all.clone().collect(), &kept, share)
    })?;
    let corners = rows.corners(of_patches);
    step(progress, Step::InterpolatingAndWriting, |share| {
        let taken = |light, row: [&[f32]; N]| take(light, fresh, &row);
        rows.each_row(all, &corners, &kept, share, &taken)
    })
}

/// Cells between their solving and their writing, beside the file that they are for.
struct OnDisk {
    scratch: Scratch,
    /// By patch, where its cells begin: in numbers, once they are there.
    starts: Vec<OnceLock<u64>>,
}

impl OnDisk {
    fn beside(path: &Path, patches: usize) -> Result<Self, Error> {
        Ok(Self {
            scratch: Scratch::beside(path)?,
            starts: (0..patches).map(|_| OnceLock::new()).collect(),
        })
    }
}

impl<const N: usize> KeptCells<N> for OnDisk {
    type Error = Stopped;

    fn put(&self, patch: usize, _: &AtCorners<N>, cells: &[[f32; N]]) -> Result<(), Stopped> {
        let at = self.scratch.put(cells.as_flattened())?;
        self.starts[patch].get_or_init(|| at);
        Ok(())
    }

    fn get(
        &self,
        patch: usize,
        cells: Range<usize>,
        into: &mut Vec<[f32; N]>,
    ) -> Result<(), Stopped> {
        // All patches are put before the first cell is wanted.
        let start = self.starts[patch].get().copied().unwrap_or(0);
        let mut floats = Vec::with_capacity(N * cells.len());
        let at = start + (N * cells.start) as u64;
        self.scratch.get(at, N * cells.len(), &mut floats)?;
        into.extend_from_slice(floats.as_chunks::<N>().0);
        Ok(())
    }
}
