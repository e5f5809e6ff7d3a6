//! What a caller hears of work that takes long, and how it ends it early.

use std::ops::ControlFlow;

/// Called with the share done, 0 ..= 1, from any thread; a break ends the work with an error.
pub type Progress<'a> = dyn Fn(f64) -> ControlFlow<()> + Sync + 'a;

/// A [`Progress`] for callers who do not want to know.
pub fn silent(_: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}
