//! `gonia demo`: a whole measurement on the simulated rig. The arms' controllers run the real
//! firmware core behind the real wire, in virtual time; every frame goes through the real chain.

mod bands;
mod rig;
mod session;
mod summary;

use crate::account;
use crate::progress::Progress;
use crate::remarks;
use anyhow::{Context, Result, bail};
use gonia_acquire::camera::SimulatedFrames;
use gonia_acquire::capture::travelling;
use gonia_brdf::model::Material;
use gonia_brdf::{DenseBrdf, Pose};
use gonia_formats::dense::{
    ChannelErrors, CombineErrors, ERRORS_OF, write_dense, write_dense_channels, write_error_bars,
};
use gonia_formats::frames_csv::write_frames_csv;
use gonia_formats::plan_csv::write_plan_csv;
use gonia_formats::rig_toml::write_rig;
use gonia_formats::samples::{write_noted_channels, write_noted_samples};
use gonia_formats::{Summary, cell_mask, check_writable, checksum};
use gonia_pipeline::budget::{
    CellBudget, Holding, UNCERTAINTIES, budget_of, combine_errors, coverage,
};
use gonia_pipeline::process::{FrameSource, Masks, Processed};
use gonia_pipeline::provenance::{Provenance, of_this_program};
use gonia_pipeline::{
    FillOptions, Options, Side, Table, calibrate, compare, compare_bands, fill, samples_of,
};
use gonia_plan::Rings;
use gonia_render::Tabulated;
use gonia_report::files::{DENSE, ERRORS, MEASURED, REPORT, SUMMARY, TRUTH};
use gonia_report::{ErrorBars, ReportInput, write_report, write_sphere};
use gonia_rig::{Budget, CellMask, DenseFile, Rig, Role, Scale};
use rig::DemoRig;
use session::{Lab, Session};
use std::path::PathBuf;
use std::time::Instant;

/// The rig's drawing; `rig.toml` is what the calibration found.
const NOMINAL: &str = "nominal.toml";

/// Samples of bands, their dense BRDF and the true one.
const BAND_SAMPLES: &str = "bands.npy";
const BAND_DENSE: &str = "bands.exr";
const BAND_TRUTH: &str = "bands-truth.exr";

/// Measures a material of known BRDF, by default a two-thread fabric, on the simulated rig.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia demo --quick\n  gonia demo --material silk --out silk --frame-px 600\n\nThe whole plan has 8505 poses of the material and as many of the reference, and takes minutes and 3.6 GB of disk;\n--quick has 925, a grid of 4 degrees, and keeps its frames, so that `gonia process` can be tried\non them."
)]
pub struct Demo {
    /// Fewer poses and a coarser grid, in less than a minute
    #[arg(long)]
    quick: bool,
    /// Folder for all that is written
    #[arg(long, value_name = "DIR", default_value = "gonia-demo")]
    out: PathBuf,
    /// What is measured: fabric, white, lambert, brushed-metal, satin-paint, or a cloth of the
    /// microcylinder model: linen, silk, satin, shot-silk
    #[arg(long, value_name = "NAME", default_value = "fabric", value_parser = Material::NAMES)]
    material: String,
    /// Side of a frame in pixels [default: 400, quick: 240]
    #[arg(long, value_name = "PX")]
    frame_px: Option<usize>,
    /// Keep the frames as a capture folder (the whole plan's take 16 GB)
    #[arg(long)]
    keep_frames: bool,
    /// A rig without a flaw, of which nothing need be found out: for tests of other things
    #[arg(long)]
    ideal_rig: bool,
    /// Also measure so many bands from 400 to 700 nm, each a mixture of the camera's channels (31: every 10 nm)
    #[arg(long, value_name = "N")]
    bands: Option<usize>,
    /// Seed of all that is random in the simulation
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl Demo {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let began = Instant::now();
        let (rings, step, frame_px) = if self.quick {
            (Rings::quick(), 4.0, 240)
        } else {
            (Rings::paper(), 2.0, 400)
        };
        let frame_px = self.frame_px.unwrap_or(frame_px);
        if !(100..=8192).contains(&frame_px) {
            bail!("--frame-px {frame_px}: must lie in 100..=8192");
        }
        if let Some(bands) = self.bands
            && !(1..=301).contains(&bands)
        {
            bail!("--bands {bands}: must lie in 1..=301");
        }
        check_writable(&self.out)?;
        let run = Run {
            material: Material::named(&self.material).context("--material")?,
            rig: DemoRig::new(frame_px, self.ideal_rig),
            poses: travelling(&rings).poses,
            progress: Progress::new(),
            demo: self,
        };
        let measured = run.measure()?;
        remarks::print(&measured.processed.remarks);
        let mut rows = measured.rig_rows.clone();
        rows.extend(account::describe(&measured.processed));
        if let Some(bands) = run.demo.bands {
            rows.extend(run.measure_bands(bands, step, &measured)?);
        }
        let (session, rig) = (measured.session, measured.rig);
        let mut filled = run.fill(step, &session, &rig, measured.processed)?;
        rows.extend(filled.coverage.take());
        run.write_truth(&filled.dense, &mut filled.summary)?;
        run.draw(&mut filled, &rig)?;
        let seconds = began.elapsed().as_secs_f64();
        summary::print(&filled.summary, &session, &rows, seconds);
        Ok(())
    }
}

