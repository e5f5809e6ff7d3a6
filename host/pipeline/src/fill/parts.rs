//! A fill that several processes share, on one machine or many, through a folder that all of them see.
//!
//! One begins it ([`FillInParts::begin`]); then any of them, in any order and each part once or more, solve patches
//! ([`FillInParts::solve`]) until all are solved, and write bands ([`FillInParts::write`]) until all are written; one
//! ends it ([`FillInParts::finish`]). A part that is there already is not made again, so that what a process
//! left behind goes on where it was. The values are those of [`fill`](super::fill), bit for bit.

use super::blocks::{chosen, sorted};
use super::groups::groups_from_middle;
use super::options::FillOptions;
use super::planes::bins_of;
use super::prepared::Prepared;
use crate::Error;
use crate::progress::{Progress, Step, step};
use crate::provenance::Provenance;
use gonia_brdf::interpolate::fill::MIN_BINS;
use gonia_brdf::interpolate::{
    AnyKernel, AtCorners, Band, FillError, FillSettings, KeptCells, NewBlock, Rows, Solver,
};
use gonia_brdf::{Bins, Grid};
use gonia_formats::export::{ZarrRings, check_new_folder};
use gonia_formats::fill_parts::{
    FillPlan, PartsFolder, SolvedPatch, read_bins, read_solved, write_bins, write_solved,
};
use gonia_formats::{FileError, check_writable, checksum};
use gonia_rig::{Remark, SampleValues, Scale};
use std::ops::Range;
use std::path::Path;

/// A fill in a folder. Cheap to open: what a part needs is read when it is made.
#[derive(Clone, Debug)]
pub struct FillInParts {
    folder: PartsFolder,
    plan: FillPlan,
    bands: Vec<Band>,
}

/// How a fill in parts begins.
#[derive(Clone, Debug)]
pub enum Begun {
    /// Its parts are to be made.
    Parts {
        /// The fill.
        fill: Box<FillInParts>,
        /// What is to be said of the samples.
        remarks: Vec<Remark>,
    },
    /// A fit of few samples takes the place of blocks, which is no work to share: [`fill`](super::fill) makes it.
    OneFit,
}

impl FillInParts {
    /// Begins a fill in a new folder: bins the samples, and chooses the settings. The table will be as `scale` and
    /// `facts` say, and have no uncertainties. One of the same samples and options that was begun there goes on.
    ///
    /// # Errors
    /// As [`fill`](super::fill); the folder is something else's or cannot be made; uncertainties or a baseline are
    /// wanted.
    pub fn begin(
        samples: impl Into<SampleValues>,
        scale: Scale,
        options: &FillOptions,
        folder: &Path,
        facts: &Provenance,
        progress: &Progress<'_>,
    ) -> Result<Begun, Error> {
        let mut samples = samples.into();
        let channels = samples.channels().clone();
        options.check_rows(&channels)?;
        let (grid, base) = options.check()?;
        let facts_of = checksum::of_bytes(format!("{facts:?}").as_bytes());
        let samples_of = checksum::of_samples(&samples);
        let of = format!("{scale} samples {samples_of}, facts {facts_of}, {options:?}");
        if PartsFolder::new(folder).plan().is_file() {
            return Self::gone_on(folder, &of);
        }
        if folder.symlink_metadata().is_ok() {
            let problem = "is there already, and holds no fill that could go on";
            let remedy = "remove it, or give another folder";
            return Err(FileError::new(folder, problem, remedy).into());
        }
        let prepared = Prepared::new(&mut samples, grid, options, false, progress)?;
        if prepared.fit.is_some() {
            return Ok(Begun::OneFit);
        }
        let bins = prepared.bins.bins().len();
        if bins < MIN_BINS {
            return Err(FillError::TooFewBins(bins).into());
        }
        check_writable(folder)?;
        let begin = Begin {
            samples: &samples,
            prepared: &prepared,
            folder: PartsFolder::new(folder),
            base,
            grid,
        };
        let fill = begin.plan(of, scale, options, facts, progress);
        if fill.is_err() {
            // Why it cannot be removed matters less than why it was not begun.
            let _ = std::fs::remove_dir_all(folder);
        }
        Ok(Begun::Parts {
            fill: Box::new(fill?),
            remarks: prepared.remarks,
        })
    }

    fn gone_on(folder: &Path, of: &str) -> Result<Begun, Error> {
        let fill = Box::new(Self::open(folder)?);
        if fill.plan.of != of {
            let problem = "holds another fill that was not ended";
            let remedy = "remove it, or give another folder";
            return Err(FileError::new(folder, problem, remedy).into());
        }
        let remarks = Vec::new();
        Ok(Begun::Parts { fill, remarks })
    }

    /// One that was begun, in this process or another.
    ///
    /// # Errors
    /// The folder is none of such a fill, or one of another version of gonia.
    pub fn open(folder: &Path) -> Result<Self, Error> {
        let folder = PartsFolder::new(folder);
        let plan = FillPlan::read(&folder.plan())?;
        Ok(Self::of(folder, plan))
    }

