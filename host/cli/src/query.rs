//! `gonia query`: values at any directions.

use crate::{remarks, say};
use anyhow::{Context, Result};
use gonia_brdf::{Direction, Grid};
use gonia_formats::dense::DenseLookup;
use gonia_formats::directions_csv::{ANGLES, DirectionRow, read_directions};
use gonia_rig::Remark;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Reads directions from standard input (a table with the columns theta_i, phi_i, theta_v, phi_v, in
/// degrees) and writes them with r, g, b, interpolated between the nodes.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  printf 'theta_i,phi_i,theta_v,phi_v\\n30,45,60,225\\n' | gonia query dense.exr\n\nA grid ends at 86 degrees or before: a direction beyond its last polar angle has the value there, and\na warning on standard error counts such directions. The rows stay the same."
)]
pub struct Query {
    /// The dense BRDF
    dense: PathBuf,
}

impl Query {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let mut brdf = DenseLookup::open(&self.dense)?;
        let place = Path::new("standard input");
        let mut bytes = Vec::new();
        std::io::stdin()
            .lock()
            .read_to_end(&mut bytes)
            .with_context(|| place.display().to_string())?;
        let rows = read_directions(place, bytes)?;
        let mut beyond = Beyond::of(brdf.grid());
        let mut out = BufWriter::new(std::io::stdout().lock());
        let mut said = writeln!(out, "{},r,g,b", ANGLES.join(","));
        for row in rows {
            if said.is_err() {
                break;
            }
            let [theta_i, phi_i, theta_v, phi_v] = row.angles_deg;
            beyond.count(row);
            let [r, g, b] = brdf.lookup(
                Direction::from_deg(theta_i, phi_i),
                Direction::from_deg(theta_v, phi_v),
            )?;
            said = writeln!(out, "{theta_i},{phi_i},{theta_v},{phi_v},{r},{g},{b}");
        }
        say::written(said.and_then(|()| out.flush()))?;
        remarks::print(beyond.remark().as_slice());
        Ok(())
    }
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
