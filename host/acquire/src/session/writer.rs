//! A session's folder as it is written: by one program at a time.

use crate::session::entry::{Entry, PoseDone};
use crate::session::folder::{FRAMES, JOURNAL, PLAN, PROVENANCE, RIG, SessionFolder};
use crate::session::journal::Journal;
use crate::session::provenance::SessionProvenance;
use crate::session::{clock, record};
use gonia_brdf::Pose;
use gonia_formats::plan_csv::write_plan_csv;
use gonia_formats::{FileError, check_writable, checksum, write_whole_bytes};
use gonia_pipeline::process::SampledFrame;
use gonia_protocol::crc32c;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Held while a capture runs.
const LOCK: &str = "lock";

/// A folder in which a session may begin, locked.
#[derive(Debug)]
pub struct Claim {
    folder: PathBuf,
    lock: Lock,
}

/// What a session begins with.
#[derive(Clone, Copy, Debug)]
pub struct Beginning<'a> {
    /// `rig.toml`, as it is.
    pub rig: &'a [u8],
    /// A file that it speaks of: its name beside `rig.toml`, and what it holds.
    pub beside: Option<(&'a str, &'a [u8])>,
    /// The poses.
    pub plan: &'a [Pose],
    /// Checksums and time are put in when it begins.
    pub provenance: &'a SessionProvenance,
}

impl Claim {
    /// Claims a folder, which is made if need be. `beside` is the name of the file that will lie
    /// beside `rig.toml`.
    ///
    /// # Errors
    /// When the folder holds anything already, is in use, or cannot be written.
    pub fn new(folder: &Path, beside: Option<&str>) -> Result<Self, FileError> {
        check_writable(folder)?;
        check_fresh(folder, beside)?;
        Ok(Self {
            folder: folder.to_owned(),
            lock: lock(folder)?,
        })
    }

    /// Begins the session.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn begin(self, beginning: Beginning) -> Result<SessionWriter, FileError> {
        let folder = &self.folder;
        write_whole_bytes(&folder.join(RIG), beginning.rig)?;
        if let Some((name, bytes)) = beginning.beside {
            write_whole_bytes(&folder.join(name), bytes)?;
        }
        write_plan_csv(&folder.join(PLAN), beginning.plan)?;
        let provenance = SessionProvenance {
            rig_crc: checksum::of_file(&folder.join(RIG))?,
            plan_crc: checksum::of_file(&folder.join(PLAN))?,
            began: clock::now(),
            ..beginning.provenance.clone()
        };
        // Last, for with it the folder is a session.
        provenance.write(&folder.join(PROVENANCE))?;
        SessionWriter::open(folder, self.lock, None)
    }
}

/// Appends to a session. The folder is locked until this is dropped, or its program dies.
#[derive(Debug)]
pub struct SessionWriter {
    folder: PathBuf,
    journal: Journal,
    frames: File,
    /// Where the next frame begins.
    at: u64,
    _lock: Lock,
}

impl SessionWriter {
    /// Goes on with a session, and reads what is there. Whatever a killed program left behind the
    /// last whole line is cut off.
    ///
    /// # Errors
    /// As [`SessionFolder::open`], and when the folder is in use or cannot be written.
    pub fn resume(folder: &Path) -> Result<(Self, SessionFolder), FileError> {
        if !SessionFolder::is_session(folder) {
            // Says so in its own words.
            SessionFolder::open(folder)?;
        }
        let lock = lock(folder)?;
        let session = SessionFolder::open(folder)?;
        Ok((Self::open(folder, lock, Some(&session))?, session))
    }

