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
use crate::session::{
    CHANGE_THE_SAMPLE, Entry, SessionEnd, SessionFolder, SessionState, SessionWriter,
};
use gonia_brdf::Pose;
use gonia_formats::FileError;
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
    /// The frames are for a calibration of the rig: only what lies on the target first is taken, and frames are
    /// kept whether or not they show the target where the rig has it.
    pub is_calibration: bool,
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
    /// When the journal's last line cannot be written.
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
        let roles = self.roles(session);
        for role in roles {
            let (missing, baseline, is_complete) = {
                let writer = lock(&writer);
                let state = writer.state();
                let baseline = state.role(*role).baseline().cloned();
                (state.to_measure(*role), baseline, state.is_complete(*role))
            };
            if result.is_err() || is_complete {
                continue;
            }
            let baseline = match baseline.map(|pose| session.frame(&pose)).transpose() {
                Ok(frame) => frame,
                Err(error) => {
                    result = Err(Halt::Failed(error.to_string()));
                    continue;
                }
            };
            let changed = *role == Role::Reference
                || baseline.is_some()
                || !session.provenance().reference
                || lock(&writer).state().has_awaited_material();
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
            // While the reference still lies there.
            let is_last = roles.last() == Some(role);
            if result.is_ok() && !is_last && !lock(&camera).changes_the_sample() {
                result = if_none_is_given_up(lock(&writer).state(), &[Role::Reference]);
            }
        }
        let result = result.and_then(|()| if_none_is_given_up(lock(&writer).state(), roles));
        let (end, reason) = how_it_ended(&result);
        rest_arms(&mut shooter, &result, session.plan().first());
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

    /// What is taken, in this order.
    fn roles(&self, session: &SessionFolder) -> &'static [Role] {
        let all = session.roles();
        match (self.is_calibration, all.split_first()) {
            (true, Some((first, _))) => std::slice::from_ref(first),
            _ => all,
        }
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

/// Leaves the arms where a session that ended so leaves them: at its first pose, or where they are.
fn rest_arms(shooter: &mut Shooter, result: &Result<(), Halt>, first: Option<&Pose>) {
    match (result, first) {
        (Err(Halt::Stopped(_)), _) => {
            // They have been stopped already; this is for a stop that did not arrive.
            let _ = shooter.arms().stop();
        }
        (Ok(()) | Err(Halt::Failed(_)), Some(first)) => {
            // A fault that ended the session may forbid it; then they stay where they are.
            let _ = shooter.park(first);
        }
        _ => {}
    }
}

/// A session does not finish without poses that nobody left out.
fn if_none_is_given_up(state: &SessionState, roles: &[Role]) -> Result<(), Halt> {
    let missing: usize = roles
        .iter()
        .map(|role| {
            let is_left_out = |index: &usize| state.role(*role).is_left_out(*index);
            let missing = state.missing(*role);
            missing.iter().filter(|index| !is_left_out(index)).count()
        })
        .sum();
    match missing {
        0 => Ok(()),
        _ => Err(Halt::Failed(format!(
            "{missing} poses could not be reached: --resume tries them again, --resume --leave-out POSE,… goes on without them"
        ))),
    }
}

/// The state in which a session ends, and the reason, for people.
fn how_it_ended(result: &Result<(), Halt>) -> (SessionEnd, String) {
    match result {
        Ok(()) => (SessionEnd::Finished, "every pose is done".to_owned()),
        Err(Halt::Paused(why) | Halt::Stopped(why)) => (SessionEnd::Paused, why.clone()),
        Err(Halt::AwaitsMaterial) => (SessionEnd::AwaitsMaterial, CHANGE_THE_SAMPLE.to_owned()),
        Err(Halt::Failed(why)) => (SessionEnd::Failed, why.clone()),
    }
}
