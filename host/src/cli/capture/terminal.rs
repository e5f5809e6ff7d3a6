//! A session on the terminal: a bar on one, plain lines elsewhere.

use crate::capture::{Told, Watch};
use crate::cli::table;
use crate::dataset::Role;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Plain lines come no more often than this.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Prints what a session tells.
pub struct Terminal {
    bar: ProgressBar,
    plain: bool,
    poses: u64,
    roles: usize,
    state: Mutex<State>,
}

struct State {
    role: Role,
    /// Poses of this role done in all, and by this run.
    done: u64,
    by_this_run: u64,
    began: Instant,
    printed: Instant,
    worst_deg: f64,
}

impl Terminal {
    pub fn new(poses: usize, roles: &[Role]) -> Self {
        let plain = !std::io::stderr().is_terminal();
        let bar = if plain {
            ProgressBar::hidden()
        } else {
            let target = ProgressDrawTarget::stderr();
            let bar = ProgressBar::with_draw_target(Some(poses as u64), target);
            // The template is a constant; were it ever wrong, a plain bar would do.
            if let Ok(style) =
                ProgressStyle::with_template("{prefix} {wide_bar} {pos}/{len}  {msg}")
            {
                bar.set_style(style);
            }
            bar
        };
        Self {
            bar,
            plain,
            poses: poses as u64,
            roles: roles.len(),
            state: Mutex::new(State {
                role: Role::Material,
                done: 0,
                by_this_run: 0,
                began: Instant::now(),
                printed: Instant::now(),
                worst_deg: 0.0,
            }),
        }
    }

    /// Leaves the terminal as it was.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn line(&self, text: &str) {
        if self.plain {
            eprintln!("{text}");
        } else {
            self.bar.println(text);
        }
    }

    /// Rate, time left and pointing error.
    fn figures(&self, state: &State) -> String {
        let took_s = state.began.elapsed().as_secs_f64().max(1e-9);
        let rate = state.by_this_run as f64 / took_s;
        let later = match (state.role, self.roles) {
            (Role::Reference, 2) => self.poses,
            _ => 0,
        };
        let left = self.poses.saturating_sub(state.done) + later;
        format!(
            "{:.2} poses/s, {} left, pointing within {:.4} degrees",
            rate,
            table::duration(left as f64 / rate.max(1e-9)),
            state.worst_deg
        )
    }
}

impl Watch for Terminal {
    fn tell(&self, news: &Told) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        match news {
            Told::Begin {
                role,
                done,
                planned,
            } => {
                state.role = *role;
                state.done = *done as u64;
                state.by_this_run = 0;
                state.began = Instant::now();
                self.bar.set_prefix(role.name());
                self.bar.set_position(*done as u64);
                self.line(&format!(
                    "{}: {done} of {planned} poses are done",
                    role.name()
                ));
            }
            Told::Pose { done, .. } => {
                state.done += 1;
                state.by_this_run += 1;
                state.worst_deg = state.worst_deg.max(done.pointing_deg);
                self.bar.set_position(state.done);
                self.bar.set_message(self.figures(&state));
                if self.plain && state.printed.elapsed() >= LINE_EVERY {
                    state.printed = Instant::now();
                    eprintln!(
                        "{}: {} of {} poses, {}",
                        state.role.name(),
                        state.done,
                        self.poses,
                        self.figures(&state)
                    );
                }
            }
            Told::Event(text) => self.line(text),
        }
    }
}
