//! A session that runs by itself for a day: what can be recovered is recovered automatically, and what cannot ends
//! it in good order, with its reason in the journal.

use super::accounts::{Accounts, Halt};
use super::arms::{Arms, HomeError};
use super::control::{Comparison, Judgement};
use super::desk::{Desk, Taken, Task, fetch_all, lock};
use super::orders::Orders;
use super::session::{SessionError, SessionSummary, Shooter, ShotOutcome};
use super::watch::{Told, Watch};
use crate::camera::{Camera, Pulse};
use crate::dataset::bench_setup::SessionSettings;
use crate::dataset::{FileError, FrameRow, Rig, Role};
use crate::process::{FrameSampler, Outcome, SampledFrame};
use crate::session::{End, Entry, SessionFolder, SessionWriter};
use gonia_brdf::Pose;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, mpsc};
use std::time::{Duration, Instant};

/// Frames between camera and desk: all that a session keeps in memory of them.
const FRAMES_IN_MEMORY: usize = 2;
/// How often a pose that the arms do not reach comes round again.
const ROUNDS: u32 = 2;
/// Arms that are held listen to orders this often.
const LISTEN_EVERY: Duration = Duration::from_millis(50);

/// Why a session ends between reference and material.
const CHANGE_THE_SAMPLE: &str =
    "the reference is measured: put the material on the target and go on with --resume";

/// What a session needs to know.
pub struct Capture<'a> {
    /// The rig.
    pub rig: &'a Rig,
    /// Its settings.
    pub settings: &'a SessionSettings,
    /// Where raw frames are kept, if they are: below this folder.
    pub keep_frames: Option<PathBuf>,
    /// The commanded pose stands for the arms' reading, so that every take of a pose is the same.
    pub exact: bool,
    /// What a person wants.
    pub orders: &'a Orders,
    /// Who watches.
    pub watch: &'a dyn Watch,
    /// Says how much room the disk of a folder has, MB; [`free_mb`](super::free_mb) does.
    pub free_mb: &'a (dyn Fn(&Path) -> Option<u64> + Sync),
}

/// How it ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// In which state.
    pub end: End,
    /// Why.
    pub reason: String,
    /// What the arms did.
    pub arms: SessionSummary,
    /// Shots taken again for the camera's or the disk's sake.
    pub retaken: u32,
    /// Time by the host's clock.
    pub took: Duration,
    /// In which the session waited for something to pass.
    pub paused: Duration,
    /// In which the arms waited for the host.
    pub waited: Duration,
}

impl Capture<'_> {
    /// Takes all poses that are missing.
    ///
    /// # Errors
    /// When the folder cannot be read, or its journal not be ended.
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
                || was_told_to_change(session);
            if !changed && !lock(&camera).changes_the_sample() {
                result = Err(Halt::Paused(CHANGE_THE_SAMPLE.into()));
                continue;
            }
            self.watch.tell(&Told::Begin {
                role: *role,
                missing: &missing,
                planned: session.plan().len(),
            });
            let measuring = Measuring {
                capture: self,
                plan: session.plan(),
                role: *role,
                has_reference: session.provenance().reference,
            };
            result = measuring.run(
                &mut shooter,
                (&camera, &writer),
                (missing, baseline),
                &mut totals,
            );
        }
        let (end, reason) = match &result {
            Ok(()) if totals.given_up > 0 => (
                End::Failed,
                format!("{} poses could not be reached", totals.given_up),
            ),
            Ok(()) => (End::Finished, "every pose is done".to_owned()),
            Err(Halt::Paused(why) | Halt::Stopped(why)) => (End::Paused, why.clone()),
            Err(Halt::Failed(why)) => (End::Failed, why.clone()),
        };
        if matches!(result, Err(Halt::Stopped(_))) {
            // They were told to already; this is for the case that it was not heard.
            let _ = shooter.arms().stop();
        } else if end != End::Paused
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

