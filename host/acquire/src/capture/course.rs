//! What a session does next, by what its journal's entries have come to.

use crate::session::{ControlComparison, ControlDone, Judgement, RoleState};
use gonia_rig::Role;

/// The next step of a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The next pose of the queue.
    Pose,
    /// The frames that are under way are waited for: they may change what comes next.
    Settle,
    /// The control pose is taken: its place in the plan.
    Control(usize),
    /// Nothing is left to do.
    Done,
}

/// What follows from a take of the control pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterControl {
    /// The session goes on.
    GoOn,
    /// It is taken again at once.
    TakeAgain,
    /// It is taken again after a pause, in which the lamp may come back.
    Wait,
    /// The lamp does not come back.
    LampStays,
    /// Sample or camera were moved.
    Moved,
}

/// The next step of a role, when `every` poses may be doubtful. Also the last poses have a control
/// behind them.
pub fn next_step(role: &RoleState, every: usize, is_queue_empty: bool, is_under_way: bool) -> Step {
    let is_due = role.is_control_due(every);
    if !is_due && !is_queue_empty {
        return Step::Pose;
    }
    if is_under_way {
        return Step::Settle;
    }
    match role.baseline() {
        Some(pose) if is_due || !role.doubtful().is_empty() => Step::Control(pose.index),
        _ => Step::Done,
    }
}

/// A take of the control pose with its judgement. One in which something seems moved is no proof: it is
/// taken once more.
pub fn judged(
    state: &RoleState,
    (role, index): (Role, usize),
    comparison: Option<ControlComparison>,
    drift_limit: f64,
) -> ControlDone {
    let judgement = comparison.map_or(Judgement::Moved, |c| c.judge(drift_limit));
    let is_first = state.last_control() != Some(Judgement::Unconfirmed);
    ControlDone {
        role,
        index,
        judgement: Some(match judgement {
            Judgement::Moved if is_first => Judgement::Unconfirmed,
            judgement => judgement,
        }),
        comparison,
    }
}

/// What follows from the last control pose of a role.
pub fn after_control(state: &RoleState, max_retries: u32) -> AfterControl {
    match state.last_control() {
        None | Some(Judgement::Same) => AfterControl::GoOn,
        Some(Judgement::Unconfirmed) => AfterControl::TakeAgain,
        Some(Judgement::Moved) => AfterControl::Moved,
        Some(Judgement::Drifted) if state.bad_controls() > max_retries => AfterControl::LampStays,
        Some(Judgement::Drifted) => AfterControl::Wait,
    }
}
