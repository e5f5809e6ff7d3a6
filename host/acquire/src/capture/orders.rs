//! What a person tells a running session: pause, or stop the arms now.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Orders given so far, from any thread.
#[derive(Clone, Debug, Default)]
pub struct Orders {
    interrupts: Arc<AtomicU32>,
    ended: Arc<AtomicBool>,
    held: Arc<AtomicBool>,
}

impl Orders {
    /// Ctrl-C: the first one ends the session at the next pose, the second one stops the arms now.
    pub fn interrupt(&self) {
        self.interrupts.fetch_add(1, Ordering::SeqCst);
    }

    /// Ends the session at the next pose, as the first Ctrl-C does; however often it is said.
    pub fn end(&self) {
        self.ended.store(true, Ordering::SeqCst);
    }

    /// Whether the session ends at the next pose.
    pub fn ends(&self) -> bool {
        self.ended.load(Ordering::SeqCst) || self.interrupts.load(Ordering::SeqCst) > 0
    }

    /// By what it was told to.
    pub fn ended_by(&self) -> &'static str {
        if self.interrupts.load(Ordering::SeqCst) > 0 {
            "by Ctrl-C"
        } else {
            "from the live page"
        }
    }

    /// Whether the arms stop now.
    pub fn stops(&self) -> bool {
        self.interrupts.load(Ordering::SeqCst) > 1
    }

    /// Holds the session at the next pose until it is let go.
    pub fn hold(&self, held: bool) {
        self.held.store(held, Ordering::SeqCst);
    }

    /// Whether it is held.
    pub fn is_held(&self) -> bool {
        self.held.load(Ordering::SeqCst)
    }
}
