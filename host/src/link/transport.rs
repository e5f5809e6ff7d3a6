//! Moving bytes, in real or in virtual time.

use std::io;

use gonia_sim::rig::SimPort;

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

/// Virtual: waiting lets the simulated rig run.
impl Transport for SimPort {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        SimPort::send(self, bytes);
        Ok(())
    }

    fn receive(&mut self, out: &mut Vec<u8>, timeout_us: u64) -> io::Result<()> {
        SimPort::receive(self, out, timeout_us);
        Ok(())
    }

    fn now_us(&self) -> u64 {
        SimPort::now_us(self)
    }
}