    fn of(folder: PartsFolder, plan: FillPlan) -> Self {
        let bands = Rows::new(plan.grid, &plan.settings).bands();
        Self {
            folder,
            plan,
            bands,
        }
    }

    /// How many groups of channels there are: the parts below are each group's.
    pub fn groups(&self) -> usize {
        self.plan.groups.len()
    }

    /// How many patches there are to solve in each group. The first ones are the most work: each is solved with all
    /// later ones.
    pub fn patches(&self) -> usize {
        self.bands.last().map_or(0, |band| band.patches.end)
    }

    /// How many bands there are to write in each group.
    pub fn bands(&self) -> usize {
        self.bands.len()
    }

    /// Solves some patches of a group that are not solved yet.
    ///
    /// # Errors
    /// There are no such parts, the folder cannot be read or written, or cancelled.
    pub fn solve(
        &self,
        group: usize,
        patches: Range<usize>,
        progress: &Progress<'_>,
    ) -> Result<(), Error> {
        if patches.end > self.patches() {
            let remedy = format!("there are {}", self.patches());
            return Err(no_such_part("patch", patches.end - 1, remedy));
        }
        match self.width(group)? {
            1 => self.solve_group::<1>(group, patches, progress),
            31 => self.solve_group::<31>(group, patches, progress),
            _ => self.solve_group::<3>(group, patches, progress),
        }
    }

    /// Writes a band of a group, of which all patches are solved.
    ///
    /// # Errors
    /// There is no such part, a patch is not solved, the folder cannot be read or written, or cancelled.
    pub fn write(&self, group: usize, band: usize, progress: &Progress<'_>) -> Result<(), Error> {
        let Some(of_band) = self.bands.get(band) else {
            return Err(no_such_part(
                "band",
                band,
                format!("there are {}", self.bands.len()),
            ));
        };
        match self.width(group)? {
            1 => self.write_group::<1>(group, of_band, progress),
            31 => self.write_group::<31>(group, of_band, progress),
            _ => self.write_group::<3>(group, of_band, progress),
        }
    }

    /// Gives the table its final name, and removes the folder.
    ///
    /// # Errors
    /// A part is not written, something has the name, or it is on another disk than the folder.
    pub fn finish(&self, output: &Path) -> Result<(), Error> {
        check_new_folder(output)?;
        let table = self.folder.table();
        if let Some(missing) = ZarrRings::missing(&table, self.plan.grid, &self.plan.channels) {
            let problem = "is not written yet";
            return Err(FileError::new(&missing, problem, "make all parts first").into());
        }
        std::fs::rename(&table, output).map_err(|error| FileError::writing(output, &error))?;
        let folder = self.folder.path();
        let removed = std::fs::remove_dir_all(folder);
        Ok(removed.map_err(|error| FileError::writing(folder, &error))?)
    }

    fn width(&self, group: usize) -> Result<usize, Error> {
        let groups = &self.plan.groups;
        let group_of = groups.get(group);
        group_of
            .map(Vec::len)
            .ok_or_else(|| no_such_part("group", group, format!("there are {}", groups.len())))
    }

    fn solve_group<const N: usize>(
        &self,
        group: usize,
        patches: Range<usize>,
        progress: &Progress<'_>,
    ) -> Result<(), Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let is_there = |patch: &usize| self.folder.solved_patch(group, *patch).is_file();
        let missing: Vec<usize> = patches.filter(|patch| !is_there(patch)).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let bins: Bins<N> = read_bins(&self.folder.bins(group), self.plan.grid)?;
        let data = sorted(&bins, self.plan.settings, progress)?;
        let solver = Solver::new(&data, &self.plan.settings)?;
        let kept = InFolder::<N> {
            folder: &self.folder,
            group,
            patches: Vec::new(),
        };
        step(progress, Step::FittingBlocks, |share| {
            solver.solve(missing, &kept, share)
        })?;
        Ok(())
    }

    fn write_group<const N: usize>(
        &self,
        group: usize,
        band: &Band,
        progress: &Progress<'_>,
    ) -> Result<(), Error> {
        let (grid, fresh) = (self.plan.grid, self.fresh(group));
        let channels: Vec<usize> = fresh.iter().map(|(_, channel)| *channel).collect();
        let writer = ZarrRings::of(&self.folder.table(), grid, band.rings.clone(), &channels)?;
        let rows = Rows::new(grid, &self.plan.settings);
        let mut kept = InFolder {
            folder: &self.folder,
            group,
            patches: Vec::with_capacity(rows.patches()),
        };
        let mut of_patches = Vec::with_capacity(rows.patches());
        for patch in 0..rows.patches() {
            let path = self.folder.solved_patch(group, patch);
            let (at_corners, cells) = read_solved(&path)?;
            if !rows.is_of_patch(patch, &at_corners) {
                let problem = "is of another fill";
                return Err(FileError::new(&path, problem, "fill again, in another folder").into());
            }
            kept.patches.push(cells);
            of_patches.push(at_corners);
        }
        let corners = rows.corners(of_patches);
        step(progress, Step::InterpolatingAndWriting, |share| {
            let take = |light, row: [&[f32]; N]| {
                let mut places = fresh.iter().enumerate();
                places.try_for_each(|(k, (place, _))| Ok(writer.put(k, light, row[*place])?))
            };
            rows.each_row(band.patches.clone(), &corners, &kept, share, &take)
        })?;
        Ok(writer.finish()?)
    }

    /// Of a group its channels that no earlier group has: their places in it, and their numbers.
    fn fresh(&self, group: usize) -> Vec<(usize, usize)> {
        let (earlier, rest) = self.plan.groups.split_at(group);
        let mut seen: Vec<usize> = earlier.concat();
        let mut fresh = Vec::new();
        for (place, channel) in rest.first().into_iter().flatten().enumerate() {
            if !seen.contains(channel) {
                seen.push(*channel);
                fresh.push((place, *channel));
            }
        }
        fresh
    }
}