    fn open(folder: &Path, lock: Lock, session: Option<&SessionFolder>) -> Result<Self, FileError> {
        let journal = Journal::append_to(&folder.join(JOURNAL), session.map(|s| &s.lines))?;
        let path = folder.join(FRAMES);
        let failed = |error| FileError::writing(&path, &error);
        let mut options = OpenOptions::new();
        let frames = options
            .append(true)
            .create(true)
            .open(&path)
            .map_err(failed)?;
        let at = session.map_or(0, SessionFolder::frame_bytes);
        let there = frames.metadata().map_err(failed)?.len();
        if there < at {
            return Err(FileError::new(
                &path,
                format_args!("has {there} bytes, and the journal speaks of {at}"),
                "restore the file from a copy, or measure the session anew",
            ));
        }
        frames.set_len(at).map_err(failed)?;
        Ok(Self {
            folder: folder.to_owned(),
            journal,
            frames,
            at,
            _lock: lock,
        })
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Keeps a frame: first itself, then its line in the journal, both on the disk when this
    /// returns.
    ///
    /// # Errors
    /// When the disk does not take it. The session on the disk is then as it was before.
    pub fn keep(&mut self, frame: &SampledFrame, pointing_deg: f64) -> Result<PoseDone, FileError> {
        let bytes = record::to_bytes(frame);
        let done = PoseDone {
            role: frame.report.role,
            index: frame.report.frame as usize,
            at: self.at,
            bytes: bytes.len() as u64,
            crc: crc32c(&bytes),
            pointing_deg,
        };
        let written = self.frames.write_all(&bytes);
        if let Err(error) = written.and_then(|()| self.frames.sync_data()) {
            // Part of it may be there; the next frame must begin where this one did.
            let _ = self.frames.set_len(self.at);
            return Err(FileError::writing(&self.folder.join(FRAMES), &error));
        }
        self.at += done.bytes;
        self.journal.write(&Entry::Pose(done.clone()))?;
        Ok(done)
    }

    /// The number of the journal's next line.
    pub fn next_line(&self) -> usize {
        self.journal.next()
    }

    /// Writes a line into the journal.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn note(&mut self, entry: &Entry) -> Result<(), FileError> {
        self.journal.write(entry)
    }
}

/// A folder in which a session may begin: empty, or with what a killed beginning left.
fn check_fresh(folder: &Path, beside: Option<&str>) -> Result<(), FileError> {
    if SessionFolder::is_session(folder) {
        return Err(FileError::new(
            folder,
            "holds a session already",
            "go on with it by --resume, or choose another folder",
        ));
    }
    let failed = |error| FileError::reading(folder, &error);
    for item in std::fs::read_dir(folder).map_err(failed)? {
        let name = item.map_err(failed)?.file_name();
        let name = name.to_string_lossy();
        let ours = [RIG, PLAN, LOCK].contains(&&*name)
            || beside == Some(&name)
            || name.starts_with(".gonia-") && name.ends_with(".part");
        if !ours {
            return Err(FileError::new(
                folder,
                format_args!("is not empty (there is \"{name}\")"),
                "choose an empty or a new folder for the session",
            ));
        }
    }
    Ok(())
}

/// Holds a session's folder.
#[derive(Debug)]
struct Lock(File);

impl Drop for Lock {
    /// A program that is just being started (the camera's command, say) has this file too until it runs,
    /// and would hold the folder for as long; unlocking frees it at once.
    fn drop(&mut self) {
        let _ = self.0.unlock();
    }
}

