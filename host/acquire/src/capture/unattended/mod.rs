//! A session that runs without a person: it recovers from faults automatically, and otherwise ends
//! cleanly, with its reason in the journal.

mod conditions;
mod control_pose;
mod role_run;

use crate::camera::Camera;
use crate::capture::arms::Arms;
use crate::capture::coordinator::Halt;
use crate::capture::frame_worker::lock;
use crate::capture::orders::Orders;
use crate::capture::shooter::{SessionSummary, Shooter};
use crate::capture::watch::{SessionEvent, Watch};
use crate::session::{CHANGE_THE_SAMPLE, Entry, SessionEnd, SessionFolder, SessionWriter};
use gonia_formats::FileError;
use gonia_pipeline::process::{Outcome, SampledFrame};
use gonia_rig::{Rig, Role, SessionSettings};
use role_run::{RoleRun, Totals};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// A session over the poses of a folder that are missing, and all that it needs beside arms and camera.
pub struct UnattendedSession<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Its settings.
    pub settings: &'a SessionSettings,
    /// Where raw frames are kept, if they are: below this folder.
    pub keep_frames: Option<PathBuf>,
    /// The commanded pose stands for the arms' reading, so that every take of a pose is the same.
    pub exact: bool,
    /// A person's orders.
    pub orders: &'a Orders,
    /// Who watches.
    pub watch: &'a dyn Watch,
    /// Room on the disk of a folder, MB: [`free_mb`](super::free_mb), or a test's own.
    pub free_mb: &'a (dyn Fn(&Path) -> Option<u64> + Sync),
}

/// How it ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// In which state.
    pub end: SessionEnd,
    /// Why.
    pub reason: String,
    /// What the arms did.
    pub arms: SessionSummary,
    /// Shots taken again because of the camera or the disk.
    pub retaken: u32,
    /// Time by the host's clock.
    pub took: Duration,
    /// Of that, in which the session paused.
    pub paused: Duration,
    /// Of that, in which the arms waited for the host.
    pub waited: Duration,
}

impl UnattendedSession<'_> {
    /// Takes all poses that are missing.
    ///
    /// # Errors
    /// When the folder cannot be read, or the journal's last line not be written.
    pub fn run(
        &self,
        arms: &mut Arms,
        camera: Box<dyn Camera>,
        writer: SessionWriter,
        session: &SessionFolder,
    ) -> Result<Ended, FileError> {
        let began = Instant::now();
        let camera = Mutex::new(camera);
        let writer = Mutex::new(writer);
        let mut shooter = Shooter::new(arms);
        let mut totals = Totals::default();
        let mut result = self.home(&mut shooter);
        for role in session.roles() {
            let missing = session.missing(*role);
            if result.is_err() || missing.is_empty() {
                continue;
            }
            let baseline = baseline_of(session, *role)?;
            let changed = *role == Role::Reference
                || baseline.is_some()
                || !session.provenance().reference
                || has_awaited_material(session);
            if !changed && !lock(&camera).changes_the_sample() {
                result = Err(Halt::AwaitsMaterial);
                continue;
            }
            self.watch.on_event(&SessionEvent::Begin {
                role: *role,
                missing: &missing,
                planned: session.plan().len(),
            });
            let run = RoleRun {
                session: self,
                plan: session.plan(),
                role: *role,
                has_reference: session.provenance().reference,
            };
            result = run.measure(
                &mut shooter,
                (&camera, &writer),
                (missing, baseline),
                &mut totals,
            );
        }
        let (end, reason) = how_it_ended(&result, totals.given_up);
        if matches!(result, Err(Halt::Stopped(_))) {
            // They have been stopped already; this is for a stop that did not arrive.
            let _ = shooter.arms().stop();
        } else if matches!(end, SessionEnd::Finished | SessionEnd::Failed)
            && let Some(first) = session.plan().first()
        {
            // A fault that ended the session may forbid it; then they stay where they are.
            let _ = shooter.park(first);
        }
        let took = began.elapsed();
        let ended = Ended {
            end,
            reason,
            retaken: totals.retaken,
            took,
            paused: totals.paused,
            waited: took.saturating_sub(shooter.busy() + totals.paused),
            arms: shooter.finish(),
        };
        lock(&writer).note(&Entry::Stop(end, ended.reason.clone()))?;
        Ok(ended)
    }

    fn home(&self, shooter: &mut Shooter) -> Result<(), Halt> {
        shooter.take_up().map_err(|error| {
            if self.orders.ends() {
                return Halt::Stopped(format!("{}, while homing", self.orders.ended_by()));
            }
            Halt::Failed(error.to_string())
        })
    }
}

/// The state in which a session ends, and the reason, for people.
fn how_it_ended(result: &Result<(), Halt>, given_up: usize) -> (SessionEnd, String) {
    match result {
        Ok(()) if given_up > 0 => (
            SessionEnd::Failed,
            format!("{given_up} poses could not be reached"),
        ),
        Ok(()) => (SessionEnd::Finished, "every pose is done".to_owned()),
        Err(Halt::Paused(why) | Halt::Stopped(why)) => (SessionEnd::Paused, why.clone()),
        Err(Halt::AwaitsMaterial) => (SessionEnd::AwaitsMaterial, CHANGE_THE_SAMPLE.to_owned()),
        Err(Halt::Failed(why)) => (SessionEnd::Failed, why.clone()),
    }
}

/// Whether a session ended once so that a person would change the sample. One that was killed between
/// reference and material did not.
fn has_awaited_material(session: &SessionFolder) -> bool {
    let awaits = |entry: &Entry| matches!(entry, Entry::Stop(SessionEnd::AwaitsMaterial, _));
    session.journal().iter().any(awaits)
}

/// The first pose whose fiducial lines were seen, and its frame.
fn baseline_of(
    session: &SessionFolder,
    role: Role,
) -> Result<Option<(usize, SampledFrame)>, FileError> {
    for pose in session.done().filter(|pose| pose.role == role) {
        let frame = session.frame(pose)?;
        if frame.report.outcome == Outcome::Locked {
            return Ok(Some((pose.index, frame)));
        }
    }
    Ok(None)
}
