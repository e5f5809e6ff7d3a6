//! A session's folder as it is written: by one program at a time.

use crate::session::append::{AppendLog, LogFile};
use crate::session::clock;
use crate::session::entry::{Entry, PoseDone};
use crate::session::folder::{
    CALIBRATION, CALIBRATION_FIGURE, FRAMES, JOURNAL, PLAN, PROVENANCE, RIG, SessionFolder,
};
use crate::session::journal::{Journal, Lines};
use crate::session::provenance::SessionProvenance;
use crate::session::state::{Contradiction, SessionState};
use gonia_brdf::Pose;
use gonia_formats::plan_csv::write_plan_csv;
use gonia_formats::{FileError, check_writable, checksum, write_whole_bytes};
use gonia_pipeline::process::{Outcome, SampledFrame, sampled_bytes};
use gonia_protocol::crc32c;
use std::fs::{File, OpenOptions};
use std::path::{Component, Path, PathBuf};

/// Held while a capture runs.
const LOCK: &str = "lock";
/// Names in a session's folder that no file of a person's may have.
const OURS: [&str; 10] = [
    RIG,
    PLAN,
    PROVENANCE,
    JOURNAL,
    FRAMES,
    LOCK,
    "samples.npy",
    "samples.npy.toml",
    "masks.csv",
    "frames.csv",
];

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
    /// When the folder holds anything already, is in use, or cannot be written; or when the file's name
    /// leads out of the folder, or is that of a file of the session.
    pub fn new(folder: &Path, beside: Option<&str>) -> Result<Self, FileError> {
        if let Some(name) = beside {
            check_name(folder, name)?;
        }
        check_writable(folder)?;
        if let Err(error) = check_fresh(folder, beside) {
            // A session that another program is just beginning is in use, first of all.
            if folder.join(LOCK).is_file() {
                lock(folder)?;
            }
            return Err(error);
        }
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
        let table = beginning.beside.map(|(name, _)| folder.join(name));
        let provenance = SessionProvenance {
            rig_crc: checksum::of_file(&folder.join(RIG))?,
            plan_crc: checksum::of_file(&folder.join(PLAN))?,
            reference_crc: table.as_deref().map(checksum::of_file).transpose()?,
            began: clock::now(),
            ..beginning.provenance.clone()
        };
        for name in [JOURNAL, FRAMES] {
            open_file(&folder.join(name))?;
        }
        // Last, for with it the folder is a session; writing it syncs the folder and all names in it.
        provenance.write(&folder.join(PROVENANCE))?;
        SessionWriter::open(self.lock, &SessionFolder::open(folder)?)
    }
}

/// Appends to a session. The folder is locked until this is dropped, or its program dies.
#[derive(Debug)]
pub struct SessionWriter {
    folder: PathBuf,
    journal: Journal,
    frames: AppendLog,
    state: SessionState,
    _lock: Option<Lock>,
}

impl SessionWriter {
    /// Goes on with a session, and reads what is there. Whatever a killed program left behind the
    /// last whole line is cut off.
    ///
    /// # Errors
    /// As [`SessionFolder::open`], when the journal has lost lines, and when the folder is in use or
    /// cannot be written.
    pub fn resume(folder: &Path) -> Result<(Self, SessionFolder), FileError> {
        if !SessionFolder::is_session(folder) {
            // Says so in its own words.
            SessionFolder::open(folder)?;
        }
        let lock = lock(folder)?;
        let session = SessionFolder::open(folder)?;
        session.check_tail()?;
        Ok((Self::open(lock, &session)?, session))
    }

    fn open(lock: Lock, session: &SessionFolder) -> Result<Self, FileError> {
        let folder = session.folder();
        let journal = open_file(&folder.join(JOURNAL))?;
        let frames = open_file(&folder.join(FRAMES))?;
        let writer = Self::over(
            folder,
            (Box::new(journal), Box::new(frames)),
            &session.lines,
            session.state().clone(),
        )?;
        Ok(Self {
            _lock: Some(lock),
            ..writer
        })
    }

