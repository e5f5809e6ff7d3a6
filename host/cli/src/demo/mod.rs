//! `gonia demo`: a whole measurement on the simulated rig. The arms' controllers run the real
//! firmware core behind the real wire, in virtual time; every frame goes through the real chain.

mod session;
mod summary;

use crate::fill::{How, PresetArgument, fill};
use crate::plan::travelling;
use crate::progress::Progress;
use crate::{fill, process};
use anyhow::{Context, Result, bail};
use gonia_acquire::camera::SimulatedFrames;
use gonia_brdf::DenseBrdf;
use gonia_brdf::model::{Kurt, Material};
use gonia_formats::dense_exr::write_dense;
use gonia_formats::frames_csv::write_frames_csv;
use gonia_formats::plan_csv::write_plan_csv;
use gonia_formats::rig_toml::write_rig;
use gonia_formats::samples::write_samples;
use gonia_formats::{cell_mask, check_writable};
use gonia_pipeline as evaluate;
use gonia_pipeline::compare::Table;
use gonia_pipeline::process::FrameSource;
use gonia_pipeline::{Options, Side};
use gonia_plan::Rings;
use gonia_render::Tabulated;
use gonia_report::folder::{DENSE, MEASURED, REPORT, SUMMARY, TRUTH};
use gonia_report::{ReportInput, write_report, write_sphere};
use gonia_rig::{CellMask, DenseFile, Rig, Scale};
use gonia_sim::scene::{Scene, SceneGeometry};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Measures a material of known BRDF, a two-thread fabric unless told, on the simulated rig.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia demo --quick\n  gonia demo --material silk --out silk --frame-px 600\n\nThe whole plan has 8505 poses of the material and as many of the reference, and takes minutes;\n--quick has 925, a grid of 4 degrees, and keeps its frames, so that `gonia process` can be tried\non them."
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
        let keep_frames = self.keep_frames || self.quick;
        let (grid, settings) = How {
            step,
            preset: PresetArgument::Default,
            block: None,
            nodes: None,
            tolerance: None,
        }
        .check()?;
        check_writable(&self.out)?;
        let path = |name: &str| self.out.join(name);
        let mut progress = Progress::new();

        let rig = Rig::paper(frame_px);
        write_rig(&path("rig.toml"), &rig)?;
        let plan = travelling(&rings);
        write_plan_csv(&path("plan.csv"), &plan.poses)?;

        let material = Material::named(&self.material).context("--material")?;
        let truth = material.brdf;
        let mut camera = SimulatedFrames::new(Scene::new(
            SceneGeometry::of_rig(&rig),
            truth.clone(),
            Arc::new(Kurt::white_reference_fabric()),
            self.seed,
        ));
        if keep_frames {
            camera.keep_frames(&self.out)?;
        }
        let session = progress.stage("moving and triggering", |tell| {
            session::measure(&plan.poses, self.seed, &mut camera, tell)
        })?;
        if keep_frames {
            write_frames_csv(&path("frames.csv"), camera.rows())?;
        }

        let processed = process::run(&rig, &camera, &mut progress)?;
        progress.stage("writing samples", |_| {
            write_samples(&path("samples.npy"), &processed.samples)
        })?;
        let frame_rows = process::describe(&processed);
        let mut summary = summary::start(material.what, &session, &processed, plan.poses.len());
        let filled = fill(processed.samples, grid, settings, false, &mut progress)?;
        summary
            .provenance
            .extend(fill::provenance_of(&filled.settings));
        for (name, text) in [
            ("material", material.name.to_owned()),
            ("seed", self.seed.to_string()),
            ("rig", format!("simulated, frames of {frame_px} px")),
            ("plan", format!("{} poses", plan.poses.len())),
        ] {
            summary.provenance.insert(name.into(), text);
        }

        let measured = CellMask::from_cells(grid, filled.cells.iter().map(|c| *c as usize));
        cell_mask::write_mask(&path(MEASURED), &measured)?;
        summary::count_cells(&mut summary, filled.binned as u64, &measured);
        let dense = progress.stage("writing the dense BRDF", |_| {
            write_dense(
                &path(DENSE),
                DenseFile {
                    brdf: filled.dense,
                    scale: summary.scale,
                    provenance: summary.provenance.clone(),
                },
            )
        })?;
        summary.figures = Some(progress.stage("measuring the error", |_| {
            evaluate::compare(
                Table {
                    brdf: &dense.brdf,
                    scale: dense.scale,
                },
                Side::Model(truth.as_ref()),
                &Options::default(),
            )
        })?);
        progress.stage("writing the truth", |_| {
            write_dense(
                &path(TRUTH),
                DenseFile {
                    brdf: DenseBrdf::tabulate(grid, truth.as_ref()),
                    scale: Scale::Absolute,
                    provenance: super::provenance::of_this_program(),
                },
            )
        })?;
        summary.stages = progress.stages().to_vec();
        summary::list_files(&mut summary, &self.out);
        progress.stage("drawing the report", |_| {
            let sphere = Tabulated::new(&dense.brdf);
            write_sphere(&path("sphere.png"), &sphere, 512)?;
            write_report(
                &path(REPORT),
                &ReportInput {
                    truth: Some(truth.as_ref()),
                    measured: Some(&measured),
                    rig: Some(&rig),
                    ..ReportInput::new(&summary, &dense.brdf)
                },
            )
        })?;
        summary.stages = progress.stages().to_vec();
        summary::list_files(&mut summary, &self.out);
        summary.write(&path(SUMMARY))?;
        summary::print(
            &summary,
            &session,
            &frame_rows,
            began.elapsed().as_secs_f64(),
        );
        Ok(())
    }
}
