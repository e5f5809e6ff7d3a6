//! Frames become samples while the arms move on: one thread fetches them from the camera, one registers,
//! samples and keeps them.

use crate::camera::{Camera, CameraError, Pulse};
use crate::capture::guard::unless_panics;
use crate::capture::watch::{SessionEvent, Watch};
use crate::session::{ControlComparison, SessionWriter};
use gonia_formats::FileError;
use gonia_formats::frame_exr::write_frame;
use gonia_imaging::{Registration, RegistrationFailure};
use gonia_pipeline::process::{FrameSampler, Hidden, Outcome, Refusal, SampledFrame};
use gonia_rig::{Frame, FrameRow, Role};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A pose to be taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Its place in the plan.
    pub index: usize,
    /// How often it was tried without a sample.
    pub tries: u32,
    /// Taken only to be compared with its first take.
    pub is_control: bool,
}

/// A shot that was triggered.
#[derive(Clone, Debug)]
pub struct Taken {
    /// Which.
    pub task: Task,
    /// What it is of, and where the arms were.
    pub row: FrameRow,
    /// Its trigger pulses.
    pub pulses: Vec<Pulse>,
    /// The largest |commanded − encoder|, degrees.
    pub pointing_deg: f64,
}

/// What the worker is sent.
pub enum Work {
    /// A frame. It is sampled, and kept only once it is confirmed.
    Frame(Taken, Frame),
    /// The last frame belongs to its trigger.
    Confirm,
    /// It may not: it is discarded.
    Discard,
}

/// How a fetch from the camera ended.
pub enum Fetched {
    /// With a frame.
    Frame,
    /// Without one.
    Nothing(CameraError),
}

/// What the arms' thread is sent.
pub enum WorkerEvent {
    /// The camera is free again.
    Fetched(Fetched),
    /// A pose is done.
    Kept,
    /// This program failed at the frame; with what it says.
    Spoilt(Task, String),
    /// The frame does not show its target; another take may. With the reason.
    Repeat(Task, String),
    /// Two takes show that the target lies turned; with what was found.
    TargetTurned(Task, String),
    /// The disk did not take it.
    NotKept(Task, FileError),
    /// The control pose was taken: how it compares with the first take; `None` when its fiducial lines are
    /// not seen, or it has no point in common with the first take.
    Control(Option<ControlComparison>),
    /// A frame shows the lines elsewhere than the calibrated rig has them, by more than its uncertainty: in
    /// words.
    RigMoved(String),
}

/// Lines that are so many standard deviations from where a calibrated rig has them show that it was moved.
const MOVED: f64 = 3.0;

/// That the rig was moved since it was calibrated, where a frame shows it.
fn moved(shot: &SampledShot) -> Option<String> {
    let what = match (shot.sampled.report.outcome, shot.registration.off) {
        (Outcome::Locked, Some(off)) if off.deviations > MOVED => format!(
            "the fiducial lines are {:.2} pixels from where its calibration has them, at {:.1} standard deviations of what calibration and arms leave open",
            off.px, off.deviations
        ),
        (Outcome::Refused(Refusal::NotTheTarget(why)), _) if is_elsewhere(why) => why.to_string(),
        _ => return None,
    };
    Some(format!(
        "the rig has moved since it was calibrated: {what}; find what came loose, and calibrate again"
    ))
}

/// Whether a frame shows the target, and elsewhere.
fn is_elsewhere(why: RegistrationFailure) -> bool {
    matches!(
        why,
        RegistrationFailure::Displaced { .. }
            | RegistrationFailure::Rolled { .. }
            | RegistrationFailure::Resized { .. }
            | RegistrationFailure::FarFromPose { .. }
    )
}

/// Fetches a frame for every shot.
pub fn fetch_all(
    camera: &Mutex<Box<dyn Camera>>,
    shots: &Receiver<Taken>,
    work: &SyncSender<Work>,
    events: &Sender<WorkerEvent>,
) {
    for taken in shots {
        // A camera that panics costs this frame; it is opened again.
        let fetch = || lock(camera).fetch(&taken.row, &taken.pulses);
        let fetched =
            unless_panics(fetch).unwrap_or_else(|why| Err(CameraError::Other(why.into())));
        let fetched = match fetched {
            Ok(frame) => {
                if work.send(Work::Frame(taken, frame)).is_err() {
                    return;
                }
                Fetched::Frame
            }
            Err(error) => Fetched::Nothing(error),
        };
        if events.send(WorkerEvent::Fetched(fetched)).is_err() {
            return;
        }
    }
}

