//! `gonia query`: values at any directions.

use anyhow::{Context, Result, bail};
use gonia_brdf::Direction;
use gonia_formats::dense::DenseLookup;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

/// The columns that are read, in the order they are written.
const ANGLES: [&str; 4] = ["theta_i", "phi_i", "theta_v", "phi_v"];

/// Reads directions from standard input (CSV with the columns theta_i, phi_i, theta_v, phi_v, in
/// degrees) and writes them with r, g, b, interpolated between the nodes.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  printf 'theta_i,phi_i,theta_v,phi_v\\n30,45,60,225\\n' | gonia query dense.exr"
)]
pub struct Query {
    /// The dense BRDF
    dense: PathBuf,
}

impl Query {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let mut brdf = DenseLookup::open(&self.dense)?;
        let last_deg = (brdf.grid().n_theta() - 1) as f64 * brdf.grid().step_deg();
        let mut input = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(std::io::stdin().lock());
        let header = input.headers().context("standard input, line 1")?.clone();
        let mut columns = [0; 4];
        for (name, column) in ANGLES.iter().zip(&mut columns) {
            *column = header.iter().position(|h| h == *name).with_context(|| {
                format!(
                    "standard input, line 1: no column {name}; begin with the header {}",
                    ANGLES.join(",")
                )
            })?;
        }
        let mut out = BufWriter::new(std::io::stdout().lock());
        writeln!(out, "{},r,g,b", ANGLES.join(","))?;
        let mut beyond = 0usize;
        for record in input.records() {
            let record = record.context("standard input")?;
            let line = record.position().map_or(0, |p| p.line());
            let mut angles = [0.0f64; 4];
            for k in 0..4 {
                let text = record.get(columns[k]).unwrap_or_default();
                angles[k] = match text.parse::<f64>() {
                    Ok(value) if value.is_finite() => value,
                    _ => bail!(
                        "standard input, line {line}: '{text}' in column {} is not a number of degrees",
                        ANGLES[k]
                    ),
                };
            }
            let [theta_i, phi_i, theta_v, phi_v] = angles;
            for (name, theta) in [("theta_i", theta_i), ("theta_v", theta_v)] {
                if !(0.0..=90.0).contains(&theta) {
                    bail!(
                        "standard input, line {line}: {name} = {theta} is not an elevation in 0..=90 degrees"
                    );
                }
            }
            beyond += usize::from(theta_i.max(theta_v) > last_deg);
            let rgb = brdf.lookup(
                Direction::from_deg(theta_i, phi_i),
                Direction::from_deg(theta_v, phi_v),
            )?;
            writeln!(
                out,
                "{theta_i},{phi_i},{theta_v},{phi_v},{},{},{}",
                rgb[0], rgb[1], rgb[2]
            )?;
        }
        out.flush()?;
        if beyond > 0 {
            eprintln!(
                "{beyond} directions lie above the grid's last elevation, {last_deg} degrees: they got its value"
            );
        }
        Ok(())
    }
}
