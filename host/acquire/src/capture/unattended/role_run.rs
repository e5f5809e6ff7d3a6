//! One role of a session: its poses, one after the other, with everything that may come between.

use crate::camera::{Camera, Pulse};
use crate::capture::arms::HomeError;
use crate::capture::coordinator::{Channels, Coordinator, Halt};
use crate::capture::course::{Step, next_step};
use crate::capture::frame_worker::{FrameWorker, Taken, Task, fetch_all};
use crate::capture::shooter::{SessionError, Shooter};
use crate::capture::shot::ShotOutcome;
use crate::capture::unattended::UnattendedSession;
use crate::capture::watch::SessionEvent;
use crate::session::{Entry, SessionWriter};
use gonia_brdf::Pose;
use gonia_pipeline::process::{FrameSampler, SampledFrame};
use gonia_rig::{FrameRow, Role};
use std::sync::{Mutex, mpsc};
use std::time::{Duration, Instant};

/// Frames between camera and worker: all that a session keeps in memory of them.
const FRAMES_IN_MEMORY: usize = 2;
/// How often a pose that the arms do not reach is tried over the whole session.
const ROUNDS: u32 = 2;
/// While the session is held, orders are looked for this often.
const LISTEN_EVERY: Duration = Duration::from_millis(50);

/// What the roles of a session add up to.
#[derive(Default)]
pub(super) struct Totals {
    /// Shots taken again because of the camera or the disk.
    pub retaken: u32,
    /// Time by the host's clock in which the session paused.
    pub paused: Duration,
}

/// One role of a session.
pub(super) struct RoleRun<'a> {
    /// The session.
    pub session: &'a UnattendedSession<'a>,
    /// Its poses.
    pub plan: &'a [Pose],
    /// What lies on the target.
    pub role: Role,
    /// Whether the session measures the reference too.
    pub has_reference: bool,
}

/// Why no shot was taken.
enum NoShot {
    /// The session ends.
    Halt(Halt),
    /// By the arms.
    Session(SessionError),
}

impl From<SessionError> for NoShot {
    fn from(error: SessionError) -> Self {
        NoShot::Session(error)
    }
}

