//! A session on the terminal: a map and a bar on one, plain lines elsewhere.

use crate::capture::map::{Mark, PoseMap};
use crate::say::errln;
use crate::table;
use gonia_acquire::capture::{Pace, SessionEvent, Watch};
use gonia_acquire::session::SessionFolder;
use gonia_formats::write_whole_bytes;
use gonia_live::Thumbnail;
use gonia_pipeline::process::Outcome;
use gonia_rig::{Role, Target};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Plain lines, and pictures of the last frame, come no more often than this.
const LINE_EVERY: Duration = Duration::from_secs(10);
/// A terminal with fewer rows has no map.
const ROWS_FOR_MAP: u16 = 20;
/// The last frame with its fiducial lines as they were found.
const LAST_FRAME: &str = "last_frame.png";

/// Prints the events of a session.
pub struct Terminal {
    bar: ProgressBar,
    plain: bool,
    has_map: bool,
    last_frame: PathBuf,
    target: Target,
    state: Mutex<Shown>,
}

struct Shown {
    role: Role,
    pace: Pace,
    map: PoseMap,
    current: Option<usize>,
    worst_deg: f64,
    events: u32,
    printed: Instant,
    /// When the last frame was drawn.
    drawn: Option<Instant>,
    has_picture: bool,
}

impl Terminal {
    pub fn new(session: &SessionFolder) -> Self {
        let (plan, roles) = (session.plan(), session.roles());
        let plain = !std::io::stderr().is_terminal();
        let bar = if plain {
            ProgressBar::hidden()
        } else {
            let target = ProgressDrawTarget::stderr();
            let bar = ProgressBar::with_draw_target(Some(plan.len() as u64), target);
            // The template is a constant; were it ever wrong, a plain bar would do.
            if let Ok(style) =
                ProgressStyle::with_template("{msg}\n{prefix} {wide_bar} {pos}/{len}")
            {
                bar.set_style(style);
            }
            bar
        };
        let rows = console::Term::stderr()
            .size_checked()
            .map_or(0, |(rows, _)| rows);
        Self {
            bar,
            plain,
            has_map: rows >= ROWS_FOR_MAP,
            last_frame: session.folder().join(LAST_FRAME),
            target: session.rig().target.clone(),
            state: Mutex::new(Shown {
                role: Role::Material,
                pace: Pace::new(plan.len(), roles.len()),
                map: PoseMap::new(plan),
                current: None,
                worst_deg: 0.0,
                events: 0,
                printed: Instant::now(),
                drawn: None,
                has_picture: false,
            }),
        }
    }

    /// Leaves the terminal as it was.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn line(&self, text: &str) {
        if self.plain {
            errln!("{text}");
        } else {
            self.bar.println(text);
        }
    }

    fn state(&self) -> MutexGuard<'_, Shown> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_picture_due(&self) -> bool {
        let mut state = self.state();
        let is_due = state.drawn.is_none_or(|at| at.elapsed() >= LINE_EVERY);
        if is_due {
            state.drawn = Some(Instant::now());
        }
        is_due
    }

    fn keep_picture(&self, picture: &Thumbnail) {
        // A disk that does not take it is found out by the frames.
        let written = write_whole_bytes(&self.last_frame, &picture.png());
        let mut state = self.state();
        if written.is_ok() && !state.has_picture {
            state.has_picture = true;
            if self.plain {
                errln!("last frame: {}", self.last_frame.display());
            }
        }
    }

    fn event(&self, state: &mut Shown, text: &str) {
        state.events += 1;
        self.line(text);
    }

    fn draw(&self, state: &Shown) {
        let mut lines = Vec::new();
        if self.has_map {
            lines = state.map.lines(state.current);
        }
        lines.push(figures(state));
        if state.has_picture {
            lines.push(format!("last frame: {}", self.last_frame.display()));
        }
        self.bar.set_message(lines.join("\n"));
    }
}

/// Rate, time left, pointing error and faults.
fn figures(state: &Shown) -> String {
    let rate = state.pace.rate().unwrap_or(0.0);
    let left = state.pace.left_s().map_or("?".into(), table::duration);
    let events = match state.events {
        0 => String::new(),
        1 => ", 1 event".into(),
        n => format!(", {n} events"),
    };
    format!(
        "{rate:.2} poses/s, {left} left, pointing within {:.4} degrees{events}",
        state.worst_deg
    )
}

impl Watch for Terminal {
    fn on_event(&self, event: &SessionEvent) {
        if let SessionEvent::Frame {
            frame,
            registration,
            sampled,
        } = event
            && self.is_picture_due()
        {
            // Not while others wait for the state: the arms are among them.
            let outcome = sampled.report.outcome;
            self.keep_picture(&Thumbnail::of(frame, registration, outcome, &self.target));
        }
        let mut state = self.state();
        match event {
            SessionEvent::Begin {
                role,
                missing,
                planned,
            } => {
                state.role = *role;
                state.pace.begin(*role, missing.len(), Instant::now());
                state.map.begin(missing);
                self.bar.set_prefix(role.name());
                self.line(&format!(
                    "{}: {} of {planned} poses are done",
                    role.name(),
                    state.pace.done
                ));
            }
            SessionEvent::Going { index } => state.current = Some(*index),
            SessionEvent::Frame { .. } => return,
            SessionEvent::Pose { done, frame } => {
                let mark = match frame.report.outcome {
                    Outcome::Refused(_) => Mark::Bad,
                    _ => Mark::Done,
                };
                state.map.set(done.index, mark);
                state.pace.pose(Instant::now());
                state.worst_deg = state.worst_deg.max(done.pointing_deg);
                if self.plain && state.printed.elapsed() >= LINE_EVERY {
                    state.printed = Instant::now();
                    errln!(
                        "{}: {} of {} poses, {}",
                        state.role.name(),
                        state.pace.done,
                        state.pace.planned,
                        figures(&state)
                    );
                }
            }
            SessionEvent::Discarded(poses) => {
                for index in *poses {
                    state.map.set(*index, Mark::ToDo);
                }
                state.pace.discard(poses.len());
            }
            SessionEvent::GivenUp { index, why } => {
                state.map.set(*index, Mark::Bad);
                self.event(&mut state, why);
            }
            SessionEvent::Held(true) => {}
            SessionEvent::Held(false) => state.pace.go_on(Instant::now()),
            SessionEvent::Note(text) => self.event(&mut state, text),
        }
        self.bar.set_position(state.pace.done as u64);
        self.draw(&state);
    }
}
