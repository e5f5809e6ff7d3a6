//! The edges of steps, as a driver sees them.

use anyhow::{Context, Result, ensure};
use gonia_pins::StepEdge;

use crate::chips::lock;
use crate::rig::Rig;

/// No move has a pause as long as this, ns.
const PAUSE_NS: u64 = 20_000_000;
/// What an interval at constant speed may be off where a timer makes the edges: a count of 1/84 µs at both ends.
const BY_TIMER_NS: i64 = 25;
/// And where an interrupt does: what a critical section and the other axis's interrupt take.
const BY_INTERRUPT_NS: i64 = 5_000;
/// A step is high for so long at least, ns: what optocoupled drivers need, and what drivers in sockets do (TMC2209
/// and TMC5160: 100 ns).
const WIDE_NS: u64 = 2_480;
const NARROW_NS: u64 = 100;

/// Compares the edges of the longest move so far with what drivers need and what the board promises.
pub fn on_time(rig: &Rig) -> Result<String> {
    let world = lock(&rig.world);
    let mut figures = Vec::new();
    for (axis, pins) in world.axes.iter().zip(rig.board.axes) {
        let (off_limit_ns, width_limit_ns) = match pins.edge {
            StepEdge::Timer(_) => (BY_TIMER_NS, WIDE_NS),
            StepEdge::Interrupt => (BY_INTERRUPT_NS, NARROW_NS),
        };
        let moves = axis.rises.chunk_by(|&one, &next| next - one < PAUSE_NS);
        let longest = moves.max_by_key(|rises| rises.len()).context("no step")?;
        // Its middle: the speed is constant there.
        let third = longest.len() / 3;
        let middle = &longest[third..longest.len() - third];
        let mut intervals: Vec<i64> = middle.windows(2).map(|w| (w[1] - w[0]) as i64).collect();
        intervals.sort_unstable();
        ensure!(
            intervals.len() > 500,
            "{} steps at full speed",
            intervals.len()
        );
        let median = intervals[intervals.len() / 2];
        let (least, most) = (intervals[0], intervals[intervals.len() - 1]);
        let off_ns = (most - median).max(median - least);
        ensure!(
            off_ns <= off_limit_ns,
            "steps are {least} to {most} ns apart where {median} ± {off_limit_ns} are promised"
        );
        let width_ns = axis.narrowest_ns;
        ensure!(
            width_ns >= width_limit_ns,
            "a step is high for {width_ns} ns where a driver needs {width_limit_ns}"
        );
        figures.push(format!("{off_ns} ns, high for {width_ns} ns"));
    }
    Ok(format!("steps apart to within {}", figures.join(" and ")))
}
