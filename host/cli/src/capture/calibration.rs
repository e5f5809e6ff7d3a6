//! The calibration that a session begins with: frames of poses spread over all directions, and the rig that
//! they show.

use super::{Capture, Folder, RigFile, check_equipment, check_same, list_frames, provenance_of};
use crate::capture::terminal::Terminal;
use crate::progress::Progress;
use crate::say::errln;
use crate::{calibrate, remarks, table};
use anyhow::{Context, Result, bail};
use gonia_acquire::capture::{
    Equipment, Orders, UnattendedSession, free_mb, keep_apart, travelling,
};
use gonia_acquire::session::{
    Beginning, CALIBRATION, Claim, Entry, PLAN, RIG, SessionEnd, SessionFolder, SessionWriter, now,
};
use gonia_brdf::Pose;
use gonia_formats::plan_csv::{read_plan_csv, write_plan_csv};
use gonia_formats::rig_toml::{read_rig, write_rig};
use gonia_formats::{CaptureFolder, FileError, check_writable};
use gonia_pipeline::calibrate::spread_poses;
use gonia_plan::Rings;
use gonia_report::files::CALIBRATION_FIGURE;
use gonia_rig::{Rig, Source};
use gonia_sim::scene::as_built;
use std::path::PathBuf;

/// The rig that was found, in the calibration's folder.
const FOUND: &str = "calibrated.toml";
/// Poses of the calibration: more add less than the arms' own error.
const POSES: usize = 60;
/// Light and camera are no lower than this then, degrees: the reference is dim there, and lines are close.
const LOWEST_DEG: f64 = 76.0;

impl Capture {
    /// Whether the session has a calibration of its own.
    pub(super) fn is_calibrated(&self) -> Result<bool> {
        let folder = self.folder.join(CALIBRATION);
        let has_frames = SessionFolder::is_session(&folder);
        if has_frames && !self.resume {
            bail!(
                "{}: holds frames of a calibration already; go on with it by --resume, or choose another folder",
                folder.display()
            );
        }
        let is_begun = self.resume && SessionFolder::is_session(&self.folder);
        if self.calibrate && is_begun && !has_frames {
            bail!(
                "{}: the session began without a calibration; leave --calibrate out, or begin another session",
                self.folder.display()
            );
        }
        Ok(self.calibrate || has_frames)
    }

    /// The plan of a session whose calibration is not done: what it was begun with, whatever the command line
    /// leaves out now.
    pub(super) fn plan_of_calibration(&self) -> Result<Option<Vec<Pose>>> {
        let (kept, frames) = (self.folder.join(PLAN), self.folder.join(CALIBRATION));
        if !(self.resume && SessionFolder::is_session(&frames) && kept.is_file()) {
            return Ok(None);
        }
        let plan = read_plan_csv(&kept)?;
        if let Some(path) = &self.plan
            && read_plan_csv(path)? != plan
        {
            bail!(
                "{}: is not the plan that the session began with; leave --plan out, or begin a session in another folder",
                path.display()
            );
        }
        Ok(Some(plan))
    }

    /// Keeps the session's plan before its calibration, for a resume.
    pub(super) fn keep_plan(&self, plan: &[Pose]) -> Result<()> {
        let path = self.folder.join(PLAN);
        if !path.is_file() {
            write_plan_csv(&path, plan)?;
        }
        Ok(())
    }

    /// What the simulated rig's camera sees where the session is calibrated: a rig that was built with care,
    /// and is not quite what its drawing says. Another rig is as it is.
    pub(super) fn there(&self, drawn: &Rig) -> Rig {
        match drawn.source {
            Some(Source::Simulated { .. }) => as_built(drawn),
            _ if self.simulated => as_built(drawn),
            _ => drawn.clone(),
        }
    }

    /// The calibrated rig: of the folder, or found from frames that are taken now.
    pub(super) fn calibrated(&self, drawn: &RigFile, orders: &Orders) -> Result<RigFile> {
        let folder = self.folder.join(CALIBRATION);
        let found = folder.join(FOUND);
        if SessionFolder::is_session(&folder) {
            check_same(&folder.join(RIG), &drawn.text, &self.rig)?;
        }
        if !found.is_file() {
            errln!("calibration: {POSES} poses spread over all directions, before the session");
            self.take_calibration(drawn, orders)?;
            self.find_rig()?;
        }
        Ok(RigFile {
            rig: read_rig(&found)?,
            text: std::fs::read(&found).map_err(|error| FileError::reading(&found, &error))?,
            beside: drawn.beside.clone(),
        })
    }

