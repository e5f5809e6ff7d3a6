//! Moving bytes, in real or in virtual time.

use std::io;

/// A byte stream to one controller, with the clock that belongs to it.
pub trait Transport: Send {
    /// Sends all bytes.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits for bytes, at most `timeout_us`, and appends what came. Nothing coming is no error;
    /// the other end being gone is one.
    fn receive(&mut self, out: &mut Vec<u8>, timeout_us: u64) -> io::Result<()>;

    /// Now, µs. Never goes back.
    fn now_us(&self) -> u64;
}
