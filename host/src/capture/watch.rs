//! What a running session tells those who watch it.

use crate::dataset::Role;
use crate::process::SampledFrame;
use crate::session::PoseDone;

/// Somebody who watches; called from several threads.
pub trait Watch: Sync {
    /// Hears what happened.
    fn tell(&self, news: &Told);
}

/// What happened.
#[derive(Clone, Debug)]
pub enum Told<'a> {
    /// A role begins, or goes on: so many of its poses are done.
    Begin {
        /// What lies on the target.
        role: Role,
        /// Poses done.
        done: usize,
        /// Poses planned.
        planned: usize,
    },
    /// A pose is done.
    Pose {
        /// Its line in the journal.
        done: &'a PoseDone,
        /// What it showed.
        frame: &'a SampledFrame,
    },
    /// Something that a person should know.
    Event(&'a str),
}
