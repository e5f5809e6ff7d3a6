//! `gonia query`: values at any directions.

use crate::sample_facts::is_samples;
use crate::say::errln;
use crate::symmetry::SymmetryArgument;
use crate::{remarks, say};
use anyhow::{Context, Result, bail};
use gonia_brdf::{Direction, Grid};
use gonia_formats::dense::{DenseLookup, are_errors_of, read_dense_channels};
use gonia_formats::directions_csv::{ANGLES, DirectionRow, read_directions};
use gonia_formats::samples::read_channels;
use gonia_pipeline::budget::budget_in;
use gonia_pipeline::provenance::Provenance;
use gonia_pipeline::{Behind, FitOfSamples};
use gonia_report::files::ERRORS;
use gonia_rig::{Channels, Remark};
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Reads directions from standard input (a table with the columns theta_i, phi_i, theta_v, phi_v, in
/// degrees) and writes them with r, g, b (or Y, or 380nm, ...: the channels that there are). A fit of samples is
/// evaluated at these directions. A dense BRDF is interpolated between its nodes, or its fit is evaluated, if it was
/// made from few samples that are still there.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  printf 'theta_i,phi_i,theta_v,phi_v\\n30,45,60,225\\n' | gonia query dense.exr\n\nSamples (.npy, .npz, .csv, .txt, .tsv; at most a million) are fitted without a grid: a peak that is narrower than\na grid's step is kept. DENSE.exr holds the path of its samples and their checksum; gonia looks for them there and\nbeside it. Standard error names what was evaluated (fit or grid), and the symmetry of the fit.\n\nA grid ends at 86 degrees or before: a direction beyond its last polar angle has the value there, and\na warning on standard error counts such directions. The rows stay the same."
)]
pub struct Query {
    /// The dense BRDF, or the samples themselves
    dense: PathBuf,
    /// Of samples: the material's symmetry about its normal [default: auto; of a dense BRDF that of its fill]
    #[arg(long, value_enum)]
    symmetry: Option<SymmetryArgument>,
    /// Of a dense BRDF: ask its grid, though its samples are there
    #[arg(long)]
    grid: bool,
    /// Add the standard uncertainty of each value (u, k = 1) and the expanded one (U, k = 2): of samples by the fit
    /// and what they say of their rig, of a dense BRDF from the file that --error names or error.exr beside it
    #[arg(long)]
    uncertainty: bool,
    /// Of a dense BRDF: its error bars, as gonia fill --error wrote them; asks for uncertainties too
    #[arg(long, value_name = "ERR.exr")]
    error: Option<PathBuf>,
}

impl Query {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if is_samples(&self.dense) {
            self.ask_samples()
        } else {
            self.ask_dense()
        }
    }

    fn ask_dense(self) -> Result<()> {
        let mut brdf = DenseLookup::open(&self.dense)?;
        if self.symmetry.is_some() {
            bail!(
                "--symmetry: {} is a dense BRDF, which has the symmetry of its fill; leave it out, or give the samples",
                self.dense.display()
            );
        }
        // Error bars are those of the grid.
        if !self.grid && self.error.is_none() {
            let behind = Behind::of(&self.dense, &mut brdf)
                .with_context(|| format!("the samples of {}", self.dense.display()))?;
            match behind {
                Behind::Grid => {}
                Behind::Fit {
                    fit,
                    samples,
                    remarks,
                } => {
                    remarks::print(&remarks);
                    let names: Vec<String> = samples
                        .iter()
                        .map(|path| path.display().to_string())
                        .collect();
                    let provenance = brdf.provenance().clone();
                    return self.ask_fit(&fit, &names.join(" "), &provenance);
                }
                Behind::Missing(samples) => errln!(
                    "evaluated: the grid, linear between its nodes; {}, whose fit it is, is not there",
                    samples.display()
                ),
                Behind::Other(remark) => remarks::print(&[remark]),
            }
        }
        self.ask_grid(&mut brdf)
    }

    fn ask_grid(&self, brdf: &mut DenseLookup) -> Result<()> {
        let rows = asked()?;
        let mut beyond = Beyond::of(brdf.grid());
        let mut errors = self.errors()?;
        let mut out = BufWriter::new(std::io::stdout().lock());
        let mut said = header(&mut out, brdf.channels(), errors.is_some());
        for asked in rows {
            if said.is_err() {
                break;
            }
            beyond.count(asked);
            let (light, view) = pair_of(asked.angles_deg);
            let mut values = brdf.lookup(light, view)?;
            if let Some(errors) = &mut errors {
                with_u(&mut values, errors.lookup(light, view)?);
            }
            said = row(&mut out, asked.angles_deg, &values);
        }
        say::written(said.and_then(|()| out.flush()))?;
        remarks::print(beyond.remark().as_slice());
        Ok(())
    }

    /// The error bars of a dense BRDF, where they are asked for.
    fn errors(&self) -> Result<Option<DenseLookup>> {
        let path = match &self.error {
            Some(path) => path.clone(),
            None if !self.uncertainty => return Ok(None),
            None => {
                let beside = self.dense.with_file_name(ERRORS);
                if !beside.exists() {
                    bail!(
                        "--uncertainty: {} holds no uncertainties, and no {ERRORS} lies beside it; give the file that gonia fill --error wrote with it by --error ERR.exr",
                        self.dense.display()
                    );
                }
                errln!("uncertainties: {}", beside.display());
                beside
            }
        };
        let path = &path;
        let errors = DenseLookup::open(path)?;
        let of = (errors.grid(), errors.channels(), errors.provenance());
        if !are_errors_of(of, &read_dense_channels(&self.dense)?) {
            bail!(
                "{}: is not of the values of {}; give by --error the error bars that were written with it (gonia fill --error)",
                path.display(),
                self.dense.display()
            );
        }
        Ok(Some(errors))
    }

    fn ask_samples(self) -> Result<()> {
        if self.grid {
            bail!(
                "--grid: {} is samples, which have no grid; leave it out, or give a dense BRDF",
                self.dense.display()
            );
        }
        let read = read_channels(&self.dense)?;
        remarks::print(&read.remarks);
        let provenance = read.provenance;
        let name = self.dense.display().to_string();
        let symmetry = self.symmetry.and_then(Into::into);
        let (fit, said_of_it) =
            FitOfSamples::new(read.values, symmetry).with_context(|| name.clone())?;
        remarks::print(&said_of_it);
        self.ask_fit(&fit, &name, &provenance)
    }

    /// Asks a fit at the directions on standard input, and says which it is. `provenance` is that of its samples.
    fn ask_fit(&self, fit: &FitOfSamples, samples: &str, provenance: &Provenance) -> Result<()> {
        let choice = fit.choice();
        errln!(
            "evaluated: the fit of {samples}; {} ({})",
            choice.settings,
            choice.reason
        );
        let rows = asked()?;
        let pairs: Vec<_> = rows.iter().map(|asked| pair_of(asked.angles_deg)).collect();
        let found = if self.uncertainty {
            let budget = budget_in(provenance)?;
            if budget.is_none() {
                errln!(
                    "u holds noise and interpolation alone: the samples say nothing of their rig"
                );
            }
            let found = fit.with_uncertainty(&pairs, budget.as_ref()).into_iter();
            let split = found.map(|channels| {
                let mut values: Vec<f32> = channels.iter().map(|of| of[0]).collect();
                with_u(&mut values, channels.iter().map(|of| of[1]).collect());
                values
            });
            split.collect()
        } else {
            fit.at_all(&pairs)
        };
        let mut out = BufWriter::new(std::io::stdout().lock());
        let mut said = header(&mut out, fit.channels(), self.uncertainty);
        for (asked, values) in rows.into_iter().zip(found) {
            said = said.and_then(|()| row(&mut out, asked.angles_deg, &values));
        }
        say::written(said.and_then(|()| out.flush()))
    }
}

