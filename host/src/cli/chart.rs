//! `gonia chart`: what accuracy costs.

use super::chart_motion;
use anyhow::{Result, bail};
use std::path::PathBuf;

/// Draws what accuracy costs, as SVG and CSV.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia chart --motion --out charts\n\n--motion lets the simulated arms run part of the paper's plan with one setting changed at a time."
)]
pub struct Chart {
    /// The arms: session time against pointing error
    #[arg(long)]
    motion: bool,
    /// Folder for the charts
    #[arg(long, value_name = "DIR", default_value = "gonia-chart")]
    out: PathBuf,
    /// Seed of the simulation
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl Chart {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if !self.motion {
            bail!("nothing to draw: say --motion");
        }
        chart_motion::draw(&self.out, self.seed)
    }
}
