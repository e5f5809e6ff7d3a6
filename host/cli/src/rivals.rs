//! `gonia rivals`: other ways to the same BRDF, from the same session.

use crate::fill::{How, PresetArgument, fill};
use crate::fit::{fit_model, write_fit};
use crate::progress::Progress;
use crate::provenance::of_this_program;
use anyhow::{Context, Result, bail};
use gonia_brdf::cellwise::CellSettings;
use gonia_brdf::fit::{Family, Settings as FitSettings, draw};
use gonia_brdf::{Bins, DenseBrdf, Grid, Sample};
use gonia_formats::baselines_toml::{BaselineRow, BaselineTable as Comparison};
use gonia_formats::dense::{read_dense, write_dense};
use gonia_formats::samples::read_samples;
use gonia_formats::write_whole_bytes;
use gonia_pipeline as evaluate;
use gonia_pipeline::compare::Table;
use gonia_pipeline::rivals::{centres, check_grid, coarse, fill_check_cells, measure_on_strips};
use gonia_pipeline::{Options, Side};
use gonia_render::Tabulated;
use gonia_report::baselines::{BaselinePictures, draw_baseline, figure};
use gonia_report::files::{DENSE, RIVALS, RIVALS_FIGURE, TRUTH};
use gonia_rig::{DenseFile, Figures, Scale, Stratum};
use std::path::PathBuf;
use std::time::Instant;

/// Makes the BRDF of a session by other ways and says how far each is from the dense measurement,
/// and from the truth where DIR holds truth.exr: the frames' central samples alone, the paper's
/// interpolation (on a share of the cells: all would take core-hours), a measurement on strips
/// around a cylinder, Kurt's model of two lobes and the microcylinder model.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia rivals gonia-demo && gonia report gonia-demo\n\nReads DIR/dense.exr and DIR/samples.npy (with frame numbers); writes DIR/rivals.toml, the figure\nDIR/rivals.svg, and each BRDF as DIR/NAME.exr (those of the\npaper's method on a grid of 10 to 20 degrees).\n\n--step 4 makes and judges them on a grid of 4 degrees, which is a sixteenth of the disk. gonia's own\ninterpolation then has bins of 4 degrees; the paper's method has those of the session's grid."
)]
pub struct Rivals {
    /// The folder of a measurement
    folder: PathBuf,
    /// Step of the rivals' grid in degrees, a multiple of the session's
    #[arg(long, value_name = "DEG")]
    step: Option<f64>,
    /// Leave out the paper's interpolation, the slowest
    #[arg(long)]
    without_paper: bool,
    /// Cells that the models are fitted to
    #[arg(long, value_name = "N", default_value_t = FitSettings::default().cells)]
    cells: usize,
    /// Random starts of the fits
    #[arg(long, value_name = "N", default_value_t = FitSettings::default().starts)]
    starts: usize,
}

/// A coarser grid leaves nothing to interpolate.
const STEP_MAX_DEG: f64 = 20.0;

/// The session, and what the rivals are judged by.
struct Session {
    dense: DenseFile,
    truth: Option<DenseFile>,
    /// Of the rivals, and of both here.
    grid: Grid,
    /// Of the session as it was stored.
    own_grid: Grid,
}

impl Rivals {
    /// Those of a folder, all with their defaults.
    pub fn of(folder: PathBuf) -> Self {
        let fits = FitSettings::default();
        Self {
            folder,
            step: None,
            without_paper: false,
            cells: fits.cells,
            starts: fits.starts,
        }
    }

