//! Which pulses, frames and poses belong together: kept by the arms' thread.

use crate::camera::{Camera, CameraError};
use crate::capture::control::Comparison;
use crate::capture::desk::{News, Taken, Task, Work, lock};
use crate::capture::orders::Orders;
use crate::capture::watch::{Told, Watch};
use crate::session::{Entry, SessionWriter};
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender};
use std::time::{Duration, Instant};

/// How often an order to stop is looked for while the camera works.
const LISTEN_EVERY: Duration = Duration::from_millis(50);

/// Why a session ends before its last pose.
#[derive(Clone, Debug, PartialEq)]
pub enum Halt {
    /// Somebody wants it to.
    Paused(String),
    /// The arms were stopped by hand: they stay where they are.
    Stopped(String),
    /// Something does not go away.
    Failed(String),
}

/// What is under way between arms, camera and desk.
pub struct Accounts<'a> {
    pub camera: &'a Mutex<Box<dyn Camera>>,
    pub writer: &'a Mutex<SessionWriter>,
    pub watch: &'a dyn Watch,
    pub orders: &'a Orders,
    pub shots: Sender<Taken>,
    pub work: SyncSender<Work>,
    pub news: Receiver<News>,
    /// The session's folder.
    pub folder: PathBuf,
    /// Poses to be taken.
    pub queue: VecDeque<Task>,
    /// Poses kept since the control pose was last found as it was.
    pub since_control: Vec<usize>,
    /// The control pose, once there is one.
    pub control: Option<usize>,
    /// What came of the last control pose.
    pub compared: Option<Option<Comparison>>,
    /// Pulses a shot has.
    pub pulses: usize,
    /// Pulses whose frames nobody will fetch.
    strays: usize,
    /// The shot whose frame is being fetched, or is not confirmed.
    in_flight: Option<Task>,
    /// What the camera said of that shot, if it has.
    fetched: Option<Result<(), CameraError>>,
    exposes_in_fetch: bool,
    /// Frames confirmed of which the desk has not told what became.
    on_desk: usize,
    max_retries: u32,
    pause: Duration,
    /// Shots taken again for the camera's or the disk's sake.
    pub retaken: u32,
    /// Time by the host's clock in which the session waited for something to pass.
    pub paused: Duration,
}

impl<'a> Accounts<'a> {
    pub fn new(
        camera: &'a Mutex<Box<dyn Camera>>,
        writer: &'a Mutex<SessionWriter>,
        watch: &'a dyn Watch,
        orders: &'a Orders,
        (shots, work, news): (Sender<Taken>, SyncSender<Work>, Receiver<News>),
        pulses: usize,
        (max_retries, pause): (u32, Duration),
    ) -> Self {
        Self {
            camera,
            writer,
            watch,
            orders,
            shots,
            work,
            news,
            folder: lock(writer).folder().to_owned(),
            queue: VecDeque::new(),
            since_control: Vec::new(),
            control: None,
            compared: None,
            pulses,
            strays: 0,
            in_flight: None,
            fetched: None,
            exposes_in_fetch: lock(camera).exposes_in_fetch(),
            on_desk: 0,
            max_retries,
            pause,
            retaken: 0,
            paused: Duration::ZERO,
        }
    }

    /// Tells everybody, and the journal.
    pub fn event(&mut self, text: &str) {
        self.watch.tell(&Told::Event(text));
        // A disk that does not take this line is found out by the next frame.
        let _ = lock(self.writer).note(&Entry::Event(text.to_owned()));
    }

    /// Both arms are at rest, and the trigger comes next: the last shot's account is closed, and the
    /// camera is ready for this one.
    pub fn before_trigger(&mut self) -> Result<(), Halt> {
        self.settle()?;
        self.strays = self.pulses;
        Ok(())
    }

    /// A shot was triggered: its frame will be fetched, while the arms move on if they may.
    pub fn triggered(&mut self, taken: Taken) -> Result<(), Halt> {
        self.strays = 0;
        self.in_flight = Some(taken.task.clone());
        self.shots.send(taken).map_err(|_| ended_early())?;
        if self.exposes_in_fetch {
            self.settle()?;
        }
        Ok(())
    }

    /// Closes the account of the last shot: its frame came, and no other; or it is taken again.
    pub fn settle(&mut self) -> Result<(), Halt> {
        let mut last = self.in_flight.take();
        if let Some(task) = &last
            && let Err(error) = self.camera_free()?
        {
            self.strays += self.pulses;
            self.event(&format!("pose {}: {error}; taken again", task.index));
            self.again(task.clone(), &error.to_string())?;
            self.reopen()?;
            last = None;
        }
        let strays = std::mem::take(&mut self.strays);
        let ready = lock(self.camera).ready(strays);
        let doubt = match ready {
            Ok(0) => None,
            Ok(n) => Some(format!("{n} frames came that belong to no trigger")),
            Err(ref error) => Some(error.to_string()),
        };
        match (last, &doubt) {
            (Some(_), None) => {
                self.on_desk += 1;
                self.send(Work::Confirm)?;
            }
            (Some(task), Some(doubt)) => {
                self.event(&format!("pose {}: {doubt}; taken again", task.index));
                self.send(Work::Void)?;
                self.again(task, doubt)?;
            }
            (None, None) => {}
            (None, Some(doubt)) => self.event(doubt),
        }
        if ready.is_err() {
            self.reopen()?;
        }
        Ok(())
    }

    /// Takes in what the desk has told, without waiting.
    pub fn listen(&mut self) -> Result<(), Halt> {
        while let Ok(news) = self.news.try_recv() {
            self.hear(news)?;
        }
        Ok(())
    }

    /// Waits until the desk has told what became of every frame.
    pub fn clear_desk(&mut self) -> Result<(), Halt> {
        while self.on_desk > 0 {
            let news = self.news.recv().map_err(|_| ended_early())?;
            self.hear(news)?;
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

    fn camera_free(&mut self) -> Result<Result<(), CameraError>, Halt> {
        loop {
            if let Some(result) = self.fetched.take() {
                return Ok(result);
            }
            match self.news.recv_timeout(LISTEN_EVERY) {
                Ok(news) => self.hear(news)?,
                Err(RecvTimeoutError::Disconnected) => return Err(ended_early()),
                Err(RecvTimeoutError::Timeout) if self.orders.stops() => {
                    return Err(Halt::Stopped("by a second Ctrl-C".into()));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    fn hear(&mut self, news: News) -> Result<(), Halt> {
        if !matches!(news, News::Camera(_)) {
            self.on_desk = self.on_desk.saturating_sub(1);
        }
        match news {
            News::Camera(result) => {
                self.fetched = Some(result);
                Ok(())
            }
            News::Kept(done, is_baseline) => {
                self.since_control.push(done.index);
                if is_baseline {
                    self.control = Some(done.index);
                }
                Ok(())
            }
            News::Again(task, why) => self.again(task, &why),
            News::NotKept(task, error) => {
                self.event(&format!("pose {}: {error}", task.index));
                self.again(task, &error.to_string())?;
                self.wait();
                Ok(())
            }
            News::Compared(comparison) => {
                self.compared = Some(comparison);
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
                    self.event(&format!("the camera cannot be opened: {error}"));
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
        self.work.send(work).map_err(|_| ended_early())
    }
}

fn ended_early() -> Halt {
    Halt::Failed("a thread of this program has died; please report what it said above".into())
}
