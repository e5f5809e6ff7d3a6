//! CPU time of one thread.

use std::hint::black_box;
use std::time::Instant;

/// Runs of which the median counts.
const RUNS: usize = 5;
/// Least length of a run, milliseconds.
const RUN_MS: f64 = 150.0;

/// Median of this thread's CPU milliseconds over a few runs, each long enough for the system's
/// clock, which may tick only every few milliseconds.
pub fn median_ms<T>(mut work: impl FnMut() -> T) -> f64 {
    let clock = Instant::now();
    let once = Instant::now();
    black_box(work());
    let repeats = (RUN_MS / (once.elapsed().as_secs_f64() * 1e3))
        .ceil()
        .max(1.0) as u32;
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let before = thread_ms(&clock);
            (0..repeats).for_each(|_| drop(black_box(work())));
            (thread_ms(&clock) - before) / f64::from(repeats)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2]
}

/// CPU time of this thread where the system tells it (Linux), so that a busy machine does not
/// blur the figures; elsewhere the wall clock's.
fn thread_ms(clock: &Instant) -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok())
        .map_or(clock.elapsed().as_secs_f64() * 1e3, |ns| ns * 1e-6)
}

/// Their mean.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
