//! A session's folder as it is read.

use crate::session::entry::{Entry, PoseDone, SessionEnd};
use crate::session::journal;
use crate::session::journal::Lines;
use crate::session::provenance::SessionProvenance;
use crate::session::state::SessionState;
use gonia_brdf::Pose;
use gonia_formats::plan_csv::read_plan_csv;
use gonia_formats::rig_toml::read_rig;
use gonia_formats::{FileError, checksum};
use gonia_pipeline::process::{Outcome, SampledFrame, sampled_bytes};
use gonia_protocol::crc32c;
use gonia_rig::{FrameRow, Reflectance, Rig, Role};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Files of a session.
pub const RIG: &str = "rig.toml";
/// The picture of that calibration, which `gonia report` shows.
pub const CALIBRATION_FIGURE: &str = "calibration.svg";
/// The folder in a session's for the frames that its rig was calibrated by: a session of its own.
pub const CALIBRATION: &str = "calibration";
/// The poses.
pub const PLAN: &str = "plan.csv";
/// What it was measured with.
pub const PROVENANCE: &str = "provenance.toml";
/// Its history.
pub const JOURNAL: &str = "journal.log";
/// The sampled frames.
pub const FRAMES: &str = "frames.bin";

/// A session as it stands on the disk.
#[derive(Clone, Debug)]
pub struct SessionFolder {
    folder: PathBuf,
    rig: Rig,
    plan: Vec<Pose>,
    provenance: SessionProvenance,
    pub(super) lines: Lines,
    state: SessionState,
}

impl SessionFolder {
    /// Whether a folder holds a session.
    pub fn is_session(folder: &Path) -> bool {
        folder.join(PROVENANCE).is_file()
    }

    /// Reads everything but the frames.
    ///
    /// # Errors
    /// One line naming the file: no session, a damaged journal, a rig or plan that is not the one
    /// the session began with, or a pose done twice.
    pub fn open(folder: &Path) -> Result<Self, FileError> {
        if !Self::is_session(folder) {
            return Err(FileError::new(
                folder,
                format_args!("holds no session (there is no {PROVENANCE})"),
                "give the folder of a capture",
            ));
        }
        let provenance = SessionProvenance::read(&folder.join(PROVENANCE))?;
        check_crc(&folder.join(RIG), &provenance.rig_crc)?;
        check_crc(&folder.join(PLAN), &provenance.plan_crc)?;
        let rig = read_rig(&folder.join(RIG))?;
        let plan = read_plan_csv(&folder.join(PLAN))?;
        let table = table_of(&rig).map(|file| folder.join(file));
        if let (Some(table), Some(crc)) = (table, &provenance.reference_crc) {
            check_crc(&table, crc)?;
        }
        let lines = read_journal(folder)?;
        let limit = rig.session.clone().unwrap_or_default().drift_limit;
        let state = replay(&folder.join(JOURNAL), &lines, plan.len(), limit)?;
        let mut session = Self {
            folder: folder.to_owned(),
            rig,
            plan,
            provenance,
            lines,
            state,
        };
        for role in session.roles() {
            session.find_baseline(*role)?;
        }
        Ok(session)
    }

    /// A journal of an older program does not say in which frames the fiducial lines were seen: what
    /// control poses are compared with is the first one that was.
    fn find_baseline(&mut self, role: Role) -> Result<(), FileError> {
        if self.state.role(role).baseline().is_some() {
            return Ok(());
        }
        let is_first = |entry: &Entry| {
            let Entry::Pose(pose) = entry else {
                return false;
            };
            pose.role == role
                && pose.has_lines.is_none()
                && self.state.role(role).pose_done(pose.index) == Some(pose)
                // A damaged frame is none; who reads it says so.
                && self.frame(pose).is_ok_and(|f| f.report.outcome == Outcome::Locked)
        };
        let Some(place) = self.lines.entries.iter().position(is_first) else {
            return Ok(());
        };
        if let Some(Entry::Pose(pose)) = self.lines.entries.get_mut(place) {
            pose.has_lines = Some(true);
        }
        let limit = self.rig.session.clone().unwrap_or_default().drift_limit;
        let path = self.folder.join(JOURNAL);
        self.state = replay(&path, &self.lines, self.plan.len(), limit)?;
        Ok(())
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The poses.
    pub fn plan(&self) -> &[Pose] {
        &self.plan
    }

    /// What it is measured with.
    pub fn provenance(&self) -> &SessionProvenance {
        &self.provenance
    }

    /// The journal.
    pub fn journal(&self) -> &[Entry] {
        &self.lines.entries
    }

    /// What is measured, in this order.
    pub fn roles(&self) -> &'static [Role] {
        if self.provenance.reference {
            &[Role::Reference, Role::Material]
        } else {
            &[Role::Material]
        }
    }

    /// What the session has come to.
    pub fn state(&self) -> &SessionState {
        &self.state
    }

    /// The poses that are done, the reference's first, in the plan's order.
    pub fn done(&self) -> impl Iterator<Item = &PoseDone> {
        let state = |role| self.state.role(role).done();
        state(Role::Reference).chain(state(Role::Material))
    }

    /// A pose that is done.
    pub fn pose_done(&self, role: Role, index: usize) -> Option<&PoseDone> {
        self.state.role(role).pose_done(index)
    }