impl RoleRun<'_> {
    /// Takes the poses that are missing. `baseline` is the frame that control takes are compared with, once
    /// there is one.
    pub fn measure(
        &self,
        shooter: &mut Shooter,
        (camera, writer): (&Mutex<Box<dyn Camera>>, &Mutex<SessionWriter>),
        (missing, baseline): (Vec<usize>, Option<SampledFrame>),
        totals: &mut Totals,
    ) -> Result<(), Halt> {
        let settings = self.session.settings;
        let (shots, to_fetch) = mpsc::channel();
        let (work, to_do) = mpsc::sync_channel(FRAMES_IN_MEMORY);
        let (tell, events) = mpsc::channel();
        let channels = Channels {
            shots,
            work: work.clone(),
            events,
        };
        let mut coordinator = Coordinator::new(
            camera,
            writer,
            self.session.watch,
            self.session.orders,
            channels,
            (self.role, settings.exposures_s.len()),
            (
                settings.max_retries,
                Duration::from_secs_f64(settings.pause_s),
            ),
        );
        coordinator
            .queue
            .extend(missing.into_iter().map(|index| Task {
                index,
                tries: 0,
                is_control: false,
            }));
        let mut worker = FrameWorker {
            sampler: FrameSampler::new(self.session.rig),
            has_reference: self.has_reference,
            writer,
            frames: self.session.keep_frames.clone(),
            is_calibration: self.session.is_calibration,
            is_calibrated: self.session.rig.calibration.is_some(),
            baseline,
            watch: self.session.watch,
        };
        std::thread::scope(|scope| {
            let tell_too = tell.clone();
            scope.spawn(move || {
                fetch_all(camera, &to_fetch, &work, &tell_too);
            });
            scope.spawn(move || worker.work(&to_do, &tell));
            let mut result = self.take_all(shooter, &mut coordinator);
            if let Err(Halt::Paused(_)) = result {
                // The last frame is kept as any other.
                result = coordinator.close_last_shot().and(result);
            }
            let result = coordinator.wait_for_worker().and(result);
            totals.retaken += coordinator.retaken;
            totals.paused += coordinator.paused;
            // With the coordinator its channels end, and so do the threads.
            drop(coordinator);
            result
        })
    }

    fn take_all(&self, shooter: &mut Shooter, coordinator: &mut Coordinator) -> Result<(), Halt> {
        let every = self.session.settings.control_every;
        let mut look_us = 0;
        loop {
            coordinator.handle_events()?;
            self.obey(shooter, coordinator)?;
            self.wait_for_room(shooter, coordinator)?;
            self.wait_for_temperature(shooter, coordinator, &mut look_us)?;
            let is_queue_empty = coordinator.queue.is_empty();
            let is_under_way = coordinator.is_under_way();
            let step = self.state(coordinator, |state| {
                next_step(state, every, is_queue_empty, is_under_way)
            });
            match step {
                Step::Done => return Ok(()),
                Step::Settle => {
                    coordinator.close_last_shot()?;
                    coordinator.wait_for_worker()?;
                }
                Step::Control(index) => self.take_control(shooter, coordinator, index)?,
                Step::Pose => {
                    if let Some(task) = coordinator.queue.pop_front() {
                        self.shoot(shooter, coordinator, task)?;
                    }
                }
            }
        }
    }

    /// Carries out a person's orders.
    pub(super) fn obey(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
    ) -> Result<(), Halt> {
        let orders = self.session.orders;
        if orders.is_held() {
            // Held is shown when nothing is under way any more: a person who switches the camera off
            // then loses no frame.
            coordinator.close_last_shot()?;
            coordinator.wait_for_worker()?;
            // The lamp may be another one after it: the control pose comes first then.
            coordinator.write(&Entry::Pause("held by hand".into()))?;
            coordinator
                .watch
                .on_event(&SessionEvent::Note("held by hand"));
            coordinator.watch.on_event(&SessionEvent::Held(true));
            let began = Instant::now();
            while orders.is_held() && !orders.ends() {
                std::thread::sleep(LISTEN_EVERY);
                // Reads what the controllers send meanwhile; what is wrong with them comes out at the
                // next move.
                let _ = shooter.arms().light().rest(1);
                let _ = shooter.arms().camera().rest(1);
            }
            coordinator.paused += began.elapsed();
            coordinator.watch.on_event(&SessionEvent::Held(false));
            coordinator.note("goes on");
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
    pub(super) fn shoot(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
        task: Task,
    ) -> Result<(), Halt> {
        let Some(pose) = self.plan.get(task.index) else {
            return Ok(());
        };
        self.session
            .watch
            .on_event(&SessionEvent::Going { index: task.index });
        let taken = shooter.take(task.index, pose, &mut || {
            coordinator.before_trigger().map_err(NoShot::Halt)
        });
        for remark in shooter.arms().take_remarks() {
            coordinator.note(&format!("warning: {remark}"));
        }
        match taken {
            Err(NoShot::Halt(halt)) => Err(halt),
            Ok(ShotOutcome::Kept(shot)) => {
                let file = format!("frames/{}_{:06}.exr", self.role.name(), task.index);
                let row = FrameRow {
                    frame: task.index as u32,
                    role: self.role,
                    pose: if self.session.exact {
                        *pose
                    } else {
                        shot.encoder
                    },
                    file,
                };
                let times = self.session.settings.exposures_s.iter();
                let pulses = times.zip(&shot.pulse_times_us);
                coordinator.triggered(Taken {
                    task,
                    row,
                    pulses: pulses.map(|(s, us)| Pulse::new(*s, *us)).collect(),
                    pointing_deg: shot.pointing_error_deg,
                })
            }
            Ok(ShotOutcome::Refused { reason, .. }) => {
                let text = format!("{} pose {}: {reason}", self.role.name(), task.index);
                if task.is_control {
                    coordinator.note(&text);
                    coordinator.again(task, &text)?;
                } else if task.tries + 1 < ROUNDS {
                    coordinator.note(&text);
                    let tries = task.tries + 1;
                    coordinator.queue.push_back(Task { tries, ..task });
                } else {
                    coordinator.give_up(task.index, reason)?;
                }
                Ok(())
            }
            Err(NoShot::Session(SessionError::Arms { source, .. })) => {
                self.recover(shooter, coordinator, source)?;
                coordinator.again(task, "the arms had failed")
            }
            Err(NoShot::Session(other)) => Err(Halt::Failed(other.to_string())),
        }
    }

    /// Recovers arms that a shot's own tries could not.
    fn recover(
        &self,
        shooter: &mut Shooter,
        coordinator: &mut Coordinator,
        mut why: HomeError,
    ) -> Result<(), Halt> {
        for _ in 0..self.session.settings.max_retries {
            if self.session.orders.stops() {
                return Err(Halt::Stopped("by a second Ctrl-C".into()));
            }
            if matches!(why, HomeError::Stopped(_) | HomeError::OtherSettings(_)) {
                break;
            }
            coordinator.note(&why.to_string());
            self.rest(shooter, coordinator)?;
            match shooter.recover() {
                Ok(()) => {
                    coordinator.note("the arms are back");
                    return Ok(());
                }
                Err(error) => why = error,
            }
        }
        Err(Halt::Failed(why.to_string()))
    }
}
