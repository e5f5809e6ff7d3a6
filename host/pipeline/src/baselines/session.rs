//! All baselines of a measurement, each compared with it and with the truth where that is known.

use super::{centres, check_grid, coarse, fill_check_cells, measure_on_strips};
use crate::Error;
use crate::compare::{Options, Side, Table, compare};
use crate::fill::{FillOptions, fill};
use crate::fit::{FitResult, cells_of_dense, fit_model};
use crate::progress::{Progress, Step, step};
use crate::provenance::of_this_program;
use gonia_brdf::baselines::BaselineSettings;
use gonia_brdf::fit::{FitSettings, StandardFamily};
use gonia_brdf::{Bins, DenseBrdf, Grid, Sample};
use gonia_formats::baselines_toml::{BaselineRow, BaselineTable};
use gonia_formats::checksum;
use gonia_render::Tabulated;
use gonia_rig::{DenseFile, Figures, Scale};
use std::time::Instant;

/// A measurement, and what its baselines are made with.
pub struct Measurement {
    dense: DenseFile,
    /// Checksum of its values as they were stored.
    checksum: String,
    truth: Option<DenseFile>,
    samples: Vec<Sample>,
    /// Of the baselines, and of both tables here.
    grid: Grid,
    /// Of the measurement as it was stored.
    own_grid: Grid,
}

/// Which baselines to make.
#[derive(Clone, Copy, Debug)]
pub struct BaselineOptions {
    /// Leave out the paper's interpolation, the slowest.
    pub without_paper: bool,
    /// How the models are fitted.
    pub fits: FitSettings,
}

/// A baseline as it is made, for the caller to keep or to write.
pub enum Made {
    /// The measurement itself.
    Measured,
    /// An interpolation: its name, and its table with scale and provenance.
    Filled(String, DenseFile),
    /// A model fitted to the measurement, and the scale of its table.
    Fitted(Box<FitResult>, Scale),
}

/// A coarser grid leaves nothing to interpolate.
const STEP_MAX_DEG: f64 = 20.0;
/// Fewer central samples than this say nothing.
const CENTRES_MIN: usize = 50;

impl Measurement {
    /// A measurement: its dense BRDF, the samples behind it with their frame numbers, and the truth of
    /// the same grid, where it is known. With `step_deg` the baselines are made on a coarser grid, a
    /// multiple of the measurement's.
    ///
    /// # Errors
    /// A step that is no multiple, a truth of another grid, or samples of fewer than 50 frames.
    pub fn new(
        dense: DenseFile,
        truth: Option<DenseFile>,
        samples: Vec<Sample>,
        step_deg: Option<f64>,
    ) -> Result<Self, Error> {
        let own_grid = dense.brdf.grid();
        let grid = match step_deg {
            None => own_grid,
            Some(step) => coarser(own_grid, step)?,
        };
        if let Some(truth) = &truth
            && truth.brdf.grid() != own_grid
        {
            return Err(Error::Option {
                option: "the truth",
                found: format!("has steps of {} degrees", truth.brdf.grid().step_deg()),
                remedy: format!(
                    "the measurement has {}; tabulate it on that grid, or take it away",
                    own_grid.step_deg()
                ),
            });
        }
        let thinned = |file: DenseFile| DenseFile {
            brdf: match grid == own_grid {
                true => file.brdf,
                false => coarse(&file.brdf, grid),
            },
            ..file
        };
        let frames = centres(&samples).len();
        if frames < CENTRES_MIN {
            return Err(Error::TooFewCentres { frames });
        }
        Ok(Self {
            checksum: checksum::of_brdf(&dense.brdf),
            dense: thinned(dense),
            truth: truth.map(thinned),
            samples,
            grid,
            own_grid,
        })
    }

    /// The dense BRDF, on the grid of the baselines.
    pub fn dense(&self) -> &DenseBrdf {
        &self.dense.brdf
    }