fn lock(folder: &Path) -> Result<Lock, FileError> {
    let path = folder.join(LOCK);
    let failed = |error| FileError::writing(&path, &error);
    let mut options = OpenOptions::new();
    let file = options
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path)
        .map_err(failed)?;
    match file.try_lock() {
        Ok(()) => Ok(Lock(file)),
        Err(std::fs::TryLockError::WouldBlock) => Err(FileError::new(
            folder,
            "is in use by another capture",
            "wait until it ends, or choose another folder",
        )),
        Err(std::fs::TryLockError::Error(error)) => Err(failed(error)),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::session::entry::SessionEnd;
    use crate::session::provenance::ControllerIdentity;
    use crate::session::record::tests::some_frame;
    use gonia_brdf::Direction;
    use gonia_rig::{Rig, Role};

    pub fn provenance() -> SessionProvenance {
        let arm = ControllerIdentity {
            board: "sim".into(),
            firmware: "0.1.0 (abc)".into(),
            config_crc: "00000001".into(),
        };
        SessionProvenance {
            program: "gonia".into(),
            began: String::new(),
            rig_crc: String::new(),
            plan_crc: String::new(),
            reference: true,
            camera: "none".into(),
            seed: None,
            light_arm: arm.clone(),
            camera_arm: arm,
        }
    }

    pub fn begin(folder: &Path) -> SessionWriter {
        let rig = toml::to_string(&Rig::paper(100)).unwrap();
        let up = Direction::from_deg(0.0, 0.0);
        let plan = [Pose {
            light: up,
            view: up,
        }; 5];
        let beginning = Beginning {
            rig: rig.as_bytes(),
            beside: None,
            plan: &plan,
            provenance: &provenance(),
        };
        Claim::new(folder, None).unwrap().begin(beginning).unwrap()
    }

    #[test]
    fn a_session_cut_after_any_byte_goes_on_with_its_whole_poses() {
        let whole = tempfile::tempdir().unwrap();
        let mut writer = begin(whole.path());
        writer.note(&Entry::Start("now".into())).unwrap();
        for i in 0..3 {
            writer.keep(&some_frame(i, Role::Reference), 0.001).unwrap();
        }
        drop(writer);
        let journal = std::fs::read(whole.path().join(JOURNAL)).unwrap();
        let frames = std::fs::read(whole.path().join(FRAMES)).unwrap();
        let one = frames.len() / 3;
        for keep in 0..=journal.len() {
            // Frames are on the disk before their line; a fourth one may have begun.
            let text = String::from_utf8_lossy(&journal[..keep]);
            let poses = text.lines().filter(|l| l.contains(" pose ")).count();
            let bytes = frames.len().min(one * (poses + 1) + keep % 7);
            std::fs::write(whole.path().join(JOURNAL), &journal[..keep]).unwrap();
            std::fs::write(whole.path().join(FRAMES), &frames[..bytes]).unwrap();
            let (mut writer, session) = SessionWriter::resume(whole.path()).unwrap();
            let done = session.done().count();
            assert_eq!(session.missing(Role::Reference).len(), 5 - done);
            writer.keep(&some_frame(4, Role::Reference), 0.001).unwrap();
            drop(writer);
            let session = SessionFolder::open(whole.path()).unwrap();
            assert_eq!(session.done().count(), done + 1);
            for pose in session.done() {
                let expected = some_frame(pose.index as u32, Role::Reference);
                assert_eq!(session.frame(pose).unwrap(), expected);
            }
        }
    }

    #[test]
    fn a_second_capture_in_the_same_folder_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let writer = begin(folder.path());
        let error = SessionWriter::resume(folder.path()).unwrap_err();
        assert!(error.to_string().contains("in use by another capture"));
        let of_a_child = writer._lock.0.try_clone().unwrap();
        drop(writer);
        assert!(SessionWriter::resume(folder.path()).is_ok());
        let error = Claim::new(folder.path(), None).unwrap_err();
        assert!(error.to_string().contains("holds a session already"));
        drop(of_a_child);
    }

    #[test]
    fn a_foreign_folder_and_a_changed_plan_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("thesis.tex"), "x").unwrap();
        let error = Claim::new(folder.path(), None).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("not empty (there is \"thesis.tex\")")
        );
        let error = SessionWriter::resume(folder.path()).unwrap_err();
        assert!(error.to_string().contains("holds no session"));

        let folder = tempfile::tempdir().unwrap();
        let mut writer = begin(folder.path());
        writer
            .note(&Entry::Stop(SessionEnd::Paused, "x".into()))
            .unwrap();
        drop(writer);
        let path = folder.path().join(PLAN);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("\n1,0,", "\n1,1,")).unwrap();
        let error = SessionWriter::resume(folder.path()).unwrap_err();
        assert!(error.to_string().contains("plan.csv: has changed since"));
    }
}
