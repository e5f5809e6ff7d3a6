//! `gonia process`: frames → samples.

use crate::progress::Progress;
use crate::{account, remarks, sample_facts, table};
use anyhow::{Result, bail};
use gonia_acquire::session::{RIG, SessionFolder};
use gonia_formats::samples::{check_sample_name, write_noted_samples_with_u};
use gonia_formats::{CaptureFolder, check_output};
use gonia_pipeline::budget::{budget_of, scale_uncertainty};
use gonia_pipeline::process::{MASKS, Masks};
use gonia_pipeline::samples_of;
use gonia_rig::{remark_on_certificate, rig_remarks};
use std::path::PathBuf;

/// Registers each frame by its fiducial lines, samples it, and calibrates it against the reference.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia process capture/ -o samples.npy\n\nA capture folder holds rig.toml, frames.csv (frame, role, theta_i_deg, phi_i_deg, theta_v_deg,\nphi_v_deg, file) and the frames it names: OpenEXR, linear radiance, RGB or grey, of any rig. Raw\nexposures (PNG or TIFF of 8 or 16 bits: mono, Bayer or RGB, linear counts) have an exposure_s as well;\nrows of one frame and role are merged by the [sensor] of rig.toml. A frame that cannot be read is left\nout with a warning."
)]
pub struct Process {
    /// The capture folder
    folder: PathBuf,
    /// Where to write the samples, .npy or .csv [default: DIR/samples.npy]
    #[arg(short, long, value_name = "SAMPLES")]
    output: Option<PathBuf>,
    /// Occlusion masks of another session's reference, for poses without a reference frame
    /// [default: DIR/masks.csv if it is there]
    #[arg(long, value_name = "CSV")]
    masks: Option<PathBuf>,
}

impl Process {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let output = self
            .output
            .clone()
            .unwrap_or_else(|| self.folder.join("samples.npy"));
        check_sample_name(&output)?;
        check_output(&output, &[&self.folder.join("frames.csv")])?;
        let progress = Progress::new();
        let has_frames = self.folder.join("frames.csv").is_file();
        let (rig, processed, facts) = if SessionFolder::is_session(&self.folder) && !has_frames {
            if self.masks.is_some() {
                bail!(
                    "--masks: the frames of a session are sampled already, and masks come too late"
                );
            }
            let session = SessionFolder::open(&self.folder)?;
            let processed = session.samples(&progress.watch())?;
            let facts = sample_facts::of_session("gonia process", &session);
            (session.rig().clone(), processed, facts)
        } else {
            let folder = CaptureFolder::open(&self.folder)?;
            let facts = sample_facts::of_capture_folder("gonia process", &self.folder)?;
            let kept = self.folder.join(MASKS);
            let masks = match self.masks.or(kept.is_file().then_some(kept)) {
                Some(path) => Masks::read(&path, folder.rig())?,
                None => Masks::default(),
            };
            let processed = samples_of(folder.rig(), &folder, &masks, &progress.watch())?;
            (folder.rig().clone(), processed, facts)
        };
        let place = self.folder.join(RIG);
        remarks::print(&rig_remarks(place.display(), &rig));
        let today = sample_facts::today();
        remarks::print(remark_on_certificate(place.display(), &rig, &today).as_slice());
        remarks::print(&processed.remarks);
        progress.stage("writing samples", |_| {
            let samples = &processed.samples;
            let budget = budget_of(&rig, processed.calibration, samples);
            let u = scale_uncertainty(&budget, samples);
            write_noted_samples_with_u(&output, samples, &u, &processed.note(&rig, facts))
        })?;
        if !processed.masks.is_empty() {
            processed.masks.write(&output.with_file_name(MASKS), &rig)?;
        }
        let mut rows = account::describe(&processed);
        rows.extend(account::uncertainties(&rig, &processed));
        rows.push(("written".into(), output.display().to_string()));
        table::print(&rows);
        Ok(())
    }
}