    /// Appends to a journal, whose lines so far are given with what they come to, and to the file of its
    /// frames.
    ///
    /// # Errors
    /// As [`Self::resume`].
    pub(super) fn over(
        folder: &Path,
        (journal, frames): (Box<dyn LogFile>, Box<dyn LogFile>),
        lines: &Lines,
        state: SessionState,
    ) -> Result<Self, FileError> {
        Ok(Self {
            folder: folder.to_owned(),
            journal: Journal::append_to(&folder.join(JOURNAL), journal, lines)?,
            frames: AppendLog::open(&folder.join(FRAMES), frames, state.frame_bytes())?,
            state,
            _lock: None,
        })
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What the session has come to.
    pub fn state(&self) -> &SessionState {
        &self.state
    }

    /// Keeps a frame: first itself, then its line in the journal, both on the disk when this
    /// returns.
    ///
    /// # Errors
    /// When the disk does not take it, or the pose is done already. The session on the disk is then as it
    /// was before.
    pub fn keep(&mut self, frame: &SampledFrame, pointing_deg: f64) -> Result<PoseDone, FileError> {
        let bytes = sampled_bytes::to_bytes(frame);
        let at = self.frames.length();
        let done = PoseDone {
            role: frame.report.role,
            index: frame.report.frame as usize,
            at,
            bytes: bytes.len() as u64,
            crc: crc32c(&bytes),
            pointing_deg,
            has_lines: Some(frame.report.outcome == Outcome::Locked),
        };
        let entry = Entry::Pose(done.clone());
        self.check(&entry)?;
        self.frames.append(&bytes)?;
        if let Err(error) = self.note(&entry) {
            self.frames.take_back(at);
            return Err(error);
        }
        Ok(done)
    }

    /// Writes a line into the journal.
    ///
    /// # Errors
    /// When the disk does not take it, or it contradicts the lines before it. The journal is then as it
    /// was.
    pub fn note(&mut self, entry: &Entry) -> Result<(), FileError> {
        self.check(entry)?;
        // As it will be read, so that who goes on has the same state.
        let entry = self.journal.write(entry)?;
        self.state
            .apply(&entry)
            .map_err(|error| self.contradicts(error))
    }

    fn check(&self, entry: &Entry) -> Result<(), FileError> {
        let checked = self.state.check(entry);
        checked.map_err(|error| self.contradicts(error))
    }

    fn contradicts(&self, contradiction: Contradiction) -> FileError {
        FileError::new(
            &self.folder.join(JOURNAL),
            contradiction,
            "please report this; --resume goes on",
        )
    }
}

/// Opens a file for writing, made if need be; what is in it stays.
fn open_file(path: &Path) -> Result<File, FileError> {
    let mut options = OpenOptions::new();
    let options = options.write(true).create(true).truncate(false);
    let file = options.open(path);
    file.map_err(|error| FileError::writing(path, &error))
}

/// Refuses the name of a table that would not lie in the session's folder, or in the place of a file of
/// its own.
fn check_name(folder: &Path, name: &str) -> Result<(), FileError> {
    let mut parts = Path::new(name).components();
    let is_plain = matches!(
        (parts.next(), parts.next()),
        (Some(Component::Normal(part)), None) if part == name
    );
    let is_ours = OURS.iter().any(|ours| ours.eq_ignore_ascii_case(name));
    if is_plain && !is_ours && !name.contains(['\\', ':']) {
        return Ok(());
    }
    Err(FileError::new(
        folder,
        format_args!("cannot keep a copy of the reference's table \"{name}\" under that name"),
        "put the table beside rig.toml under a plain name of its own, such as reference.csv, and name it so in [reference]",
    ))
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
        let item = item.map_err(failed)?;
        let name = item.file_name();
        let name = name.to_string_lossy();
        // Made before the provenance, and empty then.
        let is_log = [JOURNAL, FRAMES].contains(&&*name)
            && item
                .metadata()
                .is_ok_and(|log| log.is_file() && log.len() == 0);
        let ours = is_log
            || [RIG, PLAN, LOCK, CALIBRATION, CALIBRATION_FIGURE].contains(&&*name)
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
    use crate::session::some_frame::some_frame;
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
            reference_crc: None,
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
            let lines = text.rsplit_once('\n').map_or("", |(lines, _)| lines);
            let poses = lines.lines().filter(|l| l.contains(" pose ")).count();
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
        let of_a_child = writer._lock.as_ref().unwrap().0.try_clone().unwrap();
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

    #[test]
    fn without_its_journal_a_session_is_refused_and_its_frames_stay() {
        for (name, lost) in [
            ("is missing", None),
            ("lost lines", Some(0)),
            ("lost lines", Some(1)),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let mut writer = begin(folder.path());
            writer.note(&Entry::Start("now".into())).unwrap();
            for i in 0..3 {
                writer.keep(&some_frame(i, Role::Reference), 0.001).unwrap();
            }
            drop(writer);
            let path = folder.path().join(JOURNAL);
            let text = std::fs::read_to_string(&path).unwrap();
            std::fs::remove_file(&path).unwrap();
            if let Some(lines) = lost {
                let kept: String = text.split_inclusive('\n').take(lines).collect();
                std::fs::write(&path, kept).unwrap();
            }
            let frames = std::fs::read(folder.path().join(FRAMES)).unwrap();
            let error = SessionWriter::resume(folder.path())
                .unwrap_err()
                .to_string();
            assert!(
                error.contains("journal.log") && error.contains(name),
                "{error}"
            );
            assert_eq!(std::fs::read(folder.path().join(FRAMES)).unwrap(), frames);
        }
    }

    #[test]
    fn a_table_that_would_lie_outside_the_folder_or_over_a_file_of_it_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("session");
        for name in [
            "../x.csv",
            "/tmp/x.csv",
            "a/../../x.csv",
            "sub/x.csv",
            "..",
            "",
            "Plan.csv",
            "journal.log",
        ] {
            let error = Claim::new(&folder, Some(name)).unwrap_err().to_string();
            assert!(error.contains("[reference]"), "{name}: {error}");
        }
        assert!(!folder.exists());
        assert!(Claim::new(&folder, Some("white tile.csv")).is_ok());
    }