    /// Poses of a role that are not done, in the plan's order.
    pub fn missing(&self, role: Role) -> Vec<usize> {
        self.state.missing(role)
    }

    /// How the last program left it; `None` when it was killed, or still runs.
    pub fn end(&self) -> Option<(SessionEnd, &str)> {
        self.state.end()
    }

    /// Refuses frames whose lines the journal has lost: a program that died leaves one frame without a
    /// line at most.
    ///
    /// # Errors
    /// There are more, or the file cannot be read.
    pub(super) fn check_tail(&self) -> Result<(), FileError> {
        let path = self.folder.join(FRAMES);
        let at = self.state.frame_bytes();
        let Ok(mut file) = File::open(&path) else {
            return Ok(());
        };
        let mut tail = Vec::new();
        file.seek(SeekFrom::Start(at))
            .and_then(|_| file.read_to_end(&mut tail))
            .map_err(|error| FileError::reading(&path, &error))?;
        let second = sampled_bytes::split_first(&tail)
            .and_then(|(_, rest)| sampled_bytes::split_first(rest));
        if second.is_none() {
            return Ok(());
        }
        Err(FileError::new(
            &self.folder.join(JOURNAL),
            format_args!(
                "has lost lines: {FRAMES} holds {} bytes of whole frames behind the last one that it speaks of",
                tail.len()
            ),
            "restore the whole journal from a copy, or measure in another folder",
        ))
    }

    /// The frame of a pose.
    ///
    /// # Errors
    /// One line naming the file and the frame: unreadable, cut short, or not what the journal says.
    pub fn frame(&self, pose: &PoseDone) -> Result<SampledFrame, FileError> {
        let path = self.folder.join(FRAMES);
        let reading = |error| FileError::reading(&path, &error);
        let place = format!("{} pose {}", pose.role.name(), pose.index);
        let damaged = |what: &str| {
            FileError::new(
                &path,
                what,
                "restore the file from a copy, or measure the session anew",
            )
            .at(&place)
        };
        let mut file = File::open(&path).map_err(reading)?;
        let length = file.metadata().map_err(reading)?.len();
        if pose
            .at
            .checked_add(pose.bytes)
            .is_none_or(|end| end > length)
        {
            return Err(damaged("is cut short"));
        }
        file.seek(SeekFrom::Start(pose.at)).map_err(reading)?;
        let mut bytes = Vec::new();
        file.take(pose.bytes)
            .read_to_end(&mut bytes)
            .map_err(reading)?;
        if crc32c(&bytes) != pose.crc {
            return Err(damaged("is damaged: the frame's checksum is wrong"));
        }
        let frame =
            sampled_bytes::from_bytes(&bytes).ok_or_else(|| damaged("holds no frame there"))?;
        if (frame.report.role, frame.report.frame as usize) != (pose.role, pose.index) {
            return Err(damaged("holds another frame there"));
        }
        Ok(frame)
    }

    /// The frames that are done, as `process` wants them.
    ///
    /// # Errors
    /// As [`Self::frame`].
    pub fn rows(&self) -> Result<Vec<FrameRow>, FileError> {
        let row = |pose: &PoseDone| {
            Ok(FrameRow {
                frame: pose.index as u32,
                role: pose.role,
                pose: self.frame(pose)?.reading,
                file: FRAMES.to_owned(),
            })
        };
        self.done().map(row).collect()
    }
}

fn check_crc(path: &Path, expected: &str) -> Result<(), FileError> {
    if checksum::of_file(path)? == expected {
        return Ok(());
    }
    Err(FileError::new(
        path,
        "has changed since the session began",
        "restore it, or begin a session in another folder",
    ))
}

/// The file beside `rig.toml` that a rig names.
pub fn table_of(rig: &Rig) -> Option<&str> {
    match &rig.reference.as_ref()?.reflectance {
        Reflectance::Table { file, .. } => Some(file),
        _ => None,
    }
}

/// The journal. It lies there, if empty, before the folder is a session; where it is gone, the frames
/// cannot be told apart any more.
fn read_journal(folder: &Path) -> Result<Lines, FileError> {
    let path = folder.join(JOURNAL);
    if path.exists() {
        return journal::read(&path);
    }
    match std::fs::metadata(folder.join(FRAMES)).map_or(0, |m| m.len()) {
        // An older program, killed before its first line.
        0 => Ok(Lines::default()),
        bytes => Err(FileError::new(
            &path,
            format_args!("is missing, and {FRAMES} holds {bytes} bytes of frames"),
            "restore the journal from a copy: without it nobody knows which frames these are; or measure in another folder",
        )),
    }
}

fn replay(
    path: &Path,
    lines: &Lines,
    planned: usize,
    drift_limit: f64,
) -> Result<SessionState, FileError> {
    let mut state = SessionState::new(planned, drift_limit);
    for (i, entry) in lines.entries.iter().enumerate() {
        state.apply(entry).map_err(|contradiction| {
            FileError::new(
                path,
                contradiction,
                "this is no journal that gonia wrote; measure the session anew",
            )
            .at(format_args!("line {}", i + 1))
        })?;
    }
    Ok(state)
}
