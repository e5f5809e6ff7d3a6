//! `gonia export`: dense BRDFs in other people's formats.

use crate::progress::Progress;
use crate::remarks;
use crate::sample_facts::is_samples;
use crate::say::outln;
use crate::table::{self, bytes, count};
use anyhow::{Result, bail};
use gonia_formats::check_output;
use gonia_formats::checksum::of_channels;
use gonia_formats::dense::{ERRORS_OF, read_dense_channels};
use gonia_formats::export::{ExportFormat, check_new_folder, export_format, export_table};
use gonia_formats::samples::read_channels;
use gonia_pipeline::export::{ExportError, ExportSource, Places, export};
use gonia_pipeline::export_samples::{SamplesExport, export_samples};
use gonia_rig::{DenseChannels, Scale};
use std::path::{Path, PathBuf};

/// Writes a dense BRDF in the format of another program, and says how far that file is from it; or samples in BiRD's.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia export dense.exr -o fabric.bsdf                      for Mitsuba's 'measured'\n  gonia export dense.exr -o fabric.xml --format tensortree4  for Radiance\n  gonia export --list-formats                                what there is\n  gonia export samples.npy -o fabric.json --dense dense.exr  samples with uncertainties, as BiRD's JSON\n\nThe file is read back and compared with the table: median, 99th percentile and RMS of |ln| of their ratio, at\nrandom directions, or at the file's own where its readers agree on nothing else. Most formats mean 1/sr; of a\nrelative BRDF say by what factor it becomes so."
)]
pub struct Export {
    /// The dense BRDF, or samples
    #[arg(required_unless_present = "list_formats", value_name = "DENSE")]
    source: Option<PathBuf>,
    /// The file to write
    #[arg(
        short,
        long,
        value_name = "FILE",
        required_unless_present = "list_formats"
    )]
    output: Option<PathBuf>,
    /// The format, where the ending does not tell it
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// How finely: what it counts depends on the format
    #[arg(long, value_name = "N")]
    resolution: Option<usize>,
    /// Take a relative BRDF for 1/sr after multiplying it by this factor
    #[arg(long, value_name = "FACTOR")]
    assume_scale: Option<f64>,
    /// Export a grid that is too coarse for the format, with a warning
    #[arg(long)]
    allow_coarse: bool,
    /// Error bars, as gonia fill --error wrote them, for formats that hold them
    #[arg(long, value_name = "ERR.exr")]
    error: Option<PathBuf>,
    /// Of samples: the dense BRDF that was filled from them, whose slopes say what the uncertainty of directions comes to
    #[arg(long, value_name = "DENSE.exr")]
    dense: Option<PathBuf>,
    /// Print the formats, a row each, and end
    #[arg(long)]
    list_formats: bool,
}

/// The format that holds samples.
const BIRD: &str = "bird";

