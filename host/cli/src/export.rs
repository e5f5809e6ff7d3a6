//! `gonia export`: dense BRDFs in other people's formats.

use crate::colours::read_colours;
use crate::progress::Progress;
use crate::table::{self, bytes, count};
use anyhow::{Result, bail};
use gonia_formats::check_output;
use gonia_formats::foreign::{ExportSettings, ForeignWriter, export_format};
use gonia_pipeline::export::{ExportError, export};
use std::path::PathBuf;

/// Writes a dense BRDF in the format of another program, and says how far that file is from it.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia export dense.exr -o fabric.bsdf                    for Mitsuba's 'measured'\n  gonia export dense.exr -o fabric.xml --format tensortree  for Radiance\n\nThe file is read back and compared with the table at random directions: median, 99th percentile and RMS of\n|ln| of their ratio. Formats mean 1/sr; of a relative BRDF say by what factor it becomes so."
)]
pub struct Export {
    /// The dense BRDF
    dense: PathBuf,
    /// The file to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// The format, where the ending does not tell it
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// How finely: what it counts depends on the format
    #[arg(long, value_name = "N")]
    resolution: Option<usize>,
    /// Take a relative BRDF for 1/sr after multiplying it by this factor
    #[arg(long, value_name = "FACTOR")]
    assume_scale: Option<f64>,
}

impl Export {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let (format, writer) = export_format(&self.output, self.format.as_deref())?;
        let settings = self.settings(writer)?;
        if let Some(factor) = self.assume_scale
            && !(factor > 0.0 && factor.is_finite())
        {
            bail!("--assume-scale {factor}: give a factor above 0");
        }
        check_output(&self.output, &[&self.dense])?;
        let progress = Progress::new();
        let dense = progress.stage("reading the dense BRDF", |_| read_colours(&self.dense))?;
        let grid = dense.brdf.grid();
        let last_deg = (grid.n_theta() - 1) as f64 * grid.step_deg();
        let error = progress.stage("writing and reading back", |_| {
            export(
                dense,
                &self.output,
                (format, writer),
                &settings,
                self.assume_scale,
            )
        })?;
        let mut rows = vec![("format".to_owned(), format.name.to_owned())];
        if let Some(resolution) = &writer.resolution {
            let text = format!("{} {}", settings.resolution, resolution.of);
            rows.push(("resolution".into(), text));
        }
        rows.push(("against the table".into(), text_of(&error)));
        if last_deg < 90.0 {
            let text = format!("the value there ({last_deg} degrees is the table's last)");
            rows.push((format!("beyond {last_deg} degrees"), text));
        }
        let size = std::fs::metadata(&self.output).map_or(0, |file| file.len());
        let text = format!("{}, {}", self.output.display(), bytes(size));
        rows.push(("written".into(), text));
        table::print(&rows);
        Ok(())
    }

    fn settings(&self, writer: &ForeignWriter) -> Result<ExportSettings> {
        let resolution = match (self.resolution, &writer.resolution) {
            (Some(n), Some(r)) if (r.least..=r.most).contains(&n) => n,
            (Some(n), Some(r)) => {
                bail!("--resolution {n}: give {} to {} {}", r.least, r.most, r.of)
            }
            (Some(n), None) => bail!(
                "--resolution {n}: a file of the format {} has one size; leave it out",
                writer.name
            ),
            (None, resolution) => resolution.as_ref().map_or(0, |r| r.default),
        };
        Ok(ExportSettings { resolution })
    }
}

/// How far the file is from the table.
fn text_of(error: &ExportError) -> String {
    let mut text = format!(
        "|ln| median {:.4}, p99 {:.4}, RMS {:.4} of {} pairs of directions",
        error.median,
        error.p99,
        error.rms,
        count(error.tests as u64)
    );
    if error.lost > 0 {
        text += &format!("; {} have no value in the file", count(error.lost as u64));
    }
    text
}