/// Adds uncertainties to values: u of each, and U = 2 u of each.
fn with_u(values: &mut Vec<f32>, u: Vec<f32>) {
    let expanded: Vec<f32> = u.iter().map(|u| 2.0 * u).collect();
    values.extend(u);
    values.extend(expanded);
}

/// The directions on standard input.
fn asked() -> Result<Vec<DirectionRow>> {
    let place = Path::new("standard input");
    let mut bytes = Vec::new();
    std::io::stdin()
        .lock()
        .read_to_end(&mut bytes)
        .with_context(|| place.display().to_string())?;
    Ok(read_directions(place, bytes)?)
}

fn pair_of([theta_i, phi_i, theta_v, phi_v]: [f64; 4]) -> (Direction, Direction) {
    (
        Direction::from_deg(theta_i, phi_i),
        Direction::from_deg(theta_v, phi_v),
    )
}

fn header(
    out: &mut impl Write,
    channels: &Channels,
    with_uncertainty: bool,
) -> std::io::Result<()> {
    let mut names = channels.column_names();
    if with_uncertainty {
        let of = |u: &'static str| names.iter().map(move |name| format!("{u}_{name}"));
        let more: Vec<String> = of("u").chain(of("U")).collect();
        names.extend(more);
    }
    let names = names.join(",");
    writeln!(out, "{},{names}", ANGLES.join(","))
}

fn row(
    out: &mut impl Write,
    [theta_i, phi_i, theta_v, phi_v]: [f64; 4],
    values: &[f32],
) -> std::io::Result<()> {
    write!(out, "{theta_i},{phi_i},{theta_v},{phi_v}")?;
    for value in values {
        write!(out, ",{value}")?;
    }
    writeln!(out)
}

/// Directions beyond the grid's last polar angle, which have its value.
struct Beyond {
    last_deg: f64,
    asked: usize,
    beyond: usize,
    /// The line, the column and the polar angle of the first.
    first: Option<(usize, &'static str, f64)>,
}

impl Beyond {
    fn of(grid: Grid) -> Self {
        Self {
            last_deg: (grid.n_theta() - 1) as f64 * grid.step_deg(),
            asked: 0,
            beyond: 0,
            first: None,
        }
    }

    fn count(&mut self, row: DirectionRow) {
        let [theta_i, _, theta_v, _] = row.angles_deg;
        // Angles that were radians once may be off in their last digits.
        let is_beyond = |theta: f64| theta > self.last_deg + 1e-6;
        let found = [(ANGLES[0], theta_i), (ANGLES[2], theta_v)]
            .into_iter()
            .find(|(_, theta)| is_beyond(*theta));
        self.asked += 1;
        if let Some((name, theta)) = found {
            self.beyond += 1;
            self.first.get_or_insert((row.line, name, theta));
        }
    }

    fn remark(&self) -> Option<Remark> {
        let (line, name, theta) = self.first?;
        Some(Remark::new(
            "standard input",
            format_args!(
                "{} of {} directions lie beyond the grid's last polar angle, {} degrees (the first in line {line}: {name} = {theta}): they have the value there",
                self.beyond, self.asked, self.last_deg
            ),
            "do not take those values for measured or interpolated ones",
        ))
    }
}
