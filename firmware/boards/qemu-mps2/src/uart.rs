//! CMSDK UARTs: UART0 is the wire to the host, UART1 takes the log.

use core::convert::Infallible;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;

use crate::register::Register;

/// IRQ of UART0's receiver.
pub const RX_IRQ: u16 = 0;

const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;
const TX_ENABLE: u32 = 1;
const RX_ENABLE: u32 = 2;
const RX_INTERRUPT: u32 = 8;

/// Bytes that have come in on UART0.
pub static RECEIVED: Pipe<CriticalSectionRawMutex, 1024> = Pipe::new();

/// One UART.
pub struct Uart {
    data: Register,
    state: Register,
    control: Register,
    clear: Register,
    divider: Register,
}

/// The wire to the host.
pub const WIRE: Uart = Uart::at(0x4000_4000);
const LOG: Uart = Uart::at(0x4000_5000);

impl Uart {
    const fn at(base: usize) -> Self {
        Self {
            data: Register(base),
            state: Register(base + 0x4),
            control: Register(base + 0x8),
            clear: Register(base + 0xC),
            divider: Register(base + 0x10),
        }
    }

    fn start(&self, control: u32) {
        // 25 MHz / 27: 926 kbaud. The emulator does not care, a real board would.
        self.divider.write(27);
        self.control.write(control);
    }

    /// Sends bytes, waiting for room.
    pub fn send(&self, bytes: &[u8]) {
        for &byte in bytes {
            while self.state.read() & TX_FULL != 0 {}
            self.data.write(u32::from(byte));
        }
    }
}

/// Enables both UARTs.
pub fn start() {
    WIRE.start(TX_ENABLE | RX_ENABLE | RX_INTERRUPT);
    LOG.start(TX_ENABLE);
}

/// UART0 has received.
pub fn on_receive() {
    // First: a byte that comes after the last look below must ring again.
    WIRE.clear.write(2);
    while WIRE.state.read() & RX_FULL != 0 {
        let byte = WIRE.data.read() as u8;
        // A full pipe loses the byte; the packet's checksum notices and the host repeats.
        let _ = RECEIVED.try_write(&[byte]);
    }
}

/// The log's way out, for defmt.
pub struct LogPort;

impl embedded_io::ErrorType for LogPort {
    type Error = Infallible;
}

impl embedded_io::Write for LogPort {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        LOG.send(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
