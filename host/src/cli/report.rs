//! `gonia report`: pictures and figures of a measurement, drawn again from its folder.

use super::progress::Progress;
use crate::dataset::dense_exr::read_dense;
use crate::dataset::{CellMask, Summary, cell_mask};
use crate::evaluate::Tabulated;
use crate::report::{ReportInput, write_report};
use anyhow::Result;
use gonia_brdf::Brdf;
use std::path::{Path, PathBuf};

/// Draws DIR/report.html from DIR/dense.exr and, where they are there, summary.toml, bins.npy and
/// truth.exr.
#[derive(clap::Args)]
#[command(after_long_help = "Example:\n  gonia report gonia-demo -o fabric.html")]
pub struct Report {
    /// The folder of a measurement
    folder: PathBuf,
    /// Where to write the report [default: DIR/report.html]
    #[arg(short, long, value_name = "REPORT.html")]
    output: Option<PathBuf>,
}

impl Report {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let file = |name: &str| self.folder.join(name);
        let there = |name: &str| Some(file(name)).filter(|path| path.exists());
        let mut progress = Progress::new();
        let dense = progress.stage("reading", |_| read_dense(&file("dense.exr")))?;
        let mut summary = match there("summary.toml") {
            Some(path) => Summary::read(&path)?,
            None => Summary::new(name_of(&self.folder), dense.scale),
        };
        for (name, text) in &dense.provenance {
            summary
                .provenance
                .entry(name.clone())
                .or_insert_with(|| text.clone());
        }
        let measured: Option<CellMask> = there("bins.npy")
            .map(|path| cell_mask::read_mask(&path, dense.brdf.grid()))
            .transpose()?;
        let truth = there("truth.exr")
            .map(|path| read_dense(&path))
            .transpose()?;
        let truth = truth.as_ref().map(|file| Tabulated::new(&file.brdf));
        let output = self.output.clone().unwrap_or_else(|| file("report.html"));
        progress.stage("drawing the report", |_| {
            write_report(
                &output,
                &ReportInput {
                    summary: &summary,
                    dense: &dense.brdf,
                    truth: truth.as_ref().map(|t| t as &dyn Brdf),
                    measured: measured.as_ref(),
                },
            )
        })?;
        println!("{}", output.display());
        Ok(())
    }
}

fn name_of(folder: &Path) -> String {
    folder
        .file_name()
        .map_or_else(|| "BRDF".into(), |name| name.to_string_lossy().into_owned())
}