    /// The grid that rivals are made on.
    fn grid(&self, own: Grid) -> Result<Grid> {
        let Some(step) = self.step else {
            return Ok(own);
        };
        let grid = Grid::with_step_deg(step).context("--step")?;
        if step > STEP_MAX_DEG {
            bail!("--step {step}: at most {STEP_MAX_DEG} degrees");
        }
        if (step / own.step_deg()).fract() != 0.0 {
            bail!(
                "--step {step}: must be a multiple of {DENSE}'s {} degrees",
                own.step_deg()
            );
        }
        Ok(grid)
    }

    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let path = |name: &str| self.folder.join(name);
        if !(100..=1_000_000).contains(&self.cells) || !(1..=10_000).contains(&self.starts) {
            bail!("--cells must lie in 100..=1000000, --starts in 1..=10000");
        }
        let mut progress = Progress::new();
        let samples_path = path("samples.npy");
        let samples = progress.stage("reading samples", |_| read_samples(&samples_path))?;
        let dense = progress.stage("reading the dense BRDF", |_| read_dense(&path(DENSE)))?;
        let truth = match path(TRUTH).exists() {
            true => Some(read_dense(&path(TRUTH))?),
            false => None,
        };
        let own_grid = dense.brdf.grid();
        let grid = self.grid(own_grid)?;
        let thinned = |file: DenseFile| DenseFile {
            brdf: match grid == own_grid {
                true => file.brdf,
                false => coarse(&file.brdf, grid),
            },
            ..file
        };
        if let Some(truth) = &truth
            && truth.brdf.grid() != own_grid
        {
            bail!(
                "{}: is of another grid than {DENSE}; draw it again, or take it away",
                path(TRUTH).display()
            );
        }
        let session = Session {
            dense: thinned(dense),
            truth: truth.map(thinned),
            grid,
            own_grid,
        };
        let central = centres(&samples);
        if central.len() < 50 {
            bail!(
                "{}: has {} frames to take central samples of; give samples with frame numbers (N x 8)",
                samples_path.display(),
                central.len()
            );
        }
        let mut comparison = Comparison::default();
        comparison.rows.push(BaselineRow {
            name: "dense".into(),
            what: "all samples, gonia's interpolation".into(),
            numbers: samples.len() as u64,
            seconds: 0.0,
            against_dense: None,
            against_truth: session.against_truth(&session.dense.brdf, "dense")?,
            is_partial: false,
        });
        let mut rows: Vec<BaselinePictures> = vec![draw_baseline("dense", &session.dense.brdf)];
        if !self.without_paper {
            let (found, table) = session.paper(&samples, "paper", &mut progress)?;
            comparison.rows.push(found);
            session.write(path("paper.exr"), table, "the paper's method")?;
        }
        drop(samples);

        let what = "one sample a frame, gonia's interpolation";
        let numbers = central.len() as u64;
        if !self.without_paper {
            let (found, table) = session.paper(&central, "sparse-paper", &mut progress)?;
            comparison.rows.push(found);
            let what = "the paper's method on central samples only";
            session.write(path("sparse-paper.exr"), table, what)?;
        }
        let (rival, sparse) = session.filled(central, "sparse", what, &mut progress)?;
        comparison.rows.push(BaselineRow { numbers, ..rival });
        rows.push(draw_baseline("sparse", &sparse));
        session.write(path("sparse.exr"), sparse, "central samples only")?;

        // Strips see the material itself: the truth, or the best that is known of it.
        let material = session.truth.as_ref().unwrap_or(&session.dense);
        let strips = measure_on_strips(&Tabulated::new(&material.brdf), 1);
        let numbers = strips.len() as u64;
        let what = "simulated: 20 strips on a cylinder, with its noise";
        let (rival, strips) = session.filled(strips, "strips", what, &mut progress)?;
        comparison.rows.push(BaselineRow { numbers, ..rival });
        session.write(path("strips.exr"), strips, "simulated strips on a cylinder")?;

        for family in [Family::Kurt { lobes: 2 }, Family::Sadeghi { scaled: false }] {
            let settings = FitSettings {
                cells: self.cells,
                starts: self.starts,
                ..FitSettings::default()
            };
            let cells = draw(&session.dense.brdf, settings.cells, settings.seed);
            let result = fit_model(
                &session.dense,
                DENSE,
                &cells,
                family,
                &settings,
                &mut progress,
            )?;
            let note = &result.note;
            comparison.rows.push(BaselineRow {
                name: note.model.clone(),
                what: if note.converged {
                    "fitted to the dense measurement".into()
                } else {
                    "fitted, not converged: the best so far".into()
                },
                numbers: note.parameters.len() as u64,
                seconds: note.seconds,
                against_dense: Some(note.figures.clone()),
                against_truth: session.against_truth(&result.dense, &note.model)?,
                is_partial: false,
            });
            rows.push(draw_baseline(&note.model, &result.dense));
            let name = format!("{}.exr", note.model);
            write_fit(&path(&name), result, session.dense.scale)?;
        }
        comparison.write(&path(RIVALS))?;
        write_whole_bytes(
            &path(RIVALS_FIGURE).with_extension("svg"),
            figure(&rows).as_bytes(),
        )?;
        print(&comparison);
        Ok(())
    }
}

