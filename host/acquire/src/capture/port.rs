//! A controller's port in a session of a day: it is opened again after its cable was out, and an
//! order to stop is heard while the host waits for bytes.

use crate::capture::orders::Orders;
use crate::link::Transport;
use std::io;
use std::time::{Duration, Instant};

/// The longest wait in one piece, µs.
const SLICE_US: u64 = 50_000;

/// Opens a port.
pub type PortOpener = Box<dyn FnMut() -> io::Result<Box<dyn Transport>> + Send>;

/// A port that comes back.
pub struct SessionPort {
    open: PortOpener,
    inner: Option<Box<dyn Transport>>,
    orders: Orders,
    /// The order to stop has been passed on; what follows is the stopping itself.
    has_stopped: bool,
    /// When the port went, by [`Transport::now_us`] and by the host's clock.
    gone: (u64, Instant),
    /// A port that is opened again may begin its clock anew: when it was opened, by
    /// [`Transport::now_us`] and by its own clock.
    opened: (u64, u64),
}

impl SessionPort {
    /// Opens a port.
    ///
    /// # Errors
    /// What the system says.
    pub fn open(mut open: PortOpener, orders: &Orders) -> io::Result<Self> {
        let inner = open()?;
        let began = inner.now_us();
        Ok(Self {
            open,
            inner: Some(inner),
            opened: (began, began),
            orders: orders.clone(),
            has_stopped: false,
            gone: (0, Instant::now()),
        })
    }

    fn lose(&mut self) {
        self.gone = (self.now_us(), Instant::now());
        self.inner = None;
    }
}

impl Transport for SessionPort {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if let Some(inner) = &mut self.inner
            && inner.send(bytes).is_err()
        {
            // As on a wire that is cut: nobody answers, and the session waits for it to come back.
            self.lose();
        }
        Ok(())
    }

    fn receive(&mut self, out: &mut Vec<u8>, timeout_us: u64) -> io::Result<()> {
        if self.orders.stops() && !self.has_stopped {
            self.has_stopped = true;
            return Err(io::Error::new(
                io::ErrorKind::Interrupted,
                "stopped by a second Ctrl-C",
            ));
        }
        // Short waits, so that the order is heard; to the caller it is silence.
        let slice_us = timeout_us.min(SLICE_US);
        match &mut self.inner {
            Some(inner) => {
                if inner.receive(out, slice_us).is_err() {
                    self.lose();
                }
            }
            None => {
                std::thread::sleep(Duration::from_micros(slice_us));
                if let Ok(inner) = (self.open)() {
                    self.opened = (self.now_us(), inner.now_us());
                    self.inner = Some(inner);
                }
            }
        }
        Ok(())
    }

    fn now_us(&self) -> u64 {
        match &self.inner {
            Some(inner) => {
                let (at_us, began_us) = self.opened;
                at_us + inner.now_us().saturating_sub(began_us)
            }
            None => self.gone.0 + self.gone.1.elapsed().as_micros() as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    /// A port that gives a byte, and breaks every second time.
    struct Breaking(Arc<Mutex<u32>>);

    impl Transport for Breaking {
        fn send(&mut self, _: &[u8]) -> io::Result<()> {
            Ok(())
        }

        fn receive(&mut self, out: &mut Vec<u8>, _: u64) -> io::Result<()> {
            let mut calls = self.0.lock().unwrap();
            *calls += 1;
            if calls.is_multiple_of(2) {
                return Err(io::ErrorKind::BrokenPipe.into());
            }
            out.push(7);
            Ok(())
        }

        fn now_us(&self) -> u64 {
            1_000_000
        }
    }

    /// A port whose clock begins when it is opened, and which breaks at its third call.
    struct Restarting(u64);

    impl Transport for Restarting {
        fn send(&mut self, _: &[u8]) -> io::Result<()> {
            Ok(())
        }

        fn receive(&mut self, _: &mut Vec<u8>, _: u64) -> io::Result<()> {
            self.0 += 1_000_000;
            if self.0 > 3_000_000 {
                return Err(io::ErrorKind::BrokenPipe.into());
            }
            Ok(())
        }

        fn now_us(&self) -> u64 {
            self.0
        }
    }

    #[test]
    fn a_port_that_is_opened_again_does_not_turn_the_clock_back() {
        let open: PortOpener = Box::new(|| Ok(Box::new(Restarting(0)) as Box<dyn Transport>));
        let mut port = SessionPort::open(open, &Orders::default()).unwrap();
        let mut last_us = port.now_us();
        for _ in 0..30 {
            port.receive(&mut Vec::new(), 100).unwrap();
            assert!(port.now_us() >= last_us, "{} {last_us}", port.now_us());
            last_us = port.now_us();
        }
        // Six times three seconds went by.
        assert!(last_us >= 18_000_000, "{last_us}");
    }

    #[test]
    fn a_cable_that_was_out_is_silence_and_a_second_interrupt_an_error() {
        let calls = Arc::new(Mutex::new(0));
        let opened = Arc::new(Mutex::new(0));
        let (c, o) = (calls.clone(), opened.clone());
        let open: PortOpener = Box::new(move || {
            *o.lock().unwrap() += 1;
            Ok(Box::new(Breaking(c.clone())) as Box<dyn Transport>)
        });
        let orders = Orders::default();
        let mut port = SessionPort::open(open, &orders).unwrap();
        let mut out = Vec::new();
        for _ in 0..6 {
            port.receive(&mut out, 1000).unwrap();
            assert!(port.now_us() >= 1_000_000);
        }
        assert_eq!((out.len(), *opened.lock().unwrap()), (2, 3));
        orders.interrupt();
        assert!(port.receive(&mut out, 1000).is_ok());
        orders.interrupt();
        assert!(port.receive(&mut out, 1000).is_err());
        // Stopping the arms needs the port.
        assert!(port.receive(&mut out, 1000).is_ok());
    }
}