    #[test]
    fn a_table_that_has_changed_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut rig = Rig::paper(100);
        rig.reference = Some(gonia_rig::Reference::from(gonia_rig::Reflectance::Table {
            file: "tile.csv".into(),
            table: gonia_rig::ReflectanceTable::ByIncidence(Vec::new()),
        }));
        let rig = toml::to_string(&rig).unwrap();
        let up = Direction::from_deg(0.0, 0.0);
        let table = b"theta_i,r,g,b\n0,0.9,0.9,0.9\n80,0.9,0.9,0.8\n";
        let beginning = Beginning {
            rig: rig.as_bytes(),
            beside: Some(("tile.csv", table)),
            plan: &[Pose {
                light: up,
                view: up,
            }],
            provenance: &provenance(),
        };
        let claim = Claim::new(folder.path(), Some("tile.csv")).unwrap();
        drop(claim.begin(beginning).unwrap());
        assert!(SessionFolder::open(folder.path()).is_ok());
        let path = folder.path().join("tile.csv");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("0.8", "0.7")).unwrap();
        let error = SessionFolder::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("tile.csv: has changed since"), "{error}");
    }

    #[test]
    fn a_journal_of_an_older_program_goes_on_with_the_same_baseline() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = begin(folder.path());
        writer.note(&Entry::Start("now".into())).unwrap();
        for i in 1..4 {
            writer.keep(&some_frame(i, Role::Reference), 0.001).unwrap();
        }
        drop(writer);
        let path = folder.path().join(JOURNAL);
        let text = std::fs::read_to_string(&path).unwrap();
        let older = |line: &str| {
            let (line, _) = line.rsplit_once(" #").unwrap();
            let line = line.replace(" lines=seen", "");
            format!("{line} #{:08x}\n", crc32c(line.as_bytes()))
        };
        let older: String = text.lines().map(older).collect();
        assert!(!older.contains("lines="));
        std::fs::write(&path, older).unwrap();
        let (writer, session) = SessionWriter::resume(folder.path()).unwrap();
        let reference = writer.state().role(Role::Reference);
        assert_eq!(reference.baseline().map(|pose| pose.index), Some(1));
        assert_eq!(session.state(), writer.state());
        assert_eq!(reference.doubtful(), [1, 2, 3]);
    }
}
