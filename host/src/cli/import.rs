//! `gonia import`: other people's measurements as a dense BRDF.

use super::progress::Progress;
use super::provenance::of_this_program;
use crate::dataset::dense_exr::write_dense;
use crate::dataset::merl::read_merl;
use crate::dataset::utia::read_utia;
use crate::dataset::{DenseFile, Scale};
use anyhow::{Context, Result, bail};
use gonia_brdf::{Brdf, DenseBrdf, Grid};
use std::path::PathBuf;

/// Brings a material of the UTIA database (.bin, anisotropic) or of MERL (.binary, isotropic) onto
/// gonia's grid, so that every other command can judge, fit and draw it.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia import fabric112.bin -o fabric112.exr\n\nUTIA's values end at 75 degrees; beyond, the last ring's are repeated. Samples of other formats come\nin as CSV or .npy by `gonia fill`."
)]
pub struct Import {
    /// The material, .bin or .binary
    material: PathBuf,
    /// The dense BRDF to write (OpenEXR)
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
        let extension = self
            .material
            .extension()
            .unwrap_or_default()
            .to_string_lossy();
        let (model, format, scale): (Box<dyn Brdf>, _, _) = match extension.as_ref() {
            "bin" => (
                Box::new(read_utia(&self.material)?),
                "UTIA .bin",
                Scale::Relative,
            ),
            "binary" => (
                Box::new(read_merl(&self.material)?),
                "MERL .binary",
                Scale::Absolute,
            ),
            _ => bail!(
                "{}: neither .bin (UTIA) nor .binary (MERL); give other samples to gonia fill as CSV",
                self.material.display()
            ),
        };
        let mut progress = Progress::new();
        let brdf = progress.stage("bringing it onto the grid", |_| {
            anyhow::Ok(DenseBrdf::tabulate(grid, model.as_ref()))
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
}
