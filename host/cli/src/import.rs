//! `gonia import`: other people's measurements.

use crate::progress::Progress;
use crate::say::outln;
use crate::scale::ScaleArgument;
use crate::table::{self, count};
use anyhow::{Context, Result, bail};
use gonia_brdf::{DenseBrdf, Grid, Sample};
use gonia_formats::dense::{
    check_dense_name, is_dense_file, read_dense_channels, write_dense, write_dense_channels,
};
use gonia_formats::foreign::{ForeignBrdf, ForeignContent, ForeignFormat, Gaps, foreign_format};
use gonia_formats::samples::{SampleNote, check_sample_name, write_noted_samples};
use gonia_formats::{FileError, check_output};
use gonia_pipeline::provenance::{Provenance, of_this_program};
use gonia_rig::{DenseFile, Scale};
use std::path::{Path, PathBuf};

/// Brings a material of the UTIA database (.bin), of MERL (.binary, isotropic), of Mitsuba or Zemax (.bsdf) or of
/// Radiance (.xml) onto gonia's grid, so that every other command can compare, fit and draw it; one of Ngan, Durand and
/// Matusik or ALTA (.dat), of Cornell (.astm) or of a pgII (.pab), which has holes, becomes samples for `gonia fill`. gonia's own Zarr becomes OpenEXR.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia import fabric112.bin -o fabric112.exr\n  gonia import velvet.dat -o velvet.npy && gonia fill velvet.npy -o velvet.exr\n\nUTIA's values end at 75 degrees; beyond, the last ring's are repeated. Its files do not say whether they\nare 1/sr, and their readers disagree: they count as relative unless --scale absolute is given. Samples of other formats come\nin as CSV or .npy by `gonia fill`."
)]
pub struct Import {
    /// The material
    material: PathBuf,
    /// The dense BRDF to write (OpenEXR), or for .dat, .astm and .pab the samples (.npy or .csv)
    #[arg(short, long, value_name = "DENSE.exr")]
    output: PathBuf,
    /// Step of the grid in degrees [default: 2]
    #[arg(long, value_name = "DEG")]
    step: Option<f64>,
    /// What the values are, where the format does not say it (UTIA): relative, or absolute (1/sr)
    #[arg(long, value_enum)]
    scale: Option<ScaleArgument>,
}

impl Import {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        if is_dense_file(&self.material)? {
            return self.copy_dense();
        }
        let step = self.step.unwrap_or(2.0);
        let grid = Grid::with_step_deg(step).with_context(|| format!("--step {step}"))?;
        let ForeignFormat { name, content, .. } = foreign_format(&self.material)?;
        match content {
            ForeignContent::Brdf { scale, read } => {
                let scale = self.scale_of(name, *scale)?;
                let model = read(&self.material)?;
                check_dense_name(&self.output)?;
                check_output(&self.output, &[&self.material])?;
                self.import_brdf(grid, name, scale, model.as_ref())
            }
            ForeignContent::Samples { scale, read } => {
                let scale = match (scale, self.scale) {
                    (None, None) => None,
                    (known, _) => Some(self.scale_of(name, *known)?.0),
                };
                check_sample_name(&self.output)?;
                check_output(&self.output, &[&self.material])?;
                self.import_samples(name, scale, *read)
            }
        }
    }

    /// A table on gonia's grid, as Zarr say: as it is, under another name.
    fn copy_dense(&self) -> Result<()> {
        for (option, is_given) in [
            ("--step", self.step.is_some()),
            ("--scale", self.scale.is_some()),
        ] {
            if is_given {
                let material = self.material.display();
                bail!(
                    "{option}: {material} is a dense BRDF already, and says it; leave {option} out"
                );
            }
        }
        check_dense_name(&self.output)?;
        check_output(&self.output, &[&self.material])?;
        let progress = Progress::new();
        let table = progress.stage("reading the table", |_| read_dense_channels(&self.material))?;
        write_dense_channels(&self.output, &table)?;
        table::print(&[
            ("scale".to_owned(), table.scale.to_string()),
            ("written".to_owned(), self.output.display().to_string()),
        ]);
        Ok(())
    }

    /// What the values are, and the row that says so: what the format knows, or else `--scale`.
    fn scale_of(&self, format: &str, known: Option<Scale>) -> Result<(Scale, String)> {
        let said = self.scale.map(Scale::from);
        Ok(match (known, said) {
            (Some(known), Some(said)) if known != said => {
                bail!("--scale {said}: the values of a {format} are {known}; leave --scale out")
            }
            (Some(known), _) => (known, format!("{known}, as the format is")),
            (None, Some(said)) => (said, format!("{said}, by --scale")),
            (None, None) => (
                Scale::Relative,
                format!(
                    "relative: a {format} does not say it, and its readers disagree (--scale absolute, if it is 1/sr)"
                ),
            ),
        })
    }

    fn import_brdf(
        &self,
        grid: Grid,
        format: &str,
        (scale, scale_text): (Scale, String),
        model: &dyn ForeignBrdf,
    ) -> Result<()> {
        let progress = Progress::new();
        let brdf = progress.stage("bringing it onto the grid", |_| {
            anyhow::Ok(DenseBrdf::tabulate(grid, model))
        })?;
        let mut rows = vec![("scale".to_owned(), scale_text)];
        let mut provenance = self.provenance(format);
        if let Some(gaps) = model.gaps() {
            let text = gaps_text(&gaps, grid);
            provenance.insert("not_measured".into(), text.clone());
            rows.push(("not measured".into(), text));
        }
        rows.extend(beyond(grid, model.last_deg()));
        rows.push(("written".into(), self.output.display().to_string()));
        write_dense(
            &self.output,
            DenseFile {
                brdf,
                scale,
                provenance,
            },
        )?;
        table::print(&rows);
        Ok(())
    }

    fn import_samples(
        &self,
        format: &str,
        scale: Option<Scale>,
        read: fn(&Path) -> Result<Vec<Sample>, FileError>,
    ) -> Result<()> {
        let progress = Progress::new();
        let samples = progress.stage("reading the samples", |_| read(&self.material))?;
        let note = SampleNote {
            scale,
            provenance: self.provenance(format),
        };
        write_noted_samples(&self.output, &samples, &note)?;
        outln!(
            "{} directions hold a measurement; gonia fill {} makes them dense",
            count(samples.len() as u64),
            self.output.display()
        );
        Ok(())
    }

    fn provenance(&self, format: &str) -> Provenance {
        let mut provenance = of_this_program();
        provenance.insert(
            "imported".into(),
            format!("{} ({format})", self.material.display()),
        );
        provenance
    }
}

/// How much of the grid lies beyond the last polar angle of a file, as a row.
fn beyond(grid: Grid, last_deg: f64) -> Option<(String, String)> {
    let is_within = |index: &usize| grid.direction(*index).theta_deg() <= last_deg + 1e-6;
    let n = grid.n_directions();
    let within = (0..n).filter(is_within).count();
    let cells = n * n - within * within;
    (cells > 0).then(|| {
        (
            format!("beyond {last_deg} degrees"),
            format!("{} cells of the grid: the value there", count(cells as u64)),
        )
    })
}

/// What a file does not hold, and how much of the grid that is.
fn gaps_text(gaps: &Gaps, grid: Grid) -> String {
    let share = 100.0 * gaps.evaluations as f64 / grid.n_cells() as f64;
    format!(
        "{} of the file's {} values are {}; {} cells of the grid ({share:.2} %) come from them",
        count(gaps.missing),
        count(gaps.of),
        gaps.instead,
        count(gaps.evaluations)
    )
}
