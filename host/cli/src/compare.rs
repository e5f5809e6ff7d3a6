//! `gonia compare`: one dense BRDF against another.

use crate::output;
use crate::say::outln;
use anyhow::Result;
use gonia_formats::dense::read_dense;
use gonia_formats::write_whole_bytes;
use gonia_pipeline::{Options, Side, Table, compare};
use std::path::PathBuf;

/// Prints the error figures of A against B by stratum. Where either is relative, one factor is
/// fitted and said.
#[derive(clap::Args)]
#[command(after_long_help = "Example:\n  gonia compare dense.exr truth.exr --csv figures.csv")]
pub struct Compare {
    /// The dense BRDF to compare
    a: PathBuf,
    /// What it is compared with
    b: PathBuf,
    /// Write the figures as CSV too
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

impl Compare {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if let Some(csv) = &self.csv {
            output::check_table(csv, &[&self.a, &self.b])?;
        }
        let a = read_dense(&self.a)?;
        let b = read_dense(&self.b)?;
        let (name_a, name_b) = (self.a.display().to_string(), self.b.display().to_string());
        let options = Options {
            name_a: &name_a,
            name_b: &name_b,
            ..Options::default()
        };
        let figures = compare(Table::from(&a), Side::Table(Table::from(&b)), &options)?;
        outln!("{figures}");
        if let Some(factor) = figures.factor {
            outln!(
                "factor     {factor:.6} taken out: {name_a} is {}, {name_b} {}, so their levels are not compared",
                a.scale,
                b.scale
            );
        }
        if let Some(path) = &self.csv {
            write_whole_bytes(path, figures.to_csv().as_bytes())?;
        }
        Ok(())
    }
}
