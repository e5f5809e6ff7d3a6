//! `gonia compare`: one dense BRDF against another.

use crate::colours::colours;
use crate::output;
use crate::say::outln;
use anyhow::{Result, bail};
use gonia_formats::dense::read_dense_channels;
use gonia_formats::write_whole_bytes;
use gonia_pipeline::{Options, Side, Table, compare, compare_bands};
use std::path::PathBuf;

/// Prints the error figures of A against B by stratum. Where either is relative, one factor is
/// fitted and said. Bands are compared as colours (CIE 1931 under D65), and by themselves in the last line.
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
        let a = read_dense_channels(&self.a)?;
        let b = read_dense_channels(&self.b)?;
        let (name_a, name_b) = (self.a.display().to_string(), self.b.display().to_string());
        if a.channels != b.channels {
            bail!(
                "{name_a}: has the channels {}, and {name_b} {}; give two of the same channels",
                a.channels,
                b.channels
            );
        }
        let of_bands = compare_bands(&a, &b);
        let a = colours(a, &self.a)?;
        let b = colours(b, &self.b)?;
        let options = Options {
            name_a: &name_a,
            name_b: &name_b,
            ..Options::default()
        };
        let figures = compare(Table::from(&a), Side::Table(Table::from(&b)), &options)?;
        outln!("{figures}");
        if let Some(figures) = of_bands {
            outln!("{figures}");
        }
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
