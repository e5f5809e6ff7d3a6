//! `gonia import`: other people's measurements.

use crate::progress::Progress;
use crate::provenance::of_this_program;
use crate::table::count;
use anyhow::{Context, Result};
use gonia_brdf::{Brdf, DenseBrdf, Grid, Sample};
use gonia_formats::FileError;
use gonia_formats::dense::{check_dense_name, write_dense};
use gonia_formats::foreign::{ForeignContent, ForeignFormat, foreign_format};
use gonia_formats::samples::{check_sample_name, write_samples};
use gonia_rig::{DenseFile, Scale};
use std::path::{Path, PathBuf};

/// Brings a material of the UTIA database (.bin, anisotropic) or of MERL (.binary, isotropic) onto
/// gonia's grid, so that every other command can judge, fit and draw it; one of Ngan, Durand and
/// Matusik (.dat, anisotropic), which is full of holes, becomes samples for `gonia fill`.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia import fabric112.bin -o fabric112.exr\n  gonia import velvet.dat -o velvet.npy && gonia fill velvet.npy -o velvet.exr\n\nUTIA's values end at 75 degrees; beyond, the last ring's are repeated. Samples of other formats come\nin as CSV or .npy by `gonia fill`."
)]
pub struct Import {
    /// The material, .bin, .binary or .dat
    material: PathBuf,
    /// The dense BRDF to write (OpenEXR), or for .dat the samples (.npy or .csv)
    #[arg(short, long, value_name = "DENSE.exr")]
    output: PathBuf,
    /// Step of the grid in degrees
    #[arg(long, default_value_t = 2.0, value_name = "DEG")]
    step: f64,
}

impl Import {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let grid = Grid::with_step_deg(self.step).context("--step")?;
        let ForeignFormat { name, content } = foreign_format(&self.material)?;
        match content {
            ForeignContent::Brdf { scale, read } => {
                self.import_brdf(grid, name, *scale, read(&self.material)?.as_ref())
            }
            ForeignContent::Samples { read } => self.import_samples(*read),
        }
    }

    fn import_brdf(&self, grid: Grid, format: &str, scale: Scale, model: &dyn Brdf) -> Result<()> {
        check_dense_name(&self.output)?;
        let mut progress = Progress::new();
        let brdf = progress.stage("bringing it onto the grid", |_| {
            anyhow::Ok(DenseBrdf::tabulate(grid, model))
        })?;
        let mut provenance = of_this_program();
        provenance.insert(
            "imported".into(),
            format!("{} ({format})", self.material.display()),
        );
        write_dense(
            &self.output,
            DenseFile {
                brdf,
                scale,
                provenance,
            },
        )?;
        Ok(())
    }

    fn import_samples(&self, read: fn(&Path) -> Result<Vec<Sample>, FileError>) -> Result<()> {
        check_sample_name(&self.output)?;
        let mut progress = Progress::new();
        let samples = progress.stage("reading the bins", |_| read(&self.material))?;
        write_samples(&self.output, &samples)?;
        println!(
            "{} bins hold a measurement; gonia fill {} makes them dense",
            count(samples.len() as u64),
            self.output.display()
        );
        Ok(())
    }
}
