//! Whether a session is what it says.

use crate::session::entry::{Entry, SessionEnd};
use crate::session::folder::{FRAMES, JOURNAL, SessionFolder};
use gonia_formats::FileError;
use gonia_formats::frames_csv::read_frames_csv;
use gonia_imaging::SamplingGrid;
use std::path::Path;

/// What was found in a session.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// Poses that should be done in the end, of all roles.
    pub planned: usize,
    /// Poses that are.
    pub done: usize,
    /// Times that a program took it up.
    pub starts: usize,
    /// Starts that no stop followed: kills and power cuts.
    pub kills: usize,
    /// Bytes of all sampled frames.
    pub frame_bytes: u64,
    /// The largest pointing error of a pose, degrees.
    pub max_pointing_deg: f64,
    /// How the last program left it.
    pub end: Option<(SessionEnd, String)>,
    /// What is broken, or worth knowing.
    pub findings: Vec<Finding>,
}

/// Something found.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// Harmless, and taken care of by the next `--resume`.
    Note(String),
    /// Broken: what, where, what to do.
    Broken(FileError),
}

impl Verdict {
    /// What is broken.
    pub fn broken(&self) -> impl Iterator<Item = &FileError> {
        self.findings.iter().filter_map(|finding| match finding {
            Finding::Broken(error) => Some(error),
            Finding::Note(_) => None,
        })
    }
}

/// Checks checksums, that every pose is done once and has its samples, and the provenance.
///
/// # Errors
/// When so much is broken that the rest cannot be looked at: see [`SessionFolder::open`].
pub fn verify(folder: &Path) -> Result<Verdict, FileError> {
    let session = SessionFolder::open(folder)?;
    let mut findings = Vec::new();
    if session.lines.torn_bytes > 0 {
        findings.push(Finding::Note(format!(
            "{JOURNAL}: the last {} bytes are the start of a line whose program died",
            session.lines.torn_bytes
        )));
    }
    let n_points = SamplingGrid::new(session.rig()).points_mm().len();
    for pose in session.done() {
        match session.frame(pose) {
            Err(error) => findings.push(Finding::Broken(error)),
            Ok(frame) if !frame.points.is_empty() && frame.points.len() != n_points => {
                let error = FileError::new(
                    &folder.join(FRAMES),
                    format_args!(
                        "has {} points where the rig's grid has {n_points}",
                        frame.points.len()
                    ),
                    "this frame is of another rig; measure the session anew",
                );
                let place = format!("{} pose {}", pose.role.name(), pose.index);
                findings.push(Finding::Broken(error.at(place)));
            }
            Ok(_) => {}
        }
    }
    let there = std::fs::metadata(folder.join(FRAMES)).map_or(0, |m| m.len());
    let frame_bytes = session.state().frame_bytes();
    if let Err(error) = session.check_tail() {
        findings.push(Finding::Broken(error));
    } else if there > frame_bytes {
        findings.push(Finding::Note(format!(
            "{FRAMES}: the last {} bytes are a frame whose program died",
            there - frame_bytes
        )));
    }
    check_kept_frames(&session, &mut findings);
    check_end(&session, &mut findings);
    let entries = session.journal();
    let starts = entries
        .iter()
        .filter(|e| matches!(e, Entry::Start(_)))
        .count();
    let stops = entries
        .iter()
        .filter(|e| matches!(e, Entry::Stop(..)))
        .count();
    let still = usize::from(session.end().is_none());
    Ok(Verdict {
        planned: session.roles().len() * session.plan().len(),
        done: session.done().count(),
        starts,
        kills: starts.saturating_sub(stops + still),
        frame_bytes,
        max_pointing_deg: session.done().map(|p| p.pointing_deg).fold(0.0, f64::max),
        end: session.end().map(|(end, reason)| (end, reason.to_owned())),
        findings,
    })
}

/// What is left to do, and whether the session says that nothing is.
fn check_end(session: &SessionFolder, findings: &mut Vec<Finding>) {
    let path = session.folder().join(JOURNAL);
    let missing: usize = session
        .roles()
        .iter()
        .map(|r| session.state().to_measure(*r).len())
        .sum();
    let left_out: usize = session
        .roles()
        .iter()
        .map(|r| session.state().role(*r).given_up())
        .sum();
    if left_out > 0 {
        findings.push(Finding::Note(format!("{left_out} poses are given up")));
    }
    if let Some((SessionEnd::Finished, _)) = session.end()
        && missing > 0
    {
        findings.push(Finding::Broken(FileError::new(
            &path,
            format_args!("says finished, and {missing} poses are missing"),
            "go on with gonia capture --resume",
        )));
    }
    let doubtful = doubtful(session);
    if let Some((SessionEnd::Finished, _)) = session.end()
        && doubtful > 0
    {
        findings.push(Finding::Broken(FileError::new(
            &path,
            format_args!("says finished, and no good control pose stands behind {doubtful} poses"),
            "go on with gonia capture --resume: it takes the control pose",
        )));
    }
}

/// Poses that a control pose could vouch for, and none does.
fn doubtful(session: &SessionFolder) -> usize {
    let roles = session.roles().iter().map(|r| session.state().role(*r));
    let unvouched = roles.filter(|role| role.baseline().is_some());
    unvouched.map(|role| role.doubtful().len()).sum()
}

/// Raw frames, where they are kept.
fn check_kept_frames(session: &SessionFolder, findings: &mut Vec<Finding>) {
    let path = session.folder().join("frames.csv");
    if !path.exists() {
        return;
    }
    match read_frames_csv(&path) {
        Err(error) => findings.push(Finding::Broken(error)),
        Ok(list) => {
            for row in list.rows {
                if !session.folder().join(&row.file).is_file() {
                    let error = FileError::new(
                        &path,
                        format_args!("there is no file \"{}\"", row.file),
                        "restore it; the samples do not need it",
                    );
                    findings.push(Finding::Broken(error));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::folder::PROVENANCE;
    use crate::session::some_frame::some_frame;
    use crate::session::writer::tests::begin;
    use gonia_rig::Role;

    #[test]
    fn a_damaged_frame_is_named_and_the_others_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = begin(folder.path());
        writer.note(&Entry::Start("now".into())).unwrap();
        for i in 0..3 {
            let mut frame = some_frame(i, Role::Reference);
            frame.points.clear();
            writer.keep(&frame, 0.002).unwrap();
        }
        writer
            .note(&Entry::Stop(SessionEnd::Paused, "by hand".into()))
            .unwrap();
        drop(writer);
        let verdict = verify(folder.path()).unwrap();
        assert_eq!(verdict.findings, []);
        assert_eq!((verdict.planned, verdict.done, verdict.kills), (10, 3, 0));

        let path = folder.path().join(FRAMES);
        let mut bytes = std::fs::read(&path).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 4;
        bytes.extend([1, 2, 3]);
        std::fs::write(&path, bytes).unwrap();
        let verdict = verify(folder.path()).unwrap();
        let broken: Vec<String> = verdict.broken().map(ToString::to_string).collect();
        assert_eq!(broken.len(), 1, "{broken:?}");
        assert!(broken[0].contains("frames.bin, reference pose 1: is damaged"));
        assert!(
            verdict
                .findings
                .iter()
                .any(|f| matches!(f, Finding::Note(n) if n.contains("3 bytes")))
        );

        std::fs::write(folder.path().join(PROVENANCE), "program = 1").unwrap();
        let error = verify(folder.path()).unwrap_err().to_string();
        assert!(error.contains("provenance.toml, line 1"), "{error}");
    }
}