impl Export {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let (false, Some(dense), Some(output)) = (self.list_formats, &self.source, &self.output)
        else {
            for row in export_table() {
                outln!("{}", row.join("\t").replace('`', ""));
            }
            return Ok(());
        };
        let format = export_format(output, self.format.as_deref())?;
        if let Some(factor) = self.assume_scale
            && !(factor > 0.0 && factor.is_finite())
        {
            bail!("--assume-scale {factor}: give a factor above 0");
        }
        if is_samples(dense) {
            return self.samples(dense, output, format);
        }
        if let Some(of_samples) = &self.dense {
            bail!(
                "--dense {}: goes with samples, and {} is a dense BRDF; leave it out",
                of_samples.display(),
                dense.display()
            );
        }
        let resolution = self.resolution(format)?;
        if format.is_folder {
            check_new_folder(output)?;
        } else {
            let inputs: Vec<&Path> = [Some(dense), self.error.as_ref()]
                .into_iter()
                .flatten()
                .map(PathBuf::as_path)
                .collect();
            check_output(output, &inputs)?;
        }
        let progress = Progress::new();
        let source = progress.stage("reading the dense BRDF", |_| self.source(dense))?;
        let grid = source.dense.grid;
        let last_deg = (grid.n_theta() - 1) as f64 * grid.step_deg();
        let (error, said) = progress.stage("writing and reading back", |_| {
            export(source, output, format, resolution)
        })?;
        remarks::print(&said);
        let mut rows = vec![("format".to_owned(), format.title.to_owned())];
        if let Some(chosen) = &format.resolution {
            let text = format!("{resolution} {}", chosen.of);
            rows.push(("resolution".into(), text));
        }
        rows.push(("against the table".into(), text_of(&error)));
        if last_deg < 90.0 {
            let text = match error.places {
                Places::Anywhere => "the value there",
                Places::OfTheFile => "nothing",
            };
            let text = format!("{text} ({last_deg} degrees is the table's last)");
            rows.push((format!("beyond {last_deg} degrees"), text));
        }
        let text = format
            .provenance
            .unwrap_or("lost: the format has no place for it");
        rows.push(("provenance".into(), text.into()));
        let text = format!("{}, {}", output.display(), bytes(size_of(output)));
        rows.push(("written".into(), text));
        table::print(&rows);
        Ok(())
    }

    /// Samples, which one format holds.
    fn samples(&self, of: &Path, output: &Path, format: &ExportFormat) -> Result<()> {
        if format.name != BIRD {
            bail!(
                "{}: {} does not hold samples; name it .json (BiRD), or export the dense BRDF that is filled from them (gonia fill)",
                output.display(),
                format.title
            );
        }
        let dense_only = [
            ("--error", self.error.is_some()),
            ("--resolution", self.resolution.is_some()),
            ("--allow-coarse", self.allow_coarse),
        ];
        if let Some((option, _)) = dense_only.iter().find(|(_, is_given)| *is_given) {
            bail!(
                "{option}: goes with a dense BRDF, and {} are samples; leave it out",
                of.display()
            );
        }
        let inputs: Vec<&Path> = [Some(of), self.dense.as_deref()]
            .into_iter()
            .flatten()
            .collect();
        check_output(output, &inputs)?;
        let progress = Progress::new();
        let (read, dense) = progress.stage("reading", |_| {
            let dense = self.dense.as_deref().map(read_dense_channels).transpose()?;
            Ok::<_, gonia_formats::FileError>((read_channels(of)?, dense))
        })?;
        remarks::print(&read.remarks);
        let count_of_samples = read.values.len();
        let source = SamplesExport {
            samples: read.values,
            scale: read.scale.unwrap_or(Scale::Relative),
            provenance: read.provenance,
            path: of,
            dense: dense.as_ref(),
            scale_by: self.assume_scale,
        };
        let exported = progress.stage("writing", |_| export_samples(source, output))?;
        remarks::print(&exported.remarks);
        let u = if exported.with_uncertainties {
            "the combined standard uncertainty of each value (k = 1)"
        } else {
            "none: nothing is known of them"
        };
        table::print(&[
            ("format".into(), format.title.to_owned()),
            ("samples".into(), count(count_of_samples as u64)),
            ("values".into(), count(exported.values as u64)),
            ("uncertainties".into(), u.into()),
            (
                "written".into(),
                format!("{}, {}", output.display(), bytes(size_of(output))),
            ),
        ]);
        Ok(())
    }

    fn source<'a>(&self, path: &'a Path) -> Result<ExportSource<'a>> {
        let dense = read_dense_channels(path)?;
        let errors = self.error.as_deref().map(|errors| {
            let read = read_dense_channels(errors)?;
            if fits(&dense, &read) {
                return Ok(read);
            }
            bail!(
                "--error {}: belongs to another table than {} (grid, channels, scale or checksum differ); give the error bars that were written with it",
                errors.display(),
                path.display()
            )
        });
        Ok(ExportSource {
            errors: errors.transpose()?,
            dense,
            path,
            scale_by: self.assume_scale,
            allow_coarse: self.allow_coarse,
        })
    }

    fn resolution(&self, format: &ExportFormat) -> Result<usize> {
        Ok(match (self.resolution, &format.resolution) {
            (Some(n), Some(r)) if (r.least..=r.most).contains(&n) => n,
            (Some(n), Some(r)) => {
                bail!("--resolution {n}: give {} to {} {}", r.least, r.most, r.of)
            }
            (Some(n), None) => bail!(
                "--resolution {n}: a file of the format {} has one size; leave it out",
                format.name
            ),
            (None, resolution) => resolution.as_ref().map_or(0, |r| r.default),
        })
    }
}

/// Whether error bars are those of a table: of its grid, channels and scale, and of its checksum where they hold one.
fn fits(dense: &DenseChannels, errors: &DenseChannels) -> bool {
    let of = errors.provenance.get(ERRORS_OF);
    dense.grid == errors.grid
        && dense.channels == errors.channels
        && dense.scale == errors.scale
        && of.is_none_or(|of| *of == of_channels(dense))
}

/// Bytes of a file, or of all files in a folder.
fn size_of(path: &Path) -> u64 {
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flatten().map(|entry| size_of(&entry.path())).sum(),
        Err(_) => std::fs::metadata(path).map_or(0, |file| file.len()),
    }
}

/// How far the file is from the table.
fn text_of(error: &ExportError) -> String {
    let places = match error.places {
        Places::Anywhere => "pairs of directions",
        Places::OfTheFile => "values, at the file's own directions",
    };
    let mut text = format!(
        "|ln| median {:.4}, p99 {:.4}, RMS {:.4} of {} {places}",
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
