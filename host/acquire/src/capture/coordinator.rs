//! Which pulses, frames and poses belong together: kept by the arms' thread, which sends work to the
//! camera's thread and the worker's, and handles their events.

use crate::camera::Camera;
use crate::capture::frame_worker::{Fetched, Taken, Task, Work, WorkerEvent, lock};
use crate::capture::orders::Orders;
use crate::capture::watch::{SessionEvent, Watch};
use crate::session::{ControlComparison, Entry, GivenUp, SessionWriter};
use gonia_rig::Role;
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender};
use std::time::{Duration, Instant};

/// While the camera works, an order to stop is looked for this often.
const LISTEN_EVERY: Duration = Duration::from_millis(50);

/// Why a session ends before its last pose.
#[derive(Clone, Debug, PartialEq)]
pub enum Halt {
    /// A person ordered it; with the order.
    Paused(String),
    /// The reference is measured, and a person must put the material on the target.
    AwaitsMaterial,
    /// The arms were stopped by hand, and stay where they are; with the order.
    Stopped(String),
    /// What is wrong does not go away; with what it is.
    Failed(String),
}

/// Channels between the arms' thread and the others.
pub struct Channels {
    /// To the camera's thread.
    pub shots: Sender<Taken>,
    /// To the worker.
    pub work: SyncSender<Work>,
    /// From both.
    pub events: Receiver<WorkerEvent>,
}

/// What is under way between arms, camera and worker.
pub struct Coordinator<'a> {
    pub camera: &'a Mutex<Box<dyn Camera>>,
    pub writer: &'a Mutex<SessionWriter>,
    pub watch: &'a dyn Watch,
    pub orders: &'a Orders,
    channels: Channels,
    /// What lies on the target.
    pub role: Role,
    /// The session's folder.
    pub folder: PathBuf,
    /// Poses to be taken.
    pub queue: VecDeque<Task>,
    /// The last take of the control pose, until it is looked at.
    pub control_take: Option<Option<ControlComparison>>,
    /// Pulses a shot has.
    pub pulses: usize,
    /// Pulses whose frames nobody will fetch.
    strays: usize,
    /// The shot whose frame is being fetched, or is not confirmed.
    in_flight: Option<Task>,
    /// How its fetch ended, once it has.
    fetched: Option<Fetched>,
    exposes_in_fetch: bool,
    /// Frames confirmed that the worker is not done with.
    in_work: usize,
    max_retries: u32,
    pause: Duration,
    /// Shots taken again because of the camera or the disk.
    pub retaken: u32,
    /// Time by the host's clock in which the session paused.
    pub paused: Duration,
}

impl<'a> Coordinator<'a> {
    pub fn new(
        camera: &'a Mutex<Box<dyn Camera>>,
        writer: &'a Mutex<SessionWriter>,
        watch: &'a dyn Watch,
        orders: &'a Orders,
        channels: Channels,
        (role, pulses): (Role, usize),
        (max_retries, pause): (u32, Duration),
    ) -> Self {
        Self {
            camera,
            writer,
            watch,
            orders,
            channels,
            role,
            folder: lock(writer).folder().to_owned(),
            queue: VecDeque::new(),
            control_take: None,
            pulses,
            strays: 0,
            in_flight: None,
            fetched: None,
            exposes_in_fetch: lock(camera).exposes_in_fetch(),
            in_work: 0,
            max_retries,
            pause,
            retaken: 0,
            paused: Duration::ZERO,
        }
    }

    /// Notes something that a person should know, for those who watch and in the journal.
    pub fn note(&mut self, text: &str) {
        self.watch.on_event(&SessionEvent::Note(text));
        // A disk that does not take this line is found out by the next frame.
        let _ = lock(self.writer).note(&Entry::Event(text.to_owned()));
    }

    /// Writes an entry that the session's state hangs on.
    pub fn write(&self, entry: &Entry) -> Result<(), Halt> {
        let written = lock(self.writer).note(entry);
        written.map_err(|error| Halt::Failed(error.to_string()))
    }

    /// Gives a pose up, for as long as this program runs.
    pub fn give_up(&self, index: usize, why: String) -> Result<(), Halt> {
        let role = self.role;
        let given_up = GivenUp {
            role,
            index,
            why,
            is_left_out: false,
        };
        self.watch.on_event(&SessionEvent::GivenUp {
            index,
            why: &given_up.to_string(),
        });
        self.write(&Entry::GivenUp(given_up))
    }

    /// Whether frames are under way that may yet be kept or taken again.
    pub fn is_under_way(&self) -> bool {
        self.in_flight.is_some() || self.in_work > 0
    }

    /// Both arms are at rest, and the trigger comes next: the last shot is closed, and the camera is ready
    /// for this one.
    pub fn before_trigger(&mut self) -> Result<(), Halt> {
        self.close_last_shot()?;
        self.strays = self.pulses;
        Ok(())
    }

    /// A shot was triggered: its frame will be fetched, while the arms move on if they may.
    pub fn triggered(&mut self, taken: Taken) -> Result<(), Halt> {
        self.strays = 0;
        self.in_flight = Some(taken.task.clone());
        self.channels.shots.send(taken).map_err(|_| ended_early())?;
        if self.exposes_in_fetch {
            self.close_last_shot()?;
        }
        Ok(())
    }

