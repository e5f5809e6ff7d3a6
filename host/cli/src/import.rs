//! `gonia import`: other people's measurements.

use crate::progress::Progress;

use crate::table::count;
use anyhow::{Context, Result, bail};
use gonia_brdf::{Brdf, DenseBrdf, Grid};
use gonia_formats::dense_exr::write_dense;
use gonia_formats::merl::read_merl;
use gonia_formats::ngan::read_ngan;
use gonia_formats::samples::{check_sample_name, write_samples};
use gonia_formats::utia::read_utia;
use gonia_rig::{DenseFile, Scale};
use std::path::PathBuf;

/// Brings a material of the UTIA database (.bin, anisotropic) or of MERL (.binary, isotropic) onto
/// gonia's grid, so that every other command can compare, fit and draw it; one of Ngan, Durand and
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
        let extension = self
            .material
            .extension()
            .unwrap_or_default()
            .to_string_lossy();
        if extension == "dat" {
            return self.import_samples();
        }
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
                "{}: neither .bin (UTIA), .binary (MERL) nor .dat (Ngan, Durand, Matusik); give other samples to gonia fill as CSV",
                self.material.display()
            ),
        };
        let progress = Progress::new();
        let brdf = progress.stage("bringing it onto the grid", |_| {
            anyhow::Ok(DenseBrdf::tabulate(grid, model.as_ref()))
        })?;
        let mut provenance = gonia_pipeline::provenance::of_this_program();
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
    fn import_samples(&self) -> Result<()> {
        check_sample_name(&self.output)?;
        let progress = Progress::new();
        let samples = progress.stage("reading the bins", |_| read_ngan(&self.material))?;
        write_samples(&self.output, &samples)?;
        println!(
            "{} bins hold a measurement; gonia fill {} makes them dense",
            count(samples.len() as u64),
            self.output.display()
        );
        Ok(())
    }
}
