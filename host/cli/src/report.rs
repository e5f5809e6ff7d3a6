//! `gonia report`: pictures and figures of a measurement, drawn again from its folder.

use crate::baselines::make_and_print;
use crate::progress::Progress;
use crate::remarks;
use crate::say::outln;
use anyhow::Result;
use gonia_brdf::fit::FitSettings;
use gonia_formats::{check_writable, check_writable_beside};
use gonia_pipeline::baselines::BaselineOptions;
use gonia_report::files::REPORT;
use gonia_report::report_folder;
use std::path::PathBuf;

/// Draws DIR/report.html from DIR/dense.exr and, where they are there, summary.toml, measured.npy,
/// truth.exr, error.exr, rig.toml, the fits of `gonia fit` (*.fit.toml), the comparison of `gonia
/// rivals` and charts (*.svg).
#[derive(clap::Args)]
#[command(
    after_long_help = "Examples:\n  gonia report gonia-demo\n  gonia report gonia-demo --rivals --figures figures\n\nThe second one is every figure and comparison of the paper: --figures writes Fig. 2, 3, 6, 8 and 9 as\nfiles (3 needs rig.toml, 8 the rivals), and --rivals first makes the rivals as `gonia rivals DIR` does,\nwhich takes minutes."
)]
pub struct Report {
    /// The folder of a measurement
    folder: PathBuf,
    /// Write the paper's figures too, as PNG and SVG, into this folder
    #[arg(long, value_name = "FOLDER")]
    figures: Option<PathBuf>,
    /// First make the baselines of the measurement, and compare them
    #[arg(long)]
    rivals: bool,
}

impl Report {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let progress = Progress::new();
        // A folder that is not there is not made.
        if self.folder.is_dir() {
            check_writable_beside(&self.folder.join(REPORT))?;
        }
        if let Some(figures) = &self.figures {
            check_writable(figures)?;
        }
        if self.rivals {
            let options = BaselineOptions {
                without_paper: false,
                fits: FitSettings::default(),
            };
            make_and_print(&self.folder, None, &options)?;
        }
        let drawn = progress.stage("drawing the report", |_| {
            report_folder(&self.folder, self.figures.as_deref())
        })?;
        remarks::print(&drawn.remarks);
        for path in drawn.written {
            outln!("{}", path.display());
        }
        Ok(())
    }
}
