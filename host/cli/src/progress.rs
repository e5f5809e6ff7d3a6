//! Says which step a command is in, and how long it still takes.

use crate::say::errln;
use gonia_formats::Stage;
use gonia_pipeline::Step;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Steps of a stage's bar.
const STEPS: f64 = 1000.0;

/// Stages done so far, with their times: a bar on a terminal, plain lines elsewhere; always on
/// standard error.
pub struct Progress {
    terminal: bool,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// The stage under way.
    current: Option<(Instant, ProgressBar)>,
    done: Vec<Stage>,
}

impl Progress {
    /// No stage yet.
    pub fn new() -> Self {
        Self {
            terminal: std::io::stderr().is_terminal(),
            state: Mutex::default(),
        }
    }

    /// Runs a stage of the command's own. The work is given a function to call with the share done,
    /// 0 ..= 1.
    pub fn stage<T, E>(
        &self,
        name: &str,
        work: impl FnOnce(&(dyn Fn(f64) + Sync)) -> Result<T, E>,
    ) -> Result<T, E> {
        self.begin(name);
        let result = work(&|share| self.show(share));
        self.end(name, result.is_ok());
        result
    }

    /// The callback for a function of the library: each of its steps is a stage.
    pub fn watch(&self) -> impl Fn(Step, f64) -> ControlFlow<()> + Sync {
        self.watch_named(|step| step.to_string())
    }

    /// As [`Progress::watch`], with a name for each step.
    pub fn watch_named(
        &self,
        name: impl Fn(Step) -> String + Sync,
    ) -> impl Fn(Step, f64) -> ControlFlow<()> + Sync {
        move |step, share| {
            if share == 0.0 {
                self.begin(&name(step));
            } else if share == 1.0 {
                self.end(&name(step), true);
            } else {
                self.show(share);
            }
            ControlFlow::Continue(())
        }
    }

    /// The stages that ended well so far, in their order.
    pub fn stages(&self) -> Vec<Stage> {
        self.state().done.clone()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A stage list is whole at any time, whoever panicked while it was locked.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn begin(&self, name: &str) {
        let bar = self.bar(name);
        let before = self.state().current.replace((Instant::now(), bar));
        if let Some((_, bar)) = before {
            bar.finish_and_clear();
        }
    }

    fn show(&self, share: f64) {
        if let Some((_, bar)) = &self.state().current {
            bar.set_position((share.clamp(0.0, 1.0) * STEPS) as u64);
        }
    }

    fn end(&self, name: &str, well: bool) {
        let Some((start, bar)) = self.state().current.take() else {
            return;
        };
        bar.finish_and_clear();
        if well {
            let seconds = start.elapsed().as_secs_f64();
            errln!("{name:<28} {seconds:>8.1} s");
            self.state().done.push(Stage {
                name: name.to_owned(),
                seconds,
            });
        }
    }

    fn bar(&self, name: &str) -> ProgressBar {
        if !self.terminal {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::with_draw_target(Some(STEPS as u64), ProgressDrawTarget::stderr());
        // The template is a constant; were it ever wrong, a plain bar would do.
        if let Ok(style) =
            ProgressStyle::with_template("{msg:<28} {wide_bar} {percent:>3} %  {eta} left")
        {
            bar.set_style(style);
        }
        bar.set_message(name.to_owned());
        bar.enable_steady_tick(Duration::from_millis(250));
        bar
    }
}

impl Drop for Progress {
    /// A step of the library that failed leaves its bar.
    fn drop(&mut self) {
        if let Some((_, bar)) = &self.state().current {
            bar.finish_and_clear();
        }
    }
}