    /// Makes all baselines: the frames' central samples alone, the paper's interpolation (on a share of
    /// the cells), a measurement on strips around a cylinder, Kurt's model of two lobes and the
    /// microcylinder model. Each is given to `take` as it is made.
    ///
    /// # Errors
    /// What `take` gives, or a baseline that cannot be made.
    pub fn baselines<E: From<Error>>(
        mut self,
        options: &BaselineOptions,
        take: &mut dyn FnMut(&BaselineRow, Made) -> Result<(), E>,
        progress: &Progress<'_>,
    ) -> Result<BaselineTable, E> {
        let mut comparison = BaselineTable {
            dense: Some(self.checksum.clone()),
            ..BaselineTable::default()
        };
        let mut keep = |row: BaselineRow, made: Made| {
            take(&row, made)?;
            comparison.rows.push(row);
            Ok::<(), E>(())
        };
        let samples = std::mem::take(&mut self.samples);
        keep(self.itself(samples.len())?, Made::Measured)?;
        if !options.without_paper {
            let (row, table) = self.paper(&samples, "paper", progress)?;
            keep(row, self.made("paper", table, "the paper's method"))?;
        }
        let central = centres(&samples);
        drop(samples);

        if !options.without_paper {
            let (row, table) = self.paper(&central, "sparse-paper", progress)?;
            let what = "the paper's method on central samples only";
            keep(row, self.made("sparse-paper", table, what))?;
        }
        let what = "one sample a frame, gonia's interpolation";
        let (row, sparse) = self.filled(central, "sparse", what, progress)?;
        keep(row, self.made("sparse", sparse, "central samples only"))?;

        // Strips see the material itself: the truth, or the best that is known of it.
        let material = self.truth.as_ref().unwrap_or(&self.dense);
        let strips = measure_on_strips(&Tabulated::new(&material.brdf), 1);
        let what = "simulated: 20 strips on a cylinder, with its noise";
        let (row, strips) = self.filled(strips, "strips", what, progress)?;
        let what = "simulated strips on a cylinder";
        keep(row, self.made("strips", strips, what))?;

        for family in [
            StandardFamily::Kurt { lobes: 2 },
            StandardFamily::Sadeghi { scaled: false },
        ] {
            let (row, result) = self.fitted(family, &options.fits, progress)?;
            keep(row, Made::Fitted(Box::new(result), self.dense.scale))?;
        }
        Ok(comparison)
    }

    fn itself(&self, samples: usize) -> Result<BaselineRow, Error> {
        Ok(BaselineRow {
            name: "dense".into(),
            what: "all samples, gonia's interpolation".into(),
            numbers: samples as u64,
            seconds: 0.0,
            against_dense: None,
            against_truth: self.against_truth(&self.dense.brdf, "dense")?,
            is_partial: false,
        })
    }

    /// The paper's interpolation of some samples, at the check cells.
    fn paper(
        &self,
        samples: &[Sample],
        name: &str,
        progress: &Progress<'_>,
    ) -> Result<(BaselineRow, DenseBrdf), Error> {
        let grid = check_grid(self.grid).ok_or_else(|| Error::Option {
            option: "steps of",
            found: format!("{} degrees", self.grid.step_deg()),
            remedy: "have no coarser grid to check the paper's method on; use --without-paper"
                .into(),
        })?;
        let start = Instant::now();
        let table = step(progress, Step::PaperMethod, |_| {
            let bins = Bins::new(self.own_grid, samples);
            fill_check_cells(&bins, &BaselineSettings::PAPER, grid).map_err(Error::from)
        })?;
        // As if all cells took as long.
        let share = distinct(self.own_grid) / distinct(grid);
        let seconds = start.elapsed().as_secs_f64() * share;
        let other = coarse(&self.dense.brdf, grid);
        let truth = self.truth.as_ref().map(|truth| coarse(&truth.brdf, grid));
        let against_truth = match truth {
            Some(truth) => Some(figures(
                (&table, name, self.dense.scale),
                (&truth, "truth", Scale::Absolute),
            )?),
            None => None,
        };
        let against_dense = figures(
            (&table, name, Scale::Absolute),
            (&other, "dense", Scale::Absolute),
        )?;
        let row = BaselineRow {
            name: name.to_owned(),
            what: format!(
                "the paper's method, at steps of {}°; time for all cells extrapolated",
                grid.step_deg()
            ),
            numbers: samples.len() as u64,
            seconds,
            against_dense: Some(against_dense),
            against_truth,
            is_partial: true,
        };
        Ok((row, table))
    }