impl Session {
    /// The paper's interpolation of some samples, at the check cells.
    fn paper(
        &self,
        samples: &[Sample],
        name: &str,
        progress: &mut Progress,
    ) -> Result<(BaselineRow, DenseBrdf)> {
        let grid = check_grid(self.grid).with_context(|| {
            format!(
                "{DENSE}: steps of {} degrees have no coarser grid to check; use --without-paper",
                self.grid.step_deg()
            )
        })?;
        let start = Instant::now();
        let table = progress.stage(&format!("{name}, {} degrees", grid.step_deg()), |_| {
            let bins = Bins::new(self.own_grid, samples);
            fill_check_cells(&bins, &CellSettings::PAPER, grid)
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
        let rival = BaselineRow {
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
        Ok((rival, table))
    }

    /// Samples interpolated by gonia's own method.
    fn filled(
        &self,
        samples: Vec<Sample>,
        name: &str,
        what: &str,
        progress: &mut Progress,
    ) -> Result<(BaselineRow, DenseBrdf)> {
        let how = How {
            step: self.grid.step_deg(),
            preset: PresetArgument::Default,
            block: None,
            nodes: None,
            tolerance: None,
        };
        let (grid, settings) = how.check()?;
        let start = Instant::now();
        let filled = fill(samples, grid, settings, false, progress).context(name.to_owned())?;
        let seconds = start.elapsed().as_secs_f64();
        let rival = BaselineRow {
            name: name.to_owned(),
            what: what.to_owned(),
            numbers: 0,
            seconds,
            against_dense: Some(figures(
                (&filled.dense, name, Scale::Relative),
                (&self.dense.brdf, "dense", Scale::Absolute),
            )?),
            against_truth: self.against_truth(&filled.dense, name)?,
            is_partial: false,
        };
        Ok((rival, filled.dense))
    }

    fn against_truth(&self, brdf: &DenseBrdf, name: &str) -> Result<Option<Figures>> {
        let Some(truth) = &self.truth else {
            return Ok(None);
        };
        let measured = (brdf, name, self.dense.scale);
        Ok(Some(figures(
            measured,
            (&truth.brdf, "truth", truth.scale),
        )?))
    }

    fn write(&self, path: PathBuf, brdf: DenseBrdf, what: &str) -> Result<()> {
        let mut provenance = of_this_program();
        provenance.insert("rival".into(), what.to_owned());
        let scale = self.dense.scale;
        write_dense(
            &path,
            DenseFile {
                brdf,
                scale,
                provenance,
            },
        )?;
        Ok(())
    }
}

/// Cells of a grid, a pole counted once.
fn distinct(grid: Grid) -> f64 {
    let directions = grid.n_directions() - grid.n_phi() + 1;
    (directions * directions) as f64
}

type Named<'a> = (&'a DenseBrdf, &'a str, Scale);

fn figures(a: Named<'_>, b: Named<'_>) -> Result<Figures> {
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
    Ok(evaluate::compare(first, second, &options)?)
}

/// The table on standard output.
fn print(comparison: &Comparison) {
    println!(
        "{:<14} {:>11} {:>10}  {:<32}  {:<32}",
        "way", "numbers", "seconds", "against dense: int, graz, cos, ΔE", "against truth"
    );
    for row in &comparison.rows {
        let text = |figures: &Option<Figures>| match figures {
            None => "–".to_owned(),
            Some(figures) => {
                let log = |stratum| figures.stratum(stratum).map_or(f64::NAN, |row| row.log_rms);
                let cosine = figures.stratum(Stratum::All);
                let sphere = match row.is_partial {
                    true => "    –".to_owned(),
                    false => format!("{:>5.2}", figures.sphere_delta_e),
                };
                format!(
                    "{:.4} {:.4} {:>6.2}% {sphere}",
                    log(Stratum::Interior),
                    log(Stratum::Grazing),
                    100.0 * cosine.map_or(f64::NAN, |row| row.cos_error_mean)
                )
            }
        };
        println!(
            "{:<14} {:>11} {:>10.1}  {:<32}  {:<32}",
            row.name,
            row.numbers,
            row.seconds,
            text(&row.against_dense),
            text(&row.against_truth)
        );
    }
}
