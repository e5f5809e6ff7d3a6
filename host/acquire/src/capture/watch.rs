//! The events of a running session, for those who watch it.

use crate::capture::guard::unless_panics;
use crate::session::PoseDone;
use gonia_imaging::Registration;
use gonia_pipeline::process::SampledFrame;
use gonia_rig::{Frame, Role};

/// Watches a session. It is called from several threads, which wait for it: it must be quick.
pub trait Watch: Sync {
    /// Is called at each event.
    fn on_event(&self, event: &SessionEvent);
}

/// What happened.
#[derive(Clone, Debug)]
pub enum SessionEvent<'a> {
    /// A role begins, or goes on.
    Begin {
        /// What lies on the target.
        role: Role,
        /// Poses of the plan that are not done.
        missing: &'a [usize],
        /// Poses planned.
        planned: usize,
    },
    /// The arms go to a pose.
    Going {
        /// Its place in the plan.
        index: usize,
    },
    /// A frame was sampled, also one that is not kept.
    Frame {
        /// Its pixels.
        frame: &'a Frame,
        /// Where its fiducial lines are.
        registration: &'a Registration,
        /// What it showed.
        sampled: &'a SampledFrame,
    },
    /// A pose is done.
    Pose {
        /// Its line in the journal.
        done: &'a PoseDone,
        /// What it showed.
        frame: &'a SampledFrame,
    },
    /// Poses were discarded, since the control pose has changed, and are taken again.
    Discarded(&'a [usize]),
    /// A pose was given up.
    GivenUp {
        /// Its place in the plan.
        index: usize,
        /// Why.
        why: &'a str,
    },
    /// The session is held by hand, or goes on.
    Held(bool),
    /// Something that a person should know.
    Note(&'a str),
}

/// Several watchers.
pub struct Watchers<'a>(pub Vec<&'a dyn Watch>);

impl Watch for Watchers<'_> {
    fn on_event(&self, event: &SessionEvent) {
        for watch in &self.0 {
            // Whoever fails to show an event misses it; the session goes on.
            let _ = unless_panics(|| watch.on_event(event));
        }
    }
}
