//! `gonia compare`: one dense BRDF against another.

use anyhow::Result;
use gonia_formats::dense::read_dense;
use gonia_formats::write_whole_bytes;
use gonia_pipeline as evaluate;
use gonia_pipeline::compare::Table;
use gonia_pipeline::{Options, Side};
use std::path::PathBuf;

/// Prints the error figures of A against B by stratum. Where either is relative, one factor is
/// fitted and said.
#[derive(clap::Args)]
#[command(after_long_help = "Example:\n  gonia compare dense.exr truth.exr --csv figures.csv")]
pub struct Compare {
    /// The dense BRDF to judge
    a: PathBuf,
    /// What it is judged by
    b: PathBuf,
    /// Write the figures as CSV too
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

impl Compare {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let a = read_dense(&self.a)?;
        let b = read_dense(&self.b)?;
        let (name_a, name_b) = (self.a.display().to_string(), self.b.display().to_string());
        let figures = evaluate::compare(
            Table {
                brdf: &a.brdf,
                scale: a.scale,
            },
            Side::Table(Table {
                brdf: &b.brdf,
                scale: b.scale,
            }),
            &Options {
                name_a: &name_a,
                name_b: &name_b,
                ..Options::default()
            },
        )?;
        print!("{figures}");
        if let Some(path) = &self.csv {
            write_whole_bytes(path, figures.to_csv().as_bytes())?;
        }
        Ok(())
    }
}