/// What was measured, and with what rig.
struct Measured {
    session: Session,
    /// As it was calibrated.
    rig: Rig,
    /// What the calibration brought, for the table.
    rig_rows: Vec<(String, String)>,
    processed: Processed,
}

/// What became of the samples.
struct FilledDemo {
    summary: Summary,
    dense: DenseFile,
    /// The cells that hold a measurement.
    measured: CellMask,
    /// The standard errors, where they were computed …
    bars: Option<ErrorBars>,
    /// … and how often they are true, for the table.
    coverage: Option<Row>,
}

/// A row of the table at the demo's end: a name, and what is said of it.
type Row = (String, String);

/// A demo under way.
struct Run {
    demo: Demo,
    material: Material,
    rig: DemoRig,
    poses: Vec<Pose>,
    progress: Progress,
}

impl Run {
    fn path(&self, name: &str) -> PathBuf {
        self.demo.out.join(name)
    }

    /// What was simulated.
    fn facts(&self) -> Provenance {
        Provenance::from([
            ("material".to_owned(), self.material.name.to_owned()),
            ("seed".into(), self.demo.seed.to_string()),
            (
                "rig".into(),
                format!(
                    "simulated, frames of {} px",
                    self.rig.nominal.camera.width_px
                ),
            ),
            ("plan".into(), format!("{} poses", self.poses.len())),
        ])
    }

    /// Moves the arms through the plan, calibrates the rig, and makes samples of the frames.
    fn measure(&self) -> Result<Measured> {
        write_rig(&self.path(NOMINAL), &self.rig.nominal)?;
        write_plan_csv(&self.path("plan.csv"), &self.poses)?;
        let keep_frames = self.demo.keep_frames || self.demo.quick;
        let material = self.material.brdf.clone();
        let mut camera = SimulatedFrames::new(self.rig.scene(material, self.demo.seed));
        if keep_frames {
            camera.keep_frames(&self.demo.out)?;
        }
        let mut lab = self
            .progress
            .stage("calibrating encoders", |_| Lab::open(self.demo.seed))?;
        let rig = self.calibrated_rig(&mut lab)?;
        write_rig(&self.path("rig.toml"), &rig)?;
        let session = self.progress.stage("moving and triggering", |tell| {
            lab.measure(&self.poses, &mut camera, tell)
        })?;
        if keep_frames {
            write_frames_csv(&self.path("frames.csv"), camera.rows())?;
        }
        let masks = Masks::default();
        let processed = samples_of(&rig, &camera, &masks, &self.progress.watch())?;
        let note = processed.note(&rig, self.facts());
        self.progress.stage("writing samples", |_| {
            write_noted_samples(&self.path("samples.npy"), &processed.samples, &note)
        })?;
        Ok(Measured {
            rig_rows: self.rig_rows(&rig, &camera, &processed),
            session,
            rig,
            processed,
        })
    }

