//! Says which stage a command is in, and how long it still takes.

use gonia_formats::Stage;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Steps of a stage's bar.
const STEPS: f64 = 1000.0;

/// Stages done so far, with their times.
pub struct Progress {
    terminal: bool,
    stages: Vec<Stage>,
}

impl Progress {
    /// A bar on a terminal, plain lines elsewhere; always on standard error.
    pub fn new() -> Self {
        Self {
            terminal: std::io::stderr().is_terminal(),
            stages: Vec::new(),
        }
    }

    /// Runs a stage. The work is given a function to call with the share done, 0 ..= 1.
    pub fn stage<T, E>(
        &mut self,
        name: &str,
        work: impl FnOnce(&(dyn Fn(f64) + Sync)) -> Result<T, E>,
    ) -> Result<T, E> {
        let start = Instant::now();
        let bar = self.bar(name);
        let result = work(&|share| bar.set_position((share.clamp(0.0, 1.0) * STEPS) as u64));
        bar.finish_and_clear();
        let seconds = start.elapsed().as_secs_f64();
        if result.is_ok() {
            eprintln!("{name:<28} {seconds:>8.1} s");
            self.stages.push(Stage {
                name: name.to_owned(),
                seconds,
            });
        }
        result
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

    /// The stages that ended well so far, in their order.
    pub fn stages(&self) -> &[Stage] {
        &self.stages
    }
}
