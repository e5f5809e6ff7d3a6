//! `gonia plan --adaptive`: what to measure next.

use crate::progress::Progress;
use crate::remarks;
use anyhow::{Context, Result, bail};
use gonia_formats::samples::read_samples_of_all;
use gonia_pipeline::chart::poses_of;
use gonia_pipeline::{FillOptions, fill};
use gonia_plan::adaptive;
use gonia_plan::adaptive::{Proposal, Reach};
use gonia_protocol::settings::{Axis, Key};
use gonia_rig::{Rig, Scale};
use std::path::PathBuf;

/// Step of the grid whose error bars decide, degrees: a frame spans several cells.
const STEP_DEG: f64 = 4.0;
/// Nearer than this the light's head hides the sample, degrees.
const KEEP_OUT_DEG: f64 = 8.0;
/// Views beyond this show the sample as a strip in which patches run into each other, degrees: the
/// paper's last ring.
const VIEW_MAX_DEG: f64 = 75.0;
/// The paper's oblique lights, degrees.
const LIGHT_MAX_DEG: f64 = 85.0;

/// Chooses `n` poses to add to those that the samples came from.
///
/// # Errors
/// Samples that cannot be read, or that do not say their frames, or of too few frames.
pub fn propose(rig: &Rig, samples: &[PathBuf], n: usize, keep_out_deg: f64) -> Result<Proposal> {
    let progress = Progress::new();
    let read = progress.stage("reading samples", |_| read_samples_of_all(samples, None))?;
    remarks::print(&read.remarks);
    let measured = poses_of(&read.samples);
    if measured.is_empty() {
        bail!(
            "the samples do not say which frames they came from: give samples with a frame column, as \
             gonia capture and gonia process write them"
        );
    }
    let scale = read.scale.unwrap_or(Scale::Relative);
    let options = FillOptions {
        with_errors: true,
        ..FillOptions::with_step_deg(STEP_DEG)
    };
    let filled = fill(read.samples, scale, &options, &progress.watch())?;
    remarks::print(&filled.account.remarks);
    let relative = filled.relative_errors();
    let (grid, relative) = (
        filled.dense.grid,
        relative.context("the fill gave no error bars")?,
    );
    let highest = f64::from(Key::SoftMax.default_of(Axis::Theta)) * 1e-6;
    let reach = Reach {
        light_m: rig.light.distance_m,
        camera_m: rig.camera.distance_m,
        radius_m: 1e-3 * rig.sampling.disc_radius_mm,
        theta_max_deg: [LIGHT_MAX_DEG, VIEW_MAX_DEG].map(|limit| limit.min(highest)),
        keep_out_deg: keep_out_deg.max(KEEP_OUT_DEG),
    };
    progress.stage("choosing poses", |_| {
        anyhow::Ok(adaptive::propose(grid, &relative, &measured, n, &reach))
    })
}

/// What the poses are worth, as a row.
pub fn expectation([before, after]: [f64; 2]) -> (String, String) {
    (
        "error bars, RMS over all cells".into(),
        format!(
            "{:.1} % now, {:.1} % expected with these poses",
            100.0 * before,
            100.0 * after
        ),
    )
}