    /// Samples interpolated by gonia's own method.
    fn filled(
        &self,
        samples: Vec<Sample>,
        name: &str,
        what: &str,
        progress: &Progress<'_>,
    ) -> Result<(BaselineRow, DenseBrdf), Error> {
        let numbers = samples.len() as u64;
        let options = FillOptions::with_step_deg(self.grid.step_deg());
        let start = Instant::now();
        let filled = fill(samples, Scale::Relative, &options, progress)?;
        let brdf = filled.into_rgb()?.brdf;
        let seconds = start.elapsed().as_secs_f64();
        let row = BaselineRow {
            name: name.to_owned(),
            what: what.to_owned(),
            numbers,
            seconds,
            against_dense: Some(figures(
                (&brdf, name, Scale::Relative),
                (&self.dense.brdf, "dense", Scale::Absolute),
            )?),
            against_truth: self.against_truth(&brdf, name)?,
            is_partial: false,
        };
        Ok((row, brdf))
    }

    /// A model fitted to the measurement.
    fn fitted(
        &self,
        family: StandardFamily,
        settings: &FitSettings,
        progress: &Progress<'_>,
    ) -> Result<(BaselineRow, FitResult), Error> {
        let cells = cells_of_dense(&self.dense.brdf, settings);
        let family = family.for_values(self.dense.scale == Scale::Relative);
        let mut result = fit_model(&self.dense, "dense.exr", &cells, family, settings, progress)?;
        // A fit to a coarser grid is one to the stored BRDF all the same.
        result.note.dense = Some(self.checksum.clone());
        let note = &result.note;
        let row = BaselineRow {
            name: note.model.clone(),
            what: if note.converged {
                "fitted to the dense measurement".into()
            } else {
                "fitted, not converged: the best so far".into()
            },
            numbers: note.parameters.len() as u64,
            seconds: note.seconds,
            against_dense: Some(note.figures.clone()),
            against_truth: self.against_truth(&result.dense, &note.model)?,
            is_partial: false,
        };
        Ok((row, result))
    }

    fn against_truth(&self, brdf: &DenseBrdf, name: &str) -> Result<Option<Figures>, Error> {
        let Some(truth) = &self.truth else {
            return Ok(None);
        };
        let measured = (brdf, name, self.dense.scale);
        Ok(Some(figures(
            measured,
            (&truth.brdf, "truth", truth.scale),
        )?))
    }

    fn made(&self, name: &str, brdf: DenseBrdf, what: &str) -> Made {
        let mut provenance = of_this_program();
        provenance.insert("rival".into(), what.to_owned());
        let file = DenseFile {
            brdf,
            scale: self.dense.scale,
            provenance,
        };
        Made::Filled(name.to_owned(), file)
    }
}

/// The grid that baselines are made on, where a step is asked for.
fn coarser(own: Grid, step: f64) -> Result<Grid, Error> {
    let refuse = |remedy: String| Error::Option {
        option: "--step",
        found: step.to_string(),
        remedy,
    };
    let grid = Grid::with_step_deg(step).map_err(|error| refuse(error.to_string()))?;
    if step > STEP_MAX_DEG {
        return Err(refuse(format!("at most {STEP_MAX_DEG} degrees")));
    }
    if (step / own.step_deg()).fract() != 0.0 {
        return Err(refuse(format!(
            "must be a multiple of the measurement's {} degrees",
            own.step_deg()
        )));
    }
    Ok(grid)
}

/// Cells of a grid, a pole counted once.
fn distinct(grid: Grid) -> f64 {
    let directions = grid.n_directions() - grid.n_phi() + 1;
    (directions * directions) as f64
}

type Named<'a> = (&'a DenseBrdf, &'a str, Scale);

fn figures(a: Named<'_>, b: Named<'_>) -> Result<Figures, Error> {
    let options = Options {
        name_a: a.1,
        name_b: b.1,
        ..Options::default()
    };
    let first = Table {
        brdf: a.0,
        scale: a.2,
    };
    let second = Side::Table(Table {
        brdf: b.0,
        scale: b.2,
    });
    Ok(compare(first, second, &options)?)
}