fn no_such_part(what: &'static str, number: usize, remedy: String) -> Error {
    Error::Option {
        option: what,
        found: number.to_string(),
        remedy,
    }
}

/// What a fill in parts begins from.
struct Begin<'a> {
    samples: &'a SampleValues,
    prepared: &'a Prepared,
    folder: PartsFolder,
    base: FillSettings,
    grid: Grid,
}

type Groups = (Vec<Vec<usize>>, FillSettings);

impl Begin<'_> {
    /// Puts down what all start from.
    fn plan(
        &self,
        of: String,
        scale: Scale,
        options: &FillOptions,
        facts: &Provenance,
        progress: &Progress<'_>,
    ) -> Result<FillInParts, Error> {
        let channels = self.samples.channels().clone();
        let (bins, n) = (&self.prepared.bins, channels.count());
        let (groups, settings) = match n {
            1 => self.by_one([0], &bins.channel(0), progress),
            3 => self.by_one([0, 1, 2], bins, progress),
            10.. => self.by_groups::<31>(groups_from_middle(n), progress),
            _ => self.by_groups::<3>(groups_from_middle(n), progress),
        }?;
        let mut provenance = self.prepared.provenance(&settings.to_string(), options);
        provenance.extend(facts.clone());
        let (folder, grid) = (&self.folder, self.grid);
        ZarrRings::begin(&folder.table(), grid, &channels, scale, &provenance)?;
        for group in 0..groups.len() {
            check_writable(&folder.solved(group))?;
        }
        let plan = FillPlan {
            of,
            grid,
            channels,
            scale,
            provenance,
            groups,
            settings,
        };
        // Last: where it is, everything is.
        plan.write(&folder.plan())?;
        Ok(FillInParts::of(folder.clone(), plan))
    }

    /// One group, whose bins are made.
    fn by_one<const N: usize>(
        &self,
        group: [usize; N],
        bins: &Bins<N>,
        progress: &Progress<'_>,
    ) -> Result<Groups, Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        write_bins(&self.folder.bins(0), bins)?;
        let settings = chosen(&sorted(bins, self.base, progress)?, self.base, progress)?;
        Ok((vec![group.to_vec()], settings))
    }

    /// Groups of channels; the first one chooses the settings for all.
    fn by_groups<const N: usize>(
        &self,
        groups: Vec<[usize; N]>,
        progress: &Progress<'_>,
    ) -> Result<Groups, Error>
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let mut settings = self.base;
        for (k, channels) in groups.iter().enumerate() {
            let symmetry = self.prepared.completed_by;
            let bins = bins_of(self.samples, *channels, symmetry, self.grid, progress)?;
            write_bins(&self.folder.bins(k), &bins)?;
            if k == 0 {
                settings = chosen(&sorted(&bins, self.base, progress)?, self.base, progress)?;
            }
        }
        let groups = groups.iter().map(|group| group.to_vec()).collect();
        Ok((groups, settings))
    }
}

/// Cells between their solving and their writing, in the folder that all processes see.
struct InFolder<'a, const N: usize> {
    folder: &'a PartsFolder,
    group: usize,
    patches: Vec<SolvedPatch<N>>,
}

impl<const N: usize> KeptCells<N> for InFolder<'_, N> {
    type Error = Error;

    fn put(
        &self,
        patch: usize,
        at_corners: &AtCorners<N>,
        cells: &[[f32; N]],
    ) -> Result<(), Error> {
        let path = self.folder.solved_patch(self.group, patch);
        Ok(write_solved(&path, at_corners, cells)?)
    }

    fn get(
        &self,
        patch: usize,
        cells: Range<usize>,
        into: &mut Vec<[f32; N]>,
    ) -> Result<(), Error> {
        Ok(self.patches[patch].cells(cells, into)?)
    }
}