    /// Closes the last shot: its frame came, and no other; or it is taken again.
    pub fn close_last_shot(&mut self) -> Result<(), Halt> {
        let mut last = self.in_flight.take();
        if let Some(task) = &last
            && let Fetched::Nothing(error) = self.wait_for_camera()?
        {
            self.strays += self.pulses;
            self.note(&format!("pose {}: {error}; taken again", task.index));
            self.again(task.clone(), &error.to_string())?;
            self.reopen()?;
            last = None;
        }
        let strays = std::mem::take(&mut self.strays);
        let ready = lock(self.camera).ready(strays);
        let trouble = match ready {
            Ok(0) => None,
            Ok(n) => Some(format!("{n} frames came that belong to no trigger")),
            Err(ref error) => Some(error.to_string()),
        };
        match (last, &trouble) {
            (Some(_), None) => {
                self.in_work += 1;
                self.send(Work::Confirm)?;
            }
            (Some(task), Some(trouble)) => {
                self.note(&format!("pose {}: {trouble}; taken again", task.index));
                self.send(Work::Discard)?;
                self.again(task, trouble)?;
            }
            (None, None) => {}
            (None, Some(trouble)) => self.note(trouble),
        }
        if ready.is_err() {
            self.reopen()?;
        }
        Ok(())
    }

    /// Handles the events that are there, without waiting.
    pub fn handle_events(&mut self) -> Result<(), Halt> {
        while let Ok(event) = self.channels.events.try_recv() {
            self.handle(event)?;
        }
        Ok(())
    }

    /// Waits until the worker is done with every frame.
    pub fn wait_for_worker(&mut self) -> Result<(), Halt> {
        while self.in_work > 0 {
            let event = self.channels.events.recv().map_err(|_| ended_early())?;
            self.handle(event)?;
        }
        Ok(())
    }

    /// Tries a pose again, unless that was done too often.
    pub fn again(&mut self, task: Task, why: &str) -> Result<(), Halt> {
        if task.tries >= self.max_retries {
            return Err(Halt::Failed(format!(
                "pose {} was tried {} times in vain: {why}",
                task.index,
                task.tries + 1
            )));
        }
        self.retaken += 1;
        self.queue.push_front(Task {
            tries: task.tries + 1,
            ..task
        });
        Ok(())
    }

    fn wait_for_camera(&mut self) -> Result<Fetched, Halt> {
        loop {
            if let Some(fetched) = self.fetched.take() {
                return Ok(fetched);
            }
            match self.channels.events.recv_timeout(LISTEN_EVERY) {
                Ok(event) => self.handle(event)?,
                Err(RecvTimeoutError::Disconnected) => return Err(ended_early()),
                Err(RecvTimeoutError::Timeout) if self.orders.stops() => {
                    return Err(Halt::Stopped("by a second Ctrl-C".into()));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    fn handle(&mut self, event: WorkerEvent) -> Result<(), Halt> {
        if !matches!(event, WorkerEvent::Fetched(_) | WorkerEvent::RigMoved(_)) {
            self.in_work = self.in_work.saturating_sub(1);
        }
        match event {
            WorkerEvent::Fetched(fetched) => {
                self.fetched = Some(fetched);
                Ok(())
            }
            // The writer's state has it.
            WorkerEvent::Kept => Ok(()),
            WorkerEvent::Repeat(task, why) => self.again(task, &why),
            WorkerEvent::Spoilt(task, why) => {
                self.note(&format!("pose {}: {why}", task.index));
                if task.tries < self.max_retries {
                    return self.again(task, &why);
                }
                self.give_up(task.index, why)
            }
            WorkerEvent::TargetTurned(task, why) => Err(Halt::Failed(format!(
                "pose {}: {why}: turn it back and go on with --resume, or correct target.mark_mm and begin a new session",
                task.index
            ))),
            WorkerEvent::NotKept(task, error) => {
                self.note(&format!("pose {}: {error}", task.index));
                self.again(task, &error.to_string())?;
                self.wait();
                Ok(())
            }
            WorkerEvent::RigMoved(what) => {
                self.note(&what);
                Ok(())
            }
            WorkerEvent::Control(take) => {
                self.control_take = Some(take);
                Ok(())
            }
        }
    }

    /// Opens the camera again, until it is there or that was tried too often.
    fn reopen(&mut self) -> Result<(), Halt> {
        for tries in 0.. {
            let opened = lock(self.camera).reopen();
            match opened {
                Ok(()) => return Ok(()),
                Err(error) if tries >= self.max_retries => {
                    return Err(Halt::Failed(format!("the camera stays away: {error}")));
                }
                Err(error) => {
                    self.note(&format!("the camera cannot be opened: {error}"));
                    self.wait();
                }
            }
            if self.orders.ends() {
                let by = self.orders.ended_by();
                return Err(Halt::Paused(format!("{by}, while the camera was away")));
            }
        }
        Ok(())
    }

    /// A pause by the host's clock, cut short by an order to end.
    fn wait(&mut self) {
        let began = Instant::now();
        while began.elapsed() < self.pause && !self.orders.ends() {
            std::thread::sleep(Duration::from_millis(20).min(self.pause));
        }
        self.paused += began.elapsed();
    }

    fn send(&self, work: Work) -> Result<(), Halt> {
        self.channels.work.send(work).map_err(|_| ended_early())
    }
}

fn ended_early() -> Halt {
    Halt::Failed("a thread of this program has died; please report what it said above".into())
}
