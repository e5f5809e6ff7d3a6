//! `gonia rivals`: the baselines of a measurement, from the same session.

use crate::baselines::make_and_print;
use anyhow::{Result, bail};
use gonia_brdf::fit::FitSettings;
use gonia_pipeline::baselines::BaselineOptions;
use std::path::PathBuf;

/// Makes the BRDF of a session by other ways and says how far each is from the dense measurement,
/// and from the truth where DIR holds truth.exr: the frames' central samples alone, the paper's
/// interpolation (on a share of the cells: all would take core-hours), a measurement on strips
/// around a cylinder, Kurt's model of two lobes and the microcylinder model.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia rivals gonia-demo && gonia report gonia-demo\n\nReads DIR/dense.exr and DIR/samples.npy (with frame numbers); writes DIR/rivals.toml, the figure\nDIR/rivals.svg, and each BRDF as DIR/NAME.exr (those of the\npaper's method on a grid of 10 to 20 degrees).\n\n--step 4 makes and compares them on a grid of 4 degrees, which is a sixteenth of the disk. gonia's own\ninterpolation then has bins of 4 degrees; the paper's method has those of the session's grid."
)]
pub struct Rivals {
    /// The folder of a measurement
    folder: PathBuf,
    /// Step of the baselines' grid in degrees, a multiple of the session's
    #[arg(long, value_name = "DEG")]
    step: Option<f64>,
    /// Leave out the paper's interpolation, the slowest
    #[arg(long)]
    without_paper: bool,
    /// Cells that the models are fitted to
    #[arg(long, value_name = "N", default_value_t = FitSettings::default().cells)]
    cells: usize,
    /// Random starts of the fits
    #[arg(long, value_name = "N", default_value_t = FitSettings::default().starts)]
    starts: usize,
}

impl Rivals {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if !(100..=1_000_000).contains(&self.cells) || !(1..=10_000).contains(&self.starts) {
            bail!("--cells must lie in 100..=1000000, --starts in 1..=10000");
        }
        let options = BaselineOptions {
            without_paper: self.without_paper,
            fits: FitSettings {
                cells: self.cells,
                starts: self.starts,
                ..FitSettings::default()
            },
        };
        make_and_print(&self.folder, self.step, &options)
    }
}
