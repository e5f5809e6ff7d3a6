//! `gonia chart`: what accuracy costs, of interpolation or of the arms.

use crate::progress::Progress;
use crate::remarks;
use crate::say::outln;
use crate::{chart_motion, table};
use anyhow::{Context, Result, bail};
use gonia_brdf::{Bins, Grid, Sample};
use gonia_formats::dense::read_dense;
use gonia_formats::samples::read_samples;
use gonia_formats::{check_writable, write_whole_bytes};
use gonia_pipeline::chart;
use gonia_pipeline::chart::{
    ChartPoint, FrameSubset, Method, Split, TestCounts, TestSet, front, standard, to_csv,
};
use gonia_report::frontier;
use gonia_rig::Stratum;
use std::path::{Path, PathBuf};

/// Charts what accuracy costs. Of SAMPLES: core-seconds of a full fill against error, method by
/// method and by stratum, with the Pareto front; then error against the number of images (methods
/// and images, .svg and .csv). With --motion: session time against pointing error of the simulated
/// arms, one setting changed at a time (motion.svg, motion.csv, jerk.csv), and the speed over arms built
/// otherwise (arms.csv).
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia chart samples.npy --truth truth.exr --out chart\n  gonia chart --motion --out chart\n\nWithout --truth the error is that at whole frames left out (with their reciprocal ones), which\nneeds samples with frame numbers, and holds the noise of the samples too.\n\nCosts are CPU seconds. Methods that work cell by cell are timed on the cells of the tests alone;\nthe share is in the CSV."
)]
pub struct Chart {
    /// Samples, .npy, .npz or .csv
    #[arg(required_unless_present = "motion", conflicts_with = "motion")]
    samples: Option<PathBuf>,
    /// Chart the arms instead: session time against pointing error
    #[arg(long)]
    motion: bool,
    /// Seed of the simulated arms
    #[arg(long, default_value_t = 1, requires = "motion")]
    seed: u64,
    /// The true BRDF (OpenEXR), as `gonia demo` writes it
    #[arg(long, value_name = "DENSE.exr")]
    truth: Option<PathBuf>,
    /// Folder for the charts
    #[arg(long, value_name = "DIR", default_value = "chart")]
    out: PathBuf,
    /// Step of the grid in degrees
    #[arg(long, default_value_t = 2.0, value_name = "DEG")]
    step: f64,
    /// Cells (or bins left out) that are tested
    #[arg(long, default_value_t = 2000, value_name = "N")]
    tests: usize,
    /// Chart this method instead of the standard ones; again for more. Names are as in methods.csv
    #[arg(long = "method", value_name = "NAME")]
    methods: Vec<Method>,
    /// Leave out one of the two charts
    #[arg(long, value_enum, value_name = "CHART")]
    only: Option<Only>,
}

#[derive(clap::ValueEnum, Clone, Copy, PartialEq)]
enum Only {
    Methods,
    Images,
}

impl Chart {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let Some(path) = &self.samples else {
            return chart_motion::draw(&self.out, self.seed);
        };
        let grid =
            Grid::with_step_deg(self.step).with_context(|| format!("--step {}", self.step))?;
        if !(100..=1_000_000).contains(&self.tests) {
            bail!("--tests {}: must lie in 100..=1000000", self.tests);
        }
        check_writable(&self.out)?;
        let progress = Progress::new();
        let read = progress.stage("reading samples", |_| read_samples(path))?;
        remarks::print(&read.remarks);
        let (samples, tests) = self
            .test_set(read.samples, grid, &progress)
            .with_context(|| path.display().to_string())?;
        outln!("compared with {}", tests.basis());
        if self.only != Some(Only::Images) {
            let bins = Bins::new(grid, &samples);
            let frames = FrameSubset::all_of(&samples)[0].frames();
            let compared = self.compared(grid);
            let points = progress.stage("measuring methods", |tell| {
                chart::methods(&bins, frames, &compared, &tests, tell)
            })?;
            print_points(&points);
            let title = title(path, "error against cost");
            self.write(
                "methods",
                &points,
                &frontier::methods(&points, &title, tests.basis()),
            )?;
        }
        if self.only != Some(Only::Methods) {
            let compared = [Method::default_of(grid), Method::paper()];
            let points = progress.stage("measuring fewer images", |tell| {
                chart::images(&FrameSubset::all_of(&samples), &compared, &tests, tell)
            })?;
            print_points(&points);
            let title = title(path, "error against images");
            self.write(
                "images",
                &points,
                &frontier::images(&points, &title, tests.basis()),
            )?;
        }
        Ok(())
    }

    /// The samples to interpolate, and what they are compared with.
    fn test_set(
        &self,
        samples: Vec<Sample>,
        grid: Grid,
        progress: &Progress,
    ) -> Result<(Vec<Sample>, TestSet)> {
        let counts = TestCounts {
            spread: self.tests,
            highlights: self.tests / 4,
        };
        if let Some(path) = &self.truth {
            let truth = progress.stage("reading the truth", |_| read_dense(path))?;
            let bins = Bins::new(grid, &samples);
            let tests = TestSet::of_truth(&truth, &bins, counts)
                .with_context(|| path.display().to_string())?;
            return Ok((samples, tests));
        }
        let held = Split::new(samples)?;
        let tests = TestSet::of_validation(&Bins::new(grid, &held.tests), counts)?;
        Ok((held.training, tests))
    }

    fn compared(&self, grid: Grid) -> Vec<Method> {
        if self.methods.is_empty() {
            return standard(grid);
        }
        self.methods.clone()
    }

    fn write(&self, name: &str, points: &[ChartPoint], svg: &str) -> Result<()> {
        let file = |extension| self.out.join(name).with_extension(extension);
        write_whole_bytes(&file("svg"), svg.as_bytes())?;
        write_whole_bytes(&file("csv"), to_csv(points).as_bytes())?;
        outln!("written    {} and .csv", file("svg").display());
        Ok(())
    }
}

fn title(path: &Path, what: &str) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    format!("{name}: {what}")
}

/// The main figures, cheapest first; a star marks the Pareto front over all cells.
fn print_points(points: &[ChartPoint]) {
    let of = |point: &ChartPoint, stratum| {
        let row = point.strata.iter().find(|row| row.stratum == stratum);
        row.copied()
    };
    let front = front(points, |p| of(p, Stratum::All).map(|row| row.log_rms));
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|a, b| points[*a].core_s.total_cmp(&points[*b].core_s));
    outln!(
        "{:<52} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>7} {:>9}",
        "method",
        "core-s",
        "all",
        "interior",
        "grazing",
        "highl.",
        "cos",
        "sphere",
        "share"
    );
    for k in order {
        let point = &points[k];
        let log = |stratum| match of(point, stratum) {
            Some(row) => format!("{:.4}", row.log_rms),
            None => "–".into(),
        };
        let cos = of(point, Stratum::All).map_or(f64::NAN, |row| row.cos_error_mean);
        outln!(
            "{} {:<50} {:>9.1} {:>8} {:>8} {:>8} {:>8} {:>7.2}% {:>7} {:>9.1e}",
            if front.contains(&k) { "*" } else { " " },
            point.name,
            point.core_s,
            log(Stratum::All),
            log(Stratum::Interior),
            log(Stratum::Grazing),
            log(Stratum::Highlight),
            100.0 * cos,
            point
                .sphere_delta_e
                .map_or("–".into(), |e| format!("{e:.2}")),
            point.share,
        );
        if point.failed > 0.0 {
            let failed = (point.failed * 1e4).round() as u64;
            outln!("  failed in {} of 10,000 cells", table::count(failed));
        }
    }
}