    /// Takes the frames that are missing.
    fn take_calibration(&self, drawn: &RigFile, orders: &Orders) -> Result<()> {
        let folder = self.folder.join(CALIBRATION);
        let beside = drawn.beside();
        let (begun, plan) = if SessionFolder::is_session(&folder) {
            let (writer, session) = SessionWriter::resume(&folder)?;
            (Folder::Begun(Box::new(writer)), session.plan().to_vec())
        } else {
            let claim = Claim::new(&folder, beside.map(|b| b.0))?;
            (Folder::Fresh(claim), poses(&drawn.rig))
        };
        let settings = drawn.rig.session.clone().unwrap_or_default();
        let (there, ports) = (self.there(&drawn.rig), self.ports());
        let mut equipment =
            Equipment::open(&there, &self.rig, ports, plan.len(), &settings, orders)?;
        equipment.check_reach(&plan)?;
        let provenance = provenance_of(&mut equipment, settings.reference);
        let mut writer = match begun {
            Folder::Begun(writer) => *writer,
            Folder::Fresh(claim) => claim.begin(Beginning {
                rig: &drawn.text,
                beside,
                plan: &plan,
                provenance: &provenance,
            })?,
        };
        let session = SessionFolder::open(&folder)?;
        check_equipment(session.provenance(), &provenance)?;
        writer.note(&Entry::Start(format!(
            "{}, for a calibration",
            provenance.program
        )))?;
        check_writable(&folder.join("frames"))?;
        let terminal = Terminal::new(&session);
        let run = UnattendedSession {
            rig: session.rig(),
            settings: &settings,
            keep_frames: Some(folder.clone()),
            is_calibration: true,
            exact: equipment.exact,
            orders,
            watch: &terminal,
            free_mb: &free_mb,
        };
        let ended = run.run(&mut equipment.arms, equipment.camera, writer, &session)?;
        terminal.finish();
        let session = SessionFolder::open(&folder)?;
        list_frames(&session)?;
        if ended.end != SessionEnd::Finished {
            bail!(
                "the calibration has ended after {} of {} poses: {} (--resume goes on with it)",
                session.done().count(),
                plan.len(),
                ended.reason
            );
        }
        Ok(())
    }

    /// Finds the rig that the frames show, and writes it beside them.
    fn find_rig(&self) -> Result<()> {
        let folder = self.folder.join(CALIBRATION);
        let progress = Progress::new();
        let frames = CaptureFolder::open(&folder)?;
        let mut calibrated = gonia_pipeline::calibrate(frames.rig(), &frames, &progress.watch())
            .with_context(|| {
                format!(
                    "{}: the frames do not show the rig (mend what is named, remove this folder, and begin again)",
                    folder.display()
                )
            })?;
        if let Some(calibration) = &mut calibrated.rig.calibration {
            calibration.date = now();
        }
        remarks::print(&calibrated.remarks);
        let mut rows = calibrate::describe(&calibrated);
        let found: PathBuf = folder.join(FOUND);
        write_rig(&found, &calibrated.rig)?;
        let figure = self.folder.join(CALIBRATION_FIGURE);
        calibrate::write_figure(&figure, &calibrated)?;
        rows.push((
            "written".into(),
            format!("{}, {}", found.display(), figure.display()),
        ));
        table::print(&rows);
        Ok(())
    }
}

/// Poses for a calibration, in travelling order.
fn poses(rig: &Rig) -> Vec<Pose> {
    let mut plan = travelling(&Rings::paper());
    if let Some(arms) = rig.arms.as_ref().filter(|arms| arms.keep_out_deg > 0.0) {
        keep_apart(&mut plan, arms.keep_out_deg);
    }
    let is_high =
        |pose: &Pose| pose.light.theta_deg() < LOWEST_DEG && pose.view.theta_deg() < LOWEST_DEG;
    let high: Vec<Pose> = plan.poses.into_iter().filter(is_high).collect();
    let picked = spread_poses(&high, POSES);
    picked.into_iter().map(|i| high[i]).collect()
}
