//! Where frames become samples while the arms move on: one thread fetches them from the camera, one
//! registers, samples and keeps them.

use crate::camera::{Camera, CameraError, Pulse};
use crate::capture::control::Comparison;
use crate::capture::watch::{Told, Watch};
use crate::session::{PoseDone, SessionWriter};
use gonia_formats::FileError;
use gonia_formats::frame_exr::write_frame;
use gonia_imaging::Registration;
use gonia_pipeline::process::{FrameSampler, Hidden, Outcome, SampledFrame};
use gonia_rig::{Frame, FrameRow, Role};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A pose to be taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// Its place in the plan.
    pub index: usize,
    /// How often it was tried in vain.
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

/// What the desk is given.
pub enum Work {
    /// A frame. It is sampled, and kept only once it is confirmed.
    Frame(Taken, Frame),
    /// The last frame belongs to its trigger.
    Confirm,
    /// It may not.
    Void,
}

/// What the arms' thread is told.
pub enum News {
    /// The camera is free again, and gave a frame or not.
    Camera(Result<(), CameraError>),
    /// A pose is done. The flag: it is what control poses are compared with from now on.
    Kept(PoseDone, bool),
    /// The frame does not show its target; another take may.
    Again(Task, String),
    /// The disk did not take it.
    NotKept(Task, FileError),
    /// How the control pose compares; `None` when it shows nothing to compare.
    Compared(Option<Comparison>),
}

/// Fetches a frame for every shot.
pub fn fetch_all(
    camera: &Mutex<Box<dyn Camera>>,
    shots: &Receiver<Taken>,
    work: &SyncSender<Work>,
    news: &Sender<News>,
) {
    for taken in shots {
        let fetched = lock(camera).fetch(&taken.row, &taken.pulses);
        let told = match fetched {
            Ok(frame) => {
                if work.send(Work::Frame(taken, frame)).is_err() {
                    return;
                }
                Ok(())
            }
            Err(error) => Err(error),
        };
        if news.send(News::Camera(told)).is_err() {
            return;
        }
    }
}

/// A frame, and what it shows.
struct Looked {
    frame: Frame,
    registration: Registration,
    sampled: SampledFrame,
}

/// Samples and keeps frames.
pub struct Desk<'a> {
    /// Of the session's rig.
    pub sampler: FrameSampler,
    /// Whether the reference's frames tell what hides the target.
    pub has_reference: bool,
    /// Where samples go.
    pub writer: &'a Mutex<SessionWriter>,
    /// Where raw frames go, if they are kept.
    pub frames: Option<PathBuf>,
    /// The first take of the control pose.
    pub baseline: Option<SampledFrame>,
    /// Who watches.
    pub watch: &'a dyn Watch,
}

impl Desk<'_> {
    /// Works until there is no more work.
    pub fn work(&mut self, work: &Receiver<Work>, news: &Sender<News>) {
        let mut held: Option<(Taken, Looked)> = None;
        for item in work {
            match item {
                Work::Frame(taken, frame) => {
                    let hidden = match taken.row.role {
                        Role::Material if self.has_reference => Hidden::Known(None),
                        _ => Hidden::Find,
                    };
                    let (sampled, registration) =
                        self.sampler.sample_registered(&frame, &taken.row, hidden);
                    let looked = Looked {
                        frame,
                        registration,
                        sampled,
                    };
                    held = Some((taken, looked));
                }
                Work::Void => held = None,
                Work::Confirm => {
                    if let Some((taken, looked)) = held.take()
                        && news.send(self.take_in(taken, &looked)).is_err()
                    {
                        return;
                    }
                }
            }
        }
    }

    fn take_in(&mut self, taken: Taken, looked: &Looked) -> News {
        let Looked { frame, sampled, .. } = looked;
        self.watch.tell(&Told::Frame {
            frame,
            registration: &looked.registration,
            sampled,
        });
        let is_locked = sampled.report.outcome == Outcome::Locked;
        if taken.task.is_control {
            let first = self.baseline.as_ref().filter(|_| is_locked);
            return News::Compared(first.and_then(|first| Comparison::of(first, sampled)));
        }
        if let Outcome::Refused(refusal) = sampled.report.outcome
            && taken.task.tries == 0
        {
            return News::Again(taken.task, refusal.to_string());
        }
        if let Some(folder) = &self.frames
            && let Err(error) = write_frame(&folder.join(&taken.row.file), frame)
        {
            return News::NotKept(taken.task, error);
        }
        let kept = lock(self.writer).keep(sampled, taken.pointing_deg);
        match kept {
            Err(error) => News::NotKept(taken.task, error),
            Ok(done) => {
                let is_baseline = self.baseline.is_none() && is_locked;
                if is_baseline {
                    self.baseline = Some(sampled.clone());
                }
                self.watch.tell(&Told::Pose {
                    done: &done,
                    frame: sampled,
                });
                News::Kept(done, is_baseline)
            }
        }
    }
}

/// A thread that panicked elsewhere does not make the other's things unusable.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
