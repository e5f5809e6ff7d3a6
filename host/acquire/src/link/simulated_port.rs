//! The in-process door of the simulated rig: its ports carry the host's bytes.

use std::io;

use crate::link::Transport;
use gonia_sim::rig::SimPort;

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
