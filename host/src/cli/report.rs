//! `gonia report`: pictures and figures of a measurement, drawn again from its folder.

use super::progress::Progress;
use crate::report::report_folder;
use anyhow::Result;
use std::path::PathBuf;

/// Draws DIR/report.html from DIR/dense.exr and, where they are there, summary.toml, measured.npy,
/// truth.exr, error.exr, rig.toml, the fits of `gonia fit` (*.fit.toml) and charts (*.svg).
#[derive(clap::Args)]
#[command(after_long_help = "Example:\n  gonia report gonia-demo")]
pub struct Report {
    /// The folder of a measurement
    folder: PathBuf,
}

impl Report {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let mut progress = Progress::new();
        let path = progress.stage("drawing the report", |_| report_folder(&self.folder))?;
        println!("{}", path.display());
        Ok(())
    }
}