    /// The rig as frames of a white tile show it.
    fn calibrated_rig(&self, lab: &mut Lab) -> Result<Rig> {
        if self.rig.is_ideal() {
            return Ok(self.rig.nominal.clone());
        }
        let mut frames = SimulatedFrames::new(self.rig.scene_of_tile(self.demo.seed));
        let poses = DemoRig::calibration_poses(&self.poses);
        self.progress.stage("moving over a white tile", |tell| {
            let mut session = Session::default();
            lab.expose(Role::Reference, &poses, &mut frames, &mut session, tell)
        })?;
        let found = calibrate(&self.rig.with_tile(), &frames, &self.progress.watch())?;
        remarks::print(&found.remarks);
        let mut rig = found.rig;
        // The session's reference is another one.
        rig.reference = None;
        if let Some(calibration) = &mut rig.calibration {
            // No date of ours: the same demo leaves the same bytes.
            calibration.date = "simulated".to_owned();
        }
        Ok(rig)
    }

    /// What the calibration brought.
    fn rig_rows(
        &self,
        rig: &Rig,
        camera: &SimulatedFrames,
        processed: &Processed,
    ) -> Vec<(String, String)> {
        let before = self.rig.errors_by_drawing(camera);
        let after = self.rig.errors_of(rig, camera, &processed.frames);
        let (Some(before), Some(after)) = (before, after) else {
            return Vec::new();
        };
        let text = format!(
            "light {:.3} before calibration, {:.3} after; view {:.3} before, {:.3} after (degrees, 95 % of directions)",
            before.light_deg, after.light_deg, before.view_deg, after.view_deg
        );
        vec![("rig: direction error".to_owned(), text)]
    }

    /// Interpolates the samples, and writes the dense BRDF, which cells were measured and the standard errors.
    fn fill(
        &self,
        step_deg: f64,
        session: &Session,
        rig: &Rig,
        processed: Processed,
    ) -> Result<FilledDemo> {
        let mut summary = summary::start(self.material.what, session, &processed, self.poses.len());
        let options = FillOptions {
            with_errors: true,
            ..FillOptions::with_step_deg(step_deg)
        };
        let scale = processed.scale();
        let budget = budget_of(rig, processed.calibration, &processed.samples);
        let mut filled = fill(processed.samples, scale, &options, &self.progress.watch())?;
        let account = &filled.account;
        remarks::print(&account.remarks);
        let cells = filled.cells.iter().map(|cell| *cell as usize);
        let measured = CellMask::from_cells(filled.dense.grid, cells);
        cell_mask::write_mask(&self.path(MEASURED), &measured)?;
        summary::count_cells(&mut summary, account.counts.binned as u64, &measured);
        let errors = filled.errors.take();
        let mut file = filled.into_rgb()?;
        file.provenance.extend(self.facts());
        summary.provenance = file.provenance.clone();
        let (bars, coverage) = match errors {
            Some(errors) => self.write_errors(&file, errors, &budget)?,
            None => (None, None),
        };
        let dense = self.progress.stage("writing the dense BRDF", |_| {
            write_dense(&self.path(DENSE), file)
        })?;
        summary.dense = Some(checksum::of_brdf(&dense.brdf));
        Ok(FilledDemo {
            summary,
            dense,
            measured,
            bars,
            coverage,
        })
    }