/// A frame, and what it shows.
struct SampledShot {
    frame: Frame,
    registration: Registration,
    sampled: SampledFrame,
}

/// Samples and keeps frames.
pub struct FrameWorker<'a> {
    /// Of the session's rig.
    pub sampler: FrameSampler,
    /// Whether the reference's frames show what hides the target.
    pub has_reference: bool,
    /// Where samples go.
    pub writer: &'a Mutex<SessionWriter>,
    /// Where raw frames go, if they are kept.
    pub frames: Option<PathBuf>,
    /// Whether frames are for a calibration: they are kept whatever they show.
    pub is_calibration: bool,
    /// Whether the rig was calibrated: frames that contradict it are said.
    pub is_calibrated: bool,
    /// The first take of the control pose.
    pub baseline: Option<SampledFrame>,
    /// Who watches.
    pub watch: &'a dyn Watch,
}

impl FrameWorker<'_> {
    /// Works until all senders of work are gone.
    pub fn work(&mut self, work: &Receiver<Work>, events: &Sender<WorkerEvent>) {
        // Frames that are refused are many, once something has come loose.
        let mut is_said = false;
        let mut held: Option<(Taken, Result<SampledShot, String>)> = None;
        for item in work {
            match item {
                Work::Frame(taken, frame) => {
                    let shot = unless_panics(|| self.sample(&taken, frame));
                    held = Some((taken, shot));
                }
                Work::Discard => held = None,
                Work::Confirm => {
                    let Some((taken, shot)) = held.take() else {
                        continue;
                    };
                    let is_control = taken.task.is_control;
                    if let Ok(shot) = &shot
                        && self.is_calibrated
                        && (is_control || taken.task.tries > 0 && !is_said)
                        && let Some(what) = moved(shot)
                    {
                        is_said = true;
                        if events.send(WorkerEvent::RigMoved(what)).is_err() {
                            return;
                        }
                    }
                    let task = taken.task.clone();
                    let kept = shot.and_then(|shot| unless_panics(|| self.keep(taken, &shot)));
                    let event = kept.unwrap_or_else(|why| WorkerEvent::Spoilt(task, why));
                    if events.send(event).is_err() {
                        return;
                    }
                }
            }
        }
    }

    fn sample(&self, taken: &Taken, frame: Frame) -> SampledShot {
        let hidden = match taken.row.role {
            Role::Material if self.has_reference => Hidden::Known(None),
            _ => Hidden::Find,
        };
        let (sampled, registration) = self.sampler.sample_registered(&frame, &taken.row, hidden);
        SampledShot {
            frame,
            registration,
            sampled,
        }
    }

    fn keep(&mut self, taken: Taken, shot: &SampledShot) -> WorkerEvent {
        let SampledShot { frame, sampled, .. } = shot;
        self.show(&SessionEvent::Frame {
            frame,
            registration: &shot.registration,
            sampled,
        });
        let is_locked = sampled.report.outcome == Outcome::Locked;
        if taken.task.is_control {
            let first = self.baseline.as_ref().filter(|_| is_locked);
            let comparison = first.and_then(|first| ControlComparison::of(first, sampled));
            return WorkerEvent::Control(comparison);
        }
        if let Outcome::Refused(refusal) = sampled.report.outcome
            && !self.is_calibration
        {
            if taken.task.tries == 0 {
                return WorkerEvent::Repeat(taken.task, refusal.to_string());
            }
            // A whole night of it would be of no use.
            if let Refusal::NotTheTarget(why @ RegistrationFailure::TargetTurned(_)) = refusal {
                return WorkerEvent::TargetTurned(taken.task, why.to_string());
            }
        }
        if let Some(folder) = &self.frames
            && let Err(error) = write_frame(&folder.join(&taken.row.file), frame)
        {
            return WorkerEvent::NotKept(taken.task, error);
        }
        let kept = lock(self.writer).keep(sampled, taken.pointing_deg);
        match kept {
            Err(error) => WorkerEvent::NotKept(taken.task, error),
            Ok(done) => {
                if self.baseline.is_none() && is_locked {
                    self.baseline = Some(sampled.clone());
                }
                self.show(&SessionEvent::Pose {
                    done: &done,
                    frame: sampled,
                });
                WorkerEvent::Kept
            }
        }
    }

    /// A watcher that fails costs no frame.
    fn show(&self, event: &SessionEvent) {
        let _ = unless_panics(|| self.watch.on_event(event));
    }
}

/// Locks also what a thread held that panicked.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