/// Whether a session ended once so that somebody would change the sample. One that was killed between
/// reference and material did not.
fn was_told_to_change(session: &SessionFolder) -> bool {
    let is_order = |entry: &Entry| matches!(entry, Entry::Stop(_, why) if why == CHANGE_THE_SAMPLE);
    session.journal().iter().any(is_order)
}

#[derive(Default)]
struct Totals {
    given_up: usize,
    retaken: u32,
    paused: Duration,
}

/// The first pose whose marks were seen, and its frame.
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

/// One role of a session.
pub(super) struct Measuring<'a> {
    pub(super) capture: &'a Capture<'a>,
    plan: &'a [Pose],
    role: Role,
    has_reference: bool,
}

impl Measuring<'_> {
    fn run(
        &self,
        shooter: &mut Shooter,
        (camera, writer): (&Mutex<Box<dyn Camera>>, &Mutex<SessionWriter>),
        (missing, baseline): (Vec<usize>, Option<(usize, SampledFrame)>),
        totals: &mut Totals,
    ) -> Result<(), Halt> {
        let settings = self.capture.settings;
        let (shots, to_fetch) = mpsc::channel();
        let (work, to_do) = mpsc::sync_channel(FRAMES_IN_MEMORY);
        let (tell, news) = mpsc::channel();
        let mut accounts = Accounts::new(
            camera,
            writer,
            self.capture.watch,
            self.capture.orders,
            (shots, work.clone(), news),
            settings.exposures_s.len(),
            (
                settings.max_retries,
                Duration::from_secs_f64(settings.pause_s),
            ),
        );
        accounts.control = baseline.as_ref().map(|(index, _)| *index);
        accounts.queue.extend(missing.into_iter().map(|index| Task {
            index,
            tries: 0,
            is_control: false,
        }));
        let mut desk = Desk {
            sampler: FrameSampler::new(self.capture.rig),
            has_reference: self.has_reference,
            writer,
            frames: self.capture.keep_frames.clone(),
            baseline: baseline.map(|(_, frame)| frame),
            watch: self.capture.watch,
        };
        std::thread::scope(|scope| {
            let tell_too = tell.clone();
            scope.spawn(move || {
                fetch_all(camera, &to_fetch, &work, &tell_too);
            });
            scope.spawn(move || desk.work(&to_do, &tell));
            let mut result = self.take_all(shooter, &mut accounts, totals);
            if let Err(Halt::Paused(_)) = result {
                // The last frame is as good as any.
                result = accounts.settle().and(result);
            }
            let result = accounts.clear_desk().and(result);
            totals.retaken += accounts.retaken;
            totals.paused += accounts.paused;
            // With the accounts their channels end, and so do the threads.
            drop(accounts);
            result
        })
    }

    fn take_all(
        &self,
        shooter: &mut Shooter,
        accounts: &mut Accounts,
        totals: &mut Totals,
    ) -> Result<(), Halt> {
        let mut good_line = lock(accounts.writer).next_line();
        if accounts.control.is_some() {
            self.check_control(shooter, accounts, good_line)?;
        }
        let mut look_us = 0;
        loop {
            accounts.listen()?;
            self.obey(shooter, accounts)?;
            self.wait_for_room(shooter, accounts)?;
            let was_out = self.wait_for_temperature(shooter, accounts, &mut look_us)?;
            // What it has done to the lamp, the control pose tells.
            let due =
                was_out || accounts.since_control.len() >= self.capture.settings.control_every;
            if due || accounts.queue.is_empty() {
                accounts.settle()?;
                accounts.clear_desk()?;
                // Frames that came to nothing are in the queue again.
                if !due && !accounts.queue.is_empty() {
                    continue;
                }
                // Also the last poses have a control behind them.
                if !accounts.since_control.is_empty() {
                    self.check_control(shooter, accounts, good_line)?;
                    accounts.since_control.clear();
                    good_line = lock(accounts.writer).next_line();
                }
            }
            let Some(task) = accounts.queue.pop_front() else {
                return Ok(());
            };
            self.shoot(shooter, accounts, task, totals)?;
        }
    }

    /// What a person wants.
    pub(super) fn obey(&self, shooter: &mut Shooter, accounts: &mut Accounts) -> Result<(), Halt> {
        let orders = self.capture.orders;
        if orders.is_held() {
            // Held is said when nothing is under way any more: whoever switches the camera off then
            // loses no frame.
            accounts.settle()?;
            accounts.clear_desk()?;
            accounts.event("held by hand");
            accounts.watch.tell(&Told::Held(true));
            let began = Instant::now();
            while orders.is_held() && !orders.ends() {
                std::thread::sleep(LISTEN_EVERY);
                // What the controllers say meanwhile is read; what is wrong with them comes out at
                // the next move.
                let _ = shooter.arms().light().rest(1);
                let _ = shooter.arms().camera().rest(1);
            }
            accounts.paused += began.elapsed();
            accounts.watch.tell(&Told::Held(false));
            accounts.event("goes on");
        }
        if orders.stops() {
            // Here the arms rest; the stop makes them stay.
            let _ = shooter.arms().stop();
            return Err(Halt::Stopped("by a second Ctrl-C".into()));
        }
        if orders.ends() {
            return Err(Halt::Paused(orders.ended_by().into()));
        }
        Ok(())
    }

    /// Moves, triggers, and hands the shot over.
    fn shoot(
        &self,
        shooter: &mut Shooter,
        accounts: &mut Accounts,
        task: Task,
        totals: &mut Totals,
    ) -> Result<(), Halt> {
        let Some(pose) = self.plan.get(task.index) else {
            return Ok(());
        };
        self.capture.watch.tell(&Told::Going { index: task.index });
        let mut halt = None;
        let taken = shooter.take(task.index, pose, &mut || {
            accounts.before_trigger().map_err(|why| {
                halt = Some(why);
                SessionError::Taker {
                    index: task.index,
                    reason: String::new(),
                }
            })
        });
        match (taken, halt) {
            (_, Some(halt)) => Err(halt),
            (Ok(ShotOutcome::Kept(shot)), None) => {
                let file = format!("frames/{}_{:06}.exr", self.role.name(), task.index);
                let row = FrameRow {
                    frame: task.index as u32,
                    role: self.role,
                    pose: if self.capture.exact {
                        *pose
                    } else {
                        shot.encoder
                    },
                    file,
                };
                let times = self.capture.settings.exposures_s.iter();
                let pulses = times.zip(&shot.pulse_times_us);
                accounts.triggered(Taken {
                    task,
                    row,
                    pulses: pulses.map(|(s, us)| Pulse::new(*s, *us)).collect(),
                    pointing_deg: shot.pointing_error_deg,
                })
            }
            (Ok(ShotOutcome::Refused { reason, .. }), None) => {
                let text = format!("{} pose {}: {reason}", self.role.name(), task.index);
                if task.is_control {
                    accounts.event(&text);
                    accounts.again(task, &text)?;
                } else if task.tries + 1 < ROUNDS {
                    accounts.event(&text);
                    let tries = task.tries + 1;
                    accounts.queue.push_back(Task { tries, ..task });
                } else {
                    accounts.watch.tell(&Told::GivenUp {
                        index: task.index,
                        why: &text,
                    });
                    let _ = lock(accounts.writer).note(&Entry::GivenUp(text));
                    totals.given_up += 1;
                }
                Ok(())
            }
            (Err(SessionError::Arms { source, .. }), None) => {
                self.mend(shooter, accounts, source)?;
                accounts.again(task, "the arms had failed")
            }
            (Err(other), None) => Err(Halt::Failed(other.to_string())),
        }
    }

    /// Brings arms back that a shot's own tries could not.
    fn mend(
        &self,
        shooter: &mut Shooter,
        accounts: &mut Accounts,
        mut why: HomeError,
    ) -> Result<(), Halt> {
        for _ in 0..self.capture.settings.max_retries {
            if self.capture.orders.stops() {
                return Err(Halt::Stopped("by a second Ctrl-C".into()));
            }
            if matches!(why, HomeError::Stopped(_) | HomeError::OtherSettings(_)) {
                break;
            }
            accounts.event(&why.to_string());
            self.rest(shooter, accounts)?;
            match shooter.recover() {
                Ok(()) => {
                    accounts.event("the arms are back");
                    return Ok(());
                }
                Err(error) => why = error,
            }
        }
        Err(Halt::Failed(why.to_string()))
    }

    /// Takes the control pose until it is as it was. What was measured since it last was so is
    /// measured again.
    fn check_control(
        &self,
        shooter: &mut Shooter,
        accounts: &mut Accounts,
        good_line: usize,
    ) -> Result<(), Halt> {
        let Some(index) = accounts.control else {
            return Ok(());
        };
        let settings = self.capture.settings;
        let mut said = String::new();
        for _ in 0..=settings.max_retries {
            let comparison = self.compare(shooter, accounts, index)?;
            let judgement = match &comparison {
                Some(comparison) => comparison.judge(settings.drift_limit),
                None => Judgement::Moved,
            };
            said = comparison.map_or("its marks are not to be seen".into(), |c| c.to_string());
            let name = format!("{} pose {index}: {said}", self.role.name());
            let noted = lock(accounts.writer).note(&Entry::Control(name.clone()));
            noted.map_err(|error| Halt::Failed(error.to_string()))?;
            if judgement == Judgement::Same {
                return Ok(());
            }
            self.void(accounts, good_line, &name)?;
            if judgement == Judgement::Moved {
                return Err(Halt::Failed(format!(
                    "the control pose is not what it was ({said}): put sample and camera back as they were, or begin a new session"
                )));
            }
            accounts.event(&format!("the lamp has drifted: {said}"));
            self.rest(shooter, accounts)?;
        }
        Err(Halt::Failed(format!(
            "the lamp stays other than it was ({said}): mend it and go on with --resume"
        )))
    }

    fn compare(
        &self,
        shooter: &mut Shooter,
        accounts: &mut Accounts,
        index: usize,
    ) -> Result<Option<Comparison>, Halt> {
        accounts.compared = None;
        accounts.queue.push_front(Task {
            index,
            tries: 0,
            is_control: true,
        });
        // Also its own second takes come round by the queue.
        let mut totals = Totals::default();
        loop {
            if let Some(comparison) = accounts.compared.take() {
                return Ok(comparison);
            }
            self.obey(shooter, accounts)?;
            let Some(at) = accounts.queue.iter().position(|task| task.is_control) else {
                return Ok(None);
            };
            if let Some(task) = accounts.queue.remove(at) {
                self.shoot(shooter, accounts, task, &mut totals)?;
            }
            accounts.settle()?;
            accounts.clear_desk()?;
        }
    }

    /// Nothing doubtful is kept: poses since the last good control pose are taken again.
    fn void(&self, accounts: &mut Accounts, good_line: usize, why: &str) -> Result<(), Halt> {
        if accounts.since_control.is_empty() {
            return Ok(());
        }
        let noted = lock(accounts.writer).note(&Entry::Void(good_line, why.to_owned()));
        noted.map_err(|error| Halt::Failed(error.to_string()))?;
        let voided = std::mem::take(&mut accounts.since_control);
        accounts.watch.tell(&Told::Void(&voided));
        accounts.event(&format!(
            "{} poses since the last control are taken again",
            voided.len()
        ));
        for index in voided.into_iter().rev() {
            accounts.queue.push_front(Task {
                index,
                tries: 0,
                is_control: false,
            });
        }
        Ok(())
    }
}
