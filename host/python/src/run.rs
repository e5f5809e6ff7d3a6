//! Long work in a thread of its own: Python's goes on hearing Ctrl-C and telling the caller how far it is.

use crate::to_py;
use gonia_pipeline::{Progress, Step};
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// How often Ctrl-C is looked for while nothing is heard of the work.
const LOOK: Duration = Duration::from_millis(50);

/// Runs `work` without the interpreter's lock. `progress` is a Python function of a step's name and its share done, or
/// none; what it raises, and Ctrl-C, ends the work and is raised.
pub fn run<T: Send, E: std::fmt::Display + Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Progress<'_>) -> Result<T, E> + Send,
) -> PyResult<T> {
    let is_ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let (tell, mut hear) = mpsc::channel::<(Step, f64)>();
        let is_ended = &is_ended;
        let worker = scope.spawn(move || {
            work(&|step, share| {
                // Nobody hears any more: the caller's error is under way.
                let _ = tell.send((step, share));
                match is_ended.load(Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            })
        });
        let mut stopped: Option<PyErr> = None;
        loop {
            let heard;
            (hear, heard) = py.detach(move || {
                let heard = hear.recv_timeout(LOOK);
                (hear, heard)
            });
            let told = match heard {
                Ok(told) => Some(told),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            if stopped.is_some() {
                continue;
            }
            let answer = match (&progress, told) {
                (Some(progress), Some((step, share))) => progress
                    .call1(py, (step.to_string(), share))
                    .and_then(|_| py.check_signals()),
                _ => py.check_signals(),
            };
            if let Err(error) = answer {
                is_ended.store(true, Relaxed);
                stopped = Some(error);
            }
        }
        let result = py.detach(|| worker.join());
        match (stopped, result) {
            (Some(error), _) => Err(error),
            (None, Ok(result)) => result.map_err(to_py),
            (None, Err(_)) => Err(to_py(
                "gonia has ended unexpectedly; please report what was done",
            )),
        }
    })
}

/// Runs what cannot tell how far it is.
pub fn run_silently<T: Send, E: std::fmt::Display + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    run(py, None, |_| work())
}
