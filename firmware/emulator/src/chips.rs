//! The chips on the bus: two rings on SPIs, the host on the UART.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::chip::{Timeline, spi, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

use crate::world::World;

/// The world, which the chip's side and the script take in turns.
pub type Shared = Arc<Mutex<World>>;

/// The world, for a moment.
pub fn lock(world: &Shared) -> MutexGuard<'_, World> {
    world.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A ring encoder on an SPI.
#[derive(Debug)]
pub struct Ring {
    /// Where it turns.
    pub world: Shared,
    /// θ or φ.
    pub axis: usize,
}

impl Store for Ring {}

impl spi::Peer for Ring {
    fn transfer(&mut self, _: u32, _: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let now = context.now().0;
        lock(&self.world).axes[self.axis].shift(now)
    }
}

/// The drivers on their SPI: the one whose select line is low hears and answers.
#[derive(Debug)]
pub struct DriverBusSpi {
    /// Where they are.
    pub world: Shared,
}

impl Store for DriverBusSpi {}

impl spi::Peer for DriverBusSpi {
    fn transfer(&mut self, out: u32, _: u8, _: &mut Timeline<'_, '_>) -> u32 {
        lock(&self.world).to_drivers(out as u8).into()
    }
}

/// The host, at the other end of the UART.
#[derive(Debug)]
pub struct HostWire {
    /// Where its bytes are.
    pub world: Shared,
}

impl Store for HostWire {}

impl uart::Peer for HostWire {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        let now = context.now().0;
        lock(&self.world).wire.arrived(word as u8, now);
    }

    fn transmit(&mut self, now: VirtualNanos) -> Option<u16> {
        lock(&self.world).wire.due(now.0).map(u16::from)
    }
}
