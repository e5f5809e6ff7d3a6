//! `gonia process`: frames → samples.

use crate::progress::Progress;
use crate::table;
use anyhow::{Result, bail};
use gonia_acquire::session::SessionFolder;
use gonia_formats::samples::write_samples;
use gonia_formats::{CaptureFolder, FileError, check_writable};
use gonia_formats::{FrameCounts, Refused};
use gonia_pipeline::process;
use gonia_pipeline::process::{
    Compensation, FrameSource, Hidden, Masks, Outcome, ProcessError, Processed, Stage,
};
use gonia_rig::{FrameRow, Rig, Role, Scale};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Registers each frame from its marks, samples it, and compensates by the reference.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia process capture/ -o samples.npy\n\nA capture folder holds rig.toml, frames.csv (frame, role, theta_i_deg, phi_i_deg, theta_v_deg,\nphi_v_deg, file) and the frames it names: OpenEXR, linear RGB radiance, of any rig. Raw exposures\n(PNG of 8 or 16 bits: mono, Bayer or RGB) have an exposure_s as well; rows of one frame and role are\nmerged by the [sensor] of rig.toml."
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

/// Beside the samples of a session with reference frames: what hid the target in them.
pub const MASKS: &str = "masks.csv";

impl Process {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let output = self
            .output
            .clone()
            .unwrap_or_else(|| self.folder.join("samples.npy"));
        let beside = super::fill::folder_of(&output).to_owned();
        check_writable(&beside)?;
        let mut progress = Progress::new();
        let has_frames = self.folder.join("frames.csv").is_file();
        let (rig, processed) = if SessionFolder::is_session(&self.folder) && !has_frames {
            if self.masks.is_some() {
                bail!(
                    "--masks: the frames of a session are sampled already, and masks come too late"
                );
            }
            let session = SessionFolder::open(&self.folder)?;
            let processed = run_on_session(&session, &mut progress)?;
            (session.rig().clone(), processed)
        } else {
            let folder = CaptureFolder::open(&self.folder)?;
            let kept = self.folder.join(MASKS);
            let masks = match self.masks.or(kept.is_file().then_some(kept)) {
                Some(path) => Masks::read(&path, folder.rig())?,
                None => Masks::default(),
            };
            let processed = run_with_masks(folder.rig(), &folder, &masks, &mut progress)?;
            (folder.rig().clone(), processed)
        };
        progress.stage("writing samples", |_| {
            write_samples(&output, &processed.samples)
        })?;
        if !processed.masks.is_empty() {
            processed.masks.write(&beside.join(MASKS), &rig)?;
        }
        let mut rows = describe(&processed);
        rows.push(("written".into(), output.display().to_string()));
        table::print(&rows);
        Ok(())
    }
}

/// The chain from frames to samples, with a bar.
pub fn run(rig: &Rig, source: &dyn FrameSource, progress: &mut Progress) -> Result<Processed> {
    run_with_masks(rig, source, &Masks::default(), progress)
}

fn run_with_masks(
    rig: &Rig,
    source: &dyn FrameSource,
    masks: &Masks,
    progress: &mut Progress,
) -> Result<Processed> {
    watched(source.rows(), progress, |tell| {
        process::process_with_masks(rig, source, masks, tell)
    })
}

/// The chain from a session's sampled frames to samples, with a bar.
pub fn run_on_session(session: &SessionFolder, progress: &mut Progress) -> Result<Processed> {
    let rows = session.rows()?;
    let sampled = |row: &FrameRow, _: Hidden| {
        let place = session.pose_done(row.role, row.frame as usize);
        let place =
            place.ok_or_else(|| FileError::new(session.folder(), "has changed", "start again"));
        let frame = place.and_then(|place| session.frame(place));
        frame.map_err(|source| ProcessError::Load {
            frame: row.frame,
            source,
        })
    };
    watched(&rows, progress, |tell| {
        process::process_sampled(session.rig(), &rows, &sampled, &Masks::default(), tell)
    })
}

