//! `gonia query`: values at any directions.

use crate::say::errln;
use crate::symmetry::SymmetryArgument;
use crate::{remarks, say};
use anyhow::{Context, Result};
use gonia_brdf::{Direction, Grid};
use gonia_formats::dense::DenseLookup;
use gonia_formats::directions_csv::{ANGLES, DirectionRow, read_directions};
use gonia_formats::samples::read_channels;
use gonia_pipeline::FitOfSamples;
use gonia_rig::{Channels, Remark};
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Reads directions from standard input (a table with the columns theta_i, phi_i, theta_v, phi_v, in
/// degrees) and writes them with r, g, b (or Y, or 380nm, ...: the channels that there are): of a dense BRDF interpolated between the nodes, of samples as
/// a fit to them has it at the very directions.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  printf 'theta_i,phi_i,theta_v,phi_v\\n30,45,60,225\\n' | gonia query dense.exr\n\nOf samples (.npy, .npz, .csv, .txt, .tsv; at most a million) no grid comes in between: a peak that is narrower than\na grid's step is kept. What symmetry was taken of them is printed on standard error.\n\nA grid ends at 86 degrees or before: a direction beyond its last polar angle has the value there, and\na warning on standard error counts such directions. The rows stay the same."
)]
pub struct Query {
    /// The dense BRDF, or the samples themselves
    dense: PathBuf,
    /// Of samples: the material's symmetry about its normal
    #[arg(long, value_enum, default_value = "auto")]
    symmetry: SymmetryArgument,
}

/// Endings of samples; what else there is, is a dense BRDF.
const SAMPLES: [&str; 5] = ["npy", "npz", "csv", "txt", "tsv"];

impl Query {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let ending = self.dense.extension().and_then(|e| e.to_str());
        let is_samples = ending.is_some_and(|e| SAMPLES.iter().any(|s| e.eq_ignore_ascii_case(s)));
        if is_samples {
            self.ask_samples()
        } else {
            self.ask_dense()
        }
    }

    fn ask_dense(self) -> Result<()> {
        let mut brdf = DenseLookup::open(&self.dense)?;
        let rows = asked()?;
        let mut beyond = Beyond::of(brdf.grid());
        let mut out = BufWriter::new(std::io::stdout().lock());
        let mut said = header(&mut out, brdf.channels());
        for asked in rows {
            if said.is_err() {
                break;
            }
            beyond.count(asked);
            let (light, view) = pair_of(asked.angles_deg);
            said = row(&mut out, asked.angles_deg, &brdf.lookup(light, view)?);
        }
        say::written(said.and_then(|()| out.flush()))?;
        remarks::print(beyond.remark().as_slice());
        Ok(())
    }

    fn ask_samples(self) -> Result<()> {
        let read = read_channels(&self.dense)?;
        remarks::print(&read.remarks);
        let (fit, said_of_it) = FitOfSamples::new(read.values, self.symmetry.into())
            .with_context(|| self.dense.display().to_string())?;
        remarks::print(&said_of_it);
        let choice = fit.choice();
        errln!("{} ({})", choice.settings, choice.reason);
        let rows = asked()?;
        let pairs: Vec<_> = rows.iter().map(|asked| pair_of(asked.angles_deg)).collect();
        let mut out = BufWriter::new(std::io::stdout().lock());
        let mut said = header(&mut out, fit.channels());
        for (asked, values) in rows.into_iter().zip(fit.at_all(&pairs)) {
            said = said.and_then(|()| row(&mut out, asked.angles_deg, &values));
        }
        say::written(said.and_then(|()| out.flush()))
    }
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

fn header(out: &mut impl Write, channels: &Channels) -> std::io::Result<()> {
    let names = channels.column_names().join(",");
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
