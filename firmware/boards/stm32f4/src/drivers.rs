//! The wires of motors' drivers that are set by them: a TMC2209's by TIM1's interrupt, which works a plain pin, a
//! TMC5160's by an SPI.
//!
//! The interrupt (`tick`) comes behind those of steps and trigger, which may delay it by microseconds: a sixth of a bit
//! lasts 17.

use core::cell::RefCell;

use critical_section::{CriticalSection, Mutex};
use embassy_stm32::gpio::{AfType, Pull};
use embassy_stm32::pac::TIM1;
use embassy_stm32::pac::spi::Spi;
use embassy_stm32::pac::spi::vals::{Br, Cpha, Cpol, Mstr};
use embassy_stm32::{pac, peripherals, rcc};
use gonia_firmware::driver::{DriverBus, tmc5160};
use gonia_firmware::hardware::{DriverAnswer, DriverBytes};
use gonia_firmware::single_wire::{Exchange, SingleWire};
use gonia_pins::signals::Signal;
use gonia_pins::{DriverSpi, DriverWires, Level};
use gonia_protocol::settings::Axis;

use crate::gpio::{DRIVEN, Line, give, open_drain};

/// Around a select line's edges, cycles of the processor: 1 µs, where the chip asks for less than 0.1.
const SELECT_CYCLES: u32 = 168;

/// The one wire of the axis that is spoken with.
struct OneWire {
    wire: SingleWire,
    line: Option<Line>,
    /// Whether the line was left alone at the last tick.
    is_free: bool,
    axis: Axis,
}

static ONE_WIRE: Mutex<RefCell<OneWire>> = Mutex::new(RefCell::new(OneWire {
    wire: SingleWire::new(),
    line: None,
    is_free: true,
    axis: Axis::Theta,
}));

/// Lines and SPI of both drivers.
pub struct Drivers {
    lines: [Line; 2],
    spi: Spi,
    /// What an SPI has brought, until it is fetched.
    brought: [Option<DriverBytes>; 2],
}

impl Drivers {
    /// Starts lines and SPI.
    pub fn start(wires: DriverWires) -> Self {
        Self {
            lines: wires.lines.map(open_drain),
            spi: start_spi(wires.spi),
            brought: [None, None],
        }
    }

    /// Sends bytes to a driver; `false` while the other one is spoken with.
    pub fn ask(
        &mut self,
        axis: Axis,
        bus: DriverBus,
        request: DriverBytes,
        answer_len: usize,
    ) -> bool {
        let line = self.lines[axis.index()];
        line.drive_high(bus == DriverBus::Spi);
        match bus {
            DriverBus::OneWire => begin(axis, line, request, answer_len),
            DriverBus::Spi => {
                self.brought[axis.index()] = Some(self.transfer(line, &request));
                true
            }
        }
    }

    /// What has come of it.
    pub fn answer(&mut self, axis: Axis, bus: DriverBus) -> DriverAnswer {
        if bus == DriverBus::Spi {
            let brought = self.brought[axis.index()].take();
            return brought.map_or(DriverAnswer::Silent, DriverAnswer::Bytes);
        }
        critical_section::with(|cs| {
            let mut one = ONE_WIRE.borrow_ref_mut(cs);
            if one.axis != axis {
                return DriverAnswer::Silent;
            }
            match one.wire.take() {
                Exchange::Open => DriverAnswer::Waiting,
                Exchange::Silent => DriverAnswer::Silent,
                Exchange::Done(bytes) => DriverAnswer::Bytes(bytes),
            }
        })
    }

    /// Datagrams, the select line low for each.
    fn transfer(&self, select: Line, request: &[u8]) -> DriverBytes {
        let mut brought = DriverBytes::new();
        for datagram in request.chunks(tmc5160::DATAGRAM_LEN) {
            select.set(Level::Low);
            cortex_m::asm::delay(SELECT_CYCLES);
            for &byte in datagram {
                self.spi.dr().write(|w| w.set_dr(u16::from(byte)));
                while !self.spi.sr().read().rxne() {}
                // As many come back as were sent: they fit.
                let _ = brought.push(self.spi.dr().read().dr() as u8);
            }
            cortex_m::asm::delay(SELECT_CYCLES);
            select.set(Level::High);
            cortex_m::asm::delay(SELECT_CYCLES);
        }
        brought
    }
}

/// An SPI in mode 3 at 1.3 MHz: 84 MHz by 64 or 42 MHz by 32, where the chip's own clock allows 4.
fn start_spi(wires: DriverSpi) -> Spi {
    let (spi, divider) = match wires.spi {
        1 => {
            rcc::enable_and_reset::<peripherals::SPI1>();
            (pac::SPI1, Br::DIV64)
        }
        2 => {
            rcc::enable_and_reset::<peripherals::SPI2>();
            (pac::SPI2, Br::DIV32)
        }
        3 => {
            rcc::enable_and_reset::<peripherals::SPI3>();
            (pac::SPI3, Br::DIV32)
        }
        _ => {
            rcc::enable_and_reset::<peripherals::SPI4>();
            (pac::SPI4, Br::DIV64)
        }
    };
    give(wires.clock, Signal::SpiClock(wires.spi), DRIVEN);
    give(wires.out, Signal::SpiOut(wires.spi), DRIVEN);
    // Without a driver it reads ones.
    let input = AfType::input(Pull::Up);
    give(wires.data, Signal::SpiData(wires.spi), input);
    spi.cr1().write(|w| {
        w.set_cpol(Cpol::IDLE_HIGH);
        w.set_cpha(Cpha::SECOND_EDGE);
        w.set_mstr(Mstr::MASTER);
        w.set_br(divider);
        w.set_ssm(true);
        w.set_ssi(true);
    });
    spi.cr1().modify(|w| w.set_spe(true));
    spi
}

/// Begins on the one wire, unless it is in use.
fn begin(axis: Axis, line: Line, request: DriverBytes, answer_len: usize) -> bool {
    critical_section::with(|cs| {
        let mut one = ONE_WIRE.borrow_ref_mut(cs);
        if one.wire.is_busy() || (one.wire.has_ended() && one.axis != axis) {
            return false;
        }
        one.wire.begin(request, answer_len);
        (one.line, one.is_free, one.axis) = (Some(line), true, axis);
        TIM1.cr1().modify(|w| w.set_cen(true));
        true
    })
}

/// A sixth of a bit on the one wire; whether bytes are under way.
#[inline]
pub fn on_tick(cs: CriticalSection) -> bool {
    let one = &mut *ONE_WIRE.borrow_ref_mut(cs);
    let Some(line) = one.line.filter(|_| one.wire.is_busy()) else {
        return false;
    };
    let is_free = one.wire.tick(line.is_high());
    if is_free != one.is_free {
        one.is_free = is_free;
        line.set(if is_free { Level::High } else { Level::Low });
    }
    one.wire.is_busy()
}
