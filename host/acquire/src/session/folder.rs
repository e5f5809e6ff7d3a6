//! A session's folder as it is read.

use crate::session::entry::{Entry, PoseDone, SessionEnd};
use crate::session::journal::Lines;
use crate::session::provenance::SessionProvenance;
use crate::session::{journal, record};
use gonia_brdf::Pose;
use gonia_formats::plan_csv::read_plan_csv;
use gonia_formats::rig_toml::read_rig;
use gonia_formats::{FileError, checksum};
use gonia_pipeline::process::SampledFrame;
use gonia_protocol::crc32c;
use gonia_rig::{FrameRow, Rig, Role};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry as Place;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Files of a session.
pub const RIG: &str = "rig.toml";
/// The poses.
pub const PLAN: &str = "plan.csv";
/// What it was measured with.
pub const PROVENANCE: &str = "provenance.toml";
/// Its history.
pub const JOURNAL: &str = "journal.log";
/// The sampled frames.
pub const FRAMES: &str = "frames.bin";

/// Reference before material: the order in which a session measures them.
pub type PoseKey = (bool, usize);

/// The place of a pose in a session's order.
pub fn key(role: Role, index: usize) -> PoseKey {
    (role == Role::Material, index)
}

/// A session as it stands on the disk.
#[derive(Clone, Debug)]
pub struct SessionFolder {
    folder: PathBuf,
    rig: Rig,
    plan: Vec<Pose>,
    provenance: SessionProvenance,
    pub(super) lines: Lines,
    done: BTreeMap<PoseKey, PoseDone>,
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
        let path = folder.join(JOURNAL);
        let lines = if path.exists() {
            journal::read(&path)?
        } else {
            // Killed before its first line.
            Lines {
                entries: Vec::new(),
                whole_bytes: 0,
                torn_bytes: 0,
            }
        };
        let done = poses_done(&path, &lines, plan.len())?;
        Ok(Self {
            folder: folder.to_owned(),
            rig,
            plan,
            provenance,
            lines,
            done,
        })
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

    /// The poses that are done, the reference's first, in the plan's order.
    pub fn done(&self) -> impl Iterator<Item = &PoseDone> {
        self.done.values()
    }

    /// A pose that is done.
    pub fn pose_done(&self, role: Role, index: usize) -> Option<&PoseDone> {
        self.done.get(&key(role, index))
    }

    /// Poses of a role that are not done, in the plan's order.
    pub fn missing(&self, role: Role) -> Vec<usize> {
        let is_missing = |i: &usize| !self.done.contains_key(&key(role, *i));
        (0..self.plan.len()).filter(is_missing).collect()
    }

    /// How the last program left it; `None` when it was killed, or still runs.
    pub fn end(&self) -> Option<(SessionEnd, &str)> {
        match self.lines.entries.last() {
            Some(Entry::Stop(end, reason)) => Some((*end, reason)),
            _ => None,
        }
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
        let frame = record::from_bytes(&bytes).ok_or_else(|| damaged("holds no frame there"))?;
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

    /// How many bytes of frames the journal vouches for.
    pub(super) fn frame_bytes(&self) -> u64 {
        // Also those of discarded poses: nothing may be written over.
        let ends = self.lines.entries.iter().map(|entry| match entry {
            Entry::Pose(pose) => pose.at + pose.bytes,
            _ => 0,
        });
        ends.max().unwrap_or(0)
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

fn poses_done(
    path: &Path,
    lines: &Lines,
    planned: usize,
) -> Result<BTreeMap<PoseKey, PoseDone>, FileError> {
    let mut done: BTreeMap<PoseKey, (usize, PoseDone)> = BTreeMap::new();
    for (i, entry) in lines.entries.iter().enumerate() {
        let pose = match entry {
            Entry::Pose(pose) => pose,
            Entry::Discard { since, .. } => {
                done.retain(|_, (line, _)| *line < *since);
                continue;
            }
            _ => continue,
        };
        let wrong = |what: &str| {
            let name = format!("{} pose {}", pose.role.name(), pose.index);
            FileError::new(
                path,
                format_args!("{name} {what}"),
                "this is no journal that gonia wrote; measure the session anew",
            )
            .at(format_args!("line {}", i + 1))
        };
        if pose.index >= planned {
            return Err(wrong("is not in the plan"));
        }
        match done.entry(key(pose.role, pose.index)) {
            Place::Vacant(place) => place.insert((i, pose.clone())),
            Place::Occupied(_) => return Err(wrong("is done twice")),
        };
    }
    Ok(done
        .into_iter()
        .map(|(key, (_, pose))| (key, pose))
        .collect())
}
