//! A fault of this program costs a frame, not the night.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// What a function gives.
///
/// # Errors
/// It panicked: what it says. What it was changing may be half changed, so only what is made anew for each
/// frame, or checked at its next use, belongs in there.
pub fn unless_panics<T>(f: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(f)).map_err(|panic| {
        let said = panic
            .downcast_ref::<&str>()
            .map(|said| (*said).to_owned())
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_default();
        format!("a fault of this program ({said}); please report it")
    })
}