    /// Writes the standard errors, combined with the rig's, and finds how often they are true.
    fn write_errors(
        &self,
        dense: &DenseFile,
        errors: ChannelErrors,
        budget: &Budget,
    ) -> Result<(Option<ErrorBars>, Option<Row>)> {
        const GREEN: usize = 1;
        let (grid, planes) = (dense.brdf.grid(), dense.brdf.planes());
        let truth = self.material.brdf.as_ref();
        let noise = (&errors.standard_error[GREEN][..], Holding::Noise);
        let coverage = CellBudget::new(grid, &planes[GREEN], noise, &errors.origin, budget)
            .map(|cells| {
                coverage(&cells, dense.scale, |light, view| {
                    truth.eval(light.to_vec3(), view.to_vec3())[GREEN]
                })
            })
            .map(|parts| {
                let text = |(part, share): &(_, f64)| format!("{part} {:.1} %", 100.0 * share);
                let parts: Vec<String> = parts.iter().map(text).collect();
                ("true values within U (k = 2)".to_owned(), parts.join(", "))
            });
        let mut facts = dense.provenance.clone();
        facts.insert(ERRORS_OF.to_owned(), checksum::of_brdf(&dense.brdf));
        facts.insert(UNCERTAINTIES.to_owned(), budget.to_string());
        let path = self.path(ERRORS);
        let combine = combine_errors(grid, planes, &errors.origin, budget);
        let combine = combine.as_ref().map(|of| of as &CombineErrors<'_>);
        self.progress.stage("writing the error bars", |_| {
            write_error_bars(&path, grid, errors, combine, dense.scale, &facts)
        })?;
        Ok((ErrorBars::read(&path, None)?, coverage))
    }

    /// The samples in bands, their dense BRDF, the true one, and how far these are apart.
    fn measure_bands(
        &self,
        bands: usize,
        step_deg: f64,
        measured: &Measured,
    ) -> Result<Vec<(String, String)>> {
        let processed = &measured.processed;
        let wavelengths = bands::wavelengths(bands);
        let samples = bands::samples(&processed.samples, &wavelengths);
        let note = processed.note(&measured.rig, self.facts());
        self.progress.stage("writing samples of bands", |_| {
            write_noted_channels(&self.path(BAND_SAMPLES), &samples, &note)
        })?;
        let options = FillOptions::with_step_deg(step_deg);
        if !options.fits_memory(&samples.channels)? {
            let command = format!("gonia fill {BAND_SAMPLES} -o {BAND_DENSE}");
            return Ok(vec![("bands: to be filled by".to_owned(), command)]);
        }
        let filled = fill(samples, processed.scale(), &options, &self.progress.watch())?;
        remarks::print(&filled.account.remarks);
        let mut dense = filled.dense;
        dense.provenance.extend(self.facts());
        let truth = bands::truth(dense.grid, self.material.brdf.as_ref(), &wavelengths);
        self.progress.stage("writing bands", |_| {
            write_dense_channels(&self.path(BAND_DENSE), &dense)?;
            write_dense_channels(&self.path(BAND_TRUTH), &truth)
        })?;
        let figures = compare_bands(&dense, &truth).map(|figures| figures.to_string());
        let text = figures.unwrap_or_else(|| "not comparable".to_owned());
        Ok(vec![(dense.channels.to_string(), text)])
    }

    /// Compares the dense BRDF with the material's true one, and writes that too.
    fn write_truth(&self, dense: &DenseFile, summary: &mut Summary) -> Result<()> {
        let truth = self.material.brdf.as_ref();
        summary.figures = Some(self.progress.stage("measuring the error", |_| {
            compare(Table::from(dense), Side::Model(truth), &Options::default())
        })?);
        self.progress.stage("writing the truth", |_| {
            write_dense(
                &self.path(TRUTH),
                DenseFile {
                    brdf: DenseBrdf::tabulate(dense.brdf.grid(), truth),
                    scale: Scale::Absolute,
                    provenance: of_this_program(),
                },
            )
        })?;
        Ok(())
    }

    /// Draws the report and writes the summary.
    fn draw(&self, filled: &mut FilledDemo, rig: &Rig) -> Result<()> {
        let FilledDemo {
            summary,
            dense,
            measured,
            bars,
            ..
        } = filled;
        let note = |summary: &mut Summary| {
            summary.stages = self.progress.stages();
            summary::list_files(summary, &self.demo.out);
        };
        note(summary);
        self.progress.stage("drawing the report", |_| {
            let sphere = Tabulated::new(&dense.brdf);
            write_sphere(&self.path("sphere.png"), &sphere, 512)?;
            write_report(
                &self.path(REPORT),
                &ReportInput {
                    truth: Some(self.material.brdf.as_ref()),
                    measured: Some(measured),
                    errors: bars.as_ref(),
                    rig: Some(rig),
                    ..ReportInput::new(summary, &dense.brdf)
                },
            )
        })?;
        note(summary);
        summary.write(&self.path(SUMMARY))?;
        Ok(())
    }
}