fn watched(
    rows: &[FrameRow],
    progress: &mut Progress,
    work: impl FnOnce(&(dyn Fn(Stage, usize, usize) + Sync)) -> Result<Processed, ProcessError>,
) -> Result<Processed> {
    let of_role = |role| rows.iter().filter(|row| row.role == role).count();
    let reference = of_role(Role::Reference);
    let total = rows.len().max(1);
    let processed = progress.stage("frames to samples", |tell| {
        work(&|stage, done, _| {
            let before = match stage {
                Stage::Reference => 0,
                Stage::Material => reference,
            };
            tell((before + done) as f64 / total as f64);
        })
    })?;
    if processed.samples.is_empty() {
        let why = frame_counts(&processed)
            .refused
            .into_iter()
            .max_by_key(|refused| refused.count)
            .map_or("every point was left out".to_owned(), |r| r.reason);
        bail!(
            "none of the {} frames gave a sample: {why}; check rig.toml and the poses",
            rows.len()
        );
    }
    Ok(processed)
}

/// Whether the samples are in 1/sr.
pub fn scale_of(processed: &Processed) -> Scale {
    if processed.compensation.is_absolute() {
        Scale::Absolute
    } else {
        Scale::Relative
    }
}

/// Frames used, and frames refused by reason.
pub fn frame_counts(processed: &Processed) -> FrameCounts {
    let mut reasons: BTreeMap<String, u64> = BTreeMap::new();
    let mut kept = 0;
    for frame in &processed.frames {
        match frame.outcome {
            Outcome::Refused(refusal) => {
                // Numbers in a reason would make every frame a reason of its own.
                let words = refusal
                    .to_string()
                    .replace(|c: char| c.is_ascii_digit(), "#");
                *reasons.entry(words).or_default() += 1;
            }
            Outcome::Locked | Outcome::FellBack(_) => kept += 1,
        }
    }
    FrameCounts {
        kept,
        refused: reasons
            .into_iter()
            .map(|(reason, count)| Refused { reason, count })
            .collect(),
    }
}

/// What came of the frames, for the table.
pub fn describe(processed: &Processed) -> Vec<(String, String)> {
    let counts = frame_counts(processed);
    let by_pose = processed
        .frames
        .iter()
        .filter(|frame| matches!(frame.outcome, Outcome::FellBack(_)))
        .count();
    let offsets = &processed.offsets;
    let left_out = &processed.left_out;
    let mut rows = vec![
        (
            "frames".to_owned(),
            format!(
                "{} kept ({} of them by their pose, marks hidden), {} refused",
                table::count(counts.kept),
                table::count(by_pose as u64),
                table::count(counts.n_refused())
            ),
        ),
        (
            "camera by the marks".into(),
            format!(
                "theta {:+.4} ± {:.4}, phi {:+.4} ± {:.4} degrees from the arm's reading",
                offsets.theta_mean_deg,
                offsets.theta_sd_deg,
                offsets.phi_mean_deg,
                offsets.phi_sd_deg
            ),
        ),
        (
            "compensation".into(),
            match processed.compensation {
                Compensation::KnownReference => "by the known reference, absolute (1/sr)",
                Compensation::UnknownReference => "by the unknown reference, eq. (3), relative",
                Compensation::GeometricModel => "none: ideal light over the geometry, relative",
            }
            .to_owned(),
        ),
        (
            "samples".into(),
            format!(
                "{}, and {} points left out ({} occluded, {} without light, {} at marks or the border, {} saturated, {} not finite)",
                table::count(processed.samples.len() as u64),
                table::count(left_out.total()),
                table::count(left_out.occlusion),
                table::count(left_out.dark_reference + left_out.below_horizon),
                table::count(left_out.mark + left_out.border),
                table::count(left_out.saturated),
                table::count(left_out.not_finite)
            ),
        ),
    ];
    for refused in counts.refused {
        rows.push((
            format!("refused, {}", table::count(refused.count)),
            refused.reason,
        ));
    }
    rows
}
