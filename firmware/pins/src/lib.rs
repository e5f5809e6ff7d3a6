//! What a board *is*: which pin of its chip does what, its crystal, where its image and its settings lie.
//!
//! One file a board in [`boards`]; one program for all of them (`firmware/boards/stm32f4`). The wiring pages, the
//! emulated chip and the linker script are made from the same data, and [`check`] finds what cannot be: two
//! uses of a pin, a pin that its timer does not reach, settings within the program.
#![no_std]

pub mod boards;
pub mod check;
pub mod signals;

use core::fmt;

use crate::signals::Signal;

/// Where the chip's flash begins.
pub const FLASH: u32 = 0x0800_0000;
/// Bytes of it.
pub const FLASH_LEN: u32 = 512 << 10;
/// Its sectors, bytes (RM0390, table 5).
pub const SECTORS: [u32; 8] = [
    16 << 10,
    16 << 10,
    16 << 10,
    16 << 10,
    64 << 10,
    128 << 10,
    128 << 10,
    128 << 10,
];

/// A pin of the chip.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Pin {
    /// `'A'` to `'H'`.
    pub port: char,
    /// 0 to 15.
    pub number: u8,
}

impl Pin {
    /// `Pin::new('C', 13)` is PC13.
    pub const fn new(port: char, number: u8) -> Self {
        Self { port, number }
    }

    /// The number of its port: 0 for A.
    pub const fn port_index(self) -> u8 {
        (self.port as u32 as u8).wrapping_sub(b'A')
    }
}

impl fmt::Display for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "P{}{}", self.port, self.number)
    }
}

impl fmt::Debug for Pin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// A pin, and where on the board a wire gets at it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire {
    /// The chip's.
    pub pin: Pin,
    /// What is printed there, or what the board's own drawing calls it.
    pub place: &'static str,
}

/// A pin and its place.
pub const fn wire(pin: Pin, place: &'static str) -> Wire {
    Wire { pin, place }
}

/// A level of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// 0 V.
    Low,
    /// 3.3 V.
    High,
}

/// An output that the program switches. A resistor holds it off until then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// Where it is.
    pub wire: Wire,
    /// Its level when it is on.
    pub on: Level,
}

/// What makes the edge of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepEdge {
    /// This channel (1 to 4) of the axis's timer, to the clock.
    Timer(u8),
    /// The interrupt at the end of the timer's period, for a pin that the timer does not reach. It comes by the
    /// time that the processor needs to get there later: microseconds.
    Interrupt,
}

/// Timers of the axes, θ and φ: of 32 bits, both gated by TIM8.
pub const STEP_TIMERS: [u8; 2] = [5, 2];
/// The timer that is the board's clock; channel 1 is its alarm.
pub const CLOCK_TIMER: u8 = 3;
/// The timer that ends steps and lets go of the relay when the processor does not come round.
pub const LIFE_TIMER: u8 = 8;
/// The host's UART.
pub const HOST_UART: u8 = 2;

/// An encoder on an SPI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoder {
    /// Which SPI: 1 to 4.
    pub spi: u8,
    /// Clock to the encoder.
    pub clock: Wire,
    /// Data from it.
    pub data: Wire,
}

/// A quadrature ring's line receiver. All three are on one port, so that they are read at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuadratureWires {
    /// The wave that leads upwards: A.
    pub first: Wire,
    /// The other one: B.
    pub second: Wire,
    /// Once a turn: Z, the reference mark.
    pub index: Wire,
}

/// What belongs to one axis.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Step input of the driver.
    pub step: Wire,
    /// What makes its edges.
    pub edge: StepEdge,
    /// Direction input of the driver.
    pub direction: Wire,
    /// The ring, where it is absolute.
    pub encoder: Encoder,
    /// The ring, where it gives waves and an index, and the board has pins for that.
    pub quadrature: Option<QuadratureWires>,
    /// To ground when closed; the pin has a pull-up.
    pub home_switch: Wire,
}

/// An output of a timer: channel 1 to 4, or its complementary output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimerOutput {
    /// Where it is.
    pub wire: Wire,
    /// 1 to 4.
    pub channel: u8,
    /// The output CHxN in place of CHx.
    pub is_complementary: bool,
}

/// The wires by which motors' drivers are set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverWires {
    /// θ's and φ's: the one wire of a TMC2209, or the select line of a TMC5160.
    pub lines: [Wire; 2],
    /// What both TMC5160 share.
    pub spi: DriverSpi,
}

/// An SPI to drivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverSpi {
    /// Which SPI: 1 to 4, and no encoder's.
    pub spi: u8,
    /// Clock to the drivers.
    pub clock: Wire,
    /// Data to them.
    pub out: Wire,
    /// Data from them.
    pub data: Wire,
}

/// The clock that the chip's PLL starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crystal {
    /// A whole number of 2 MHz.
    pub hz: u32,
    /// Another chip gives the clock; otherwise a crystal sits on the chip's own pins.
    pub is_given: bool,
}

/// Where things lie in flash, bytes from its beginning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The vector table: 0, or behind the bootloader that the board is sold with.
    pub image: u32,
    /// The program: behind the vector table, or further on where the settings lie between.
    pub program: Option<u32>,
    /// The two sectors that keep the settings.
    pub settings: [u32; 2],
}

/// A board.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// In the names of its files, and in its identity: 16 characters at most.
    pub name: &'static str,
    /// For people.
    pub title: &'static str,
    /// What feeds the PLL.
    pub crystal: Crystal,
    /// Where image and settings lie.
    pub layout: Layout,
    /// To the host's receiver: USART2.
    pub host_tx: Wire,
    /// From the host's transmitter.
    pub host_rx: Wire,
    /// θ and φ.
    pub axes: [Axis; 2],
    /// By which drivers can be set, where they can.
    pub drivers: Option<DriverWires>,
    /// What gives the drivers their current: one for both, or one each.
    pub enables: &'static [Output],
    /// The chain, to ground while it is closed.
    pub interlock: Wire,
    /// TIM8's, high: the relay closes this arm's part of the chain.
    pub relay: TimerOutput,
    /// TIM8's, high: the brakes let go.
    pub brakes: Option<TimerOutput>,
    /// Alarm outputs of θ's and φ's driver, to ground when closed; the pins have pull-ups.
    pub alarms: Option<[Wire; 2]>,
    /// TIM3's: the trigger's pulses.
    pub trigger_out: TimerOutput,
    /// TIM3's: the other arm's pulses.
    pub trigger_in: TimerOutput,
    /// To ground on the camera arm.
    pub camera_jumper: Wire,
}

/// What a pin of a board is used for.
#[derive(Clone, Copy, Debug)]
pub struct Use {
    /// In words.
    pub role: &'static str,
    /// Which pin, and where.
    pub wire: Wire,
    /// What the pin must be able to carry; `None` for a plain input or output.
    pub signal: Option<Signal>,
    /// What the resistor that is added outside holds it at: outputs only.
    pub resistor: Option<Level>,
}

impl Board {
    /// Every pin that the program uses, in the order of the wiring page.
    pub fn for_each_use(&self, mut each: impl FnMut(Use)) {
        let mut plain = |role, wire, resistor| {
            each(Use {
                role,
                wire,
                signal: None,
                resistor,
            });
        };
        for (axis, names) in self.axes.iter().zip(AXIS_ROLES) {
            plain(names.direction, axis.direction, Some(Level::Low));
            plain(names.home_switch, axis.home_switch, None);
            if axis.edge == StepEdge::Interrupt {
                plain(names.step, axis.step, Some(Level::Low));
            }
        }
        for (axis, names) in self.axes.iter().zip(AXIS_ROLES) {
            if let Some(ring) = axis.quadrature {
                plain(names.first, ring.first, None);
                plain(names.second, ring.second, None);
                plain(names.index, ring.index, None);
            }
        }
        for enable in self.enables {
            let off = match enable.on {
                Level::High => Level::Low,
                Level::Low => Level::High,
            };
            plain("drivers' current", enable.wire, Some(off));
        }
        for (alarm, names) in self.alarms.iter().flatten().zip(AXIS_ROLES) {
            plain(names.alarm, *alarm, None);
        }
        let lines = self.drivers.iter().flat_map(|drivers| drivers.lines);
        for (line, names) in lines.zip(AXIS_ROLES) {
            plain(names.driver_line, line, None);
        }
        plain("interlock chain", self.interlock, None);
        plain("camera arm", self.camera_jumper, None);
        self.for_each_signal(&mut each);
    }

    /// Those that a timer, an SPI or a UART must reach.
    fn for_each_signal(&self, each: &mut impl FnMut(Use)) {
        let mut carried = |role, wire, signal, resistor| {
            each(Use {
                role,
                wire,
                signal: Some(signal),
                resistor,
            });
        };
        let low = Some(Level::Low);
        for (i, (axis, names)) in self.axes.iter().zip(AXIS_ROLES).enumerate() {
            if let StepEdge::Timer(channel) = axis.edge {
                let signal = Signal::Timer(STEP_TIMERS[i], channel);
                carried(names.step, axis.step, signal, low);
            }
            let Encoder { spi, clock, data } = axis.encoder;
            carried(names.clock, clock, Signal::SpiClock(spi), None);
            carried(names.data, data, Signal::SpiData(spi), None);
        }
        if let Some(DriverWires { spi, .. }) = self.drivers {
            let DriverSpi {
                spi,
                clock,
                out,
                data,
            } = spi;
            carried("drivers' clock", clock, Signal::SpiClock(spi), None);
            carried("drivers' data in", out, Signal::SpiOut(spi), None);
            carried("drivers' data out", data, Signal::SpiData(spi), None);
        }
        carried(
            "host: transmit",
            self.host_tx,
            Signal::UartTx(HOST_UART),
            None,
        );
        carried(
            "host: receive",
            self.host_rx,
            Signal::UartRx(HOST_UART),
            None,
        );
        let of = |timer, output: TimerOutput| match output.is_complementary {
            false => Signal::Timer(timer, output.channel),
            true => Signal::TimerComplement(timer, output.channel),
        };
        let (relay, out, into) = (self.relay, self.trigger_out, self.trigger_in);
        carried("interlock relay", relay.wire, of(LIFE_TIMER, relay), low);
        if let Some(brakes) = self.brakes {
            carried("brakes", brakes.wire, of(LIFE_TIMER, brakes), low);
        }
        carried("trigger out", out.wire, of(CLOCK_TIMER, out), low);
        carried("trigger in", into.wire, of(CLOCK_TIMER, into), None);
    }
}

struct AxisRoles {
    step: &'static str,
    direction: &'static str,
    clock: &'static str,
    data: &'static str,
    first: &'static str,
    second: &'static str,
    index: &'static str,
    home_switch: &'static str,
    alarm: &'static str,
    driver_line: &'static str,
}

const AXIS_ROLES: [AxisRoles; 2] = [
    AxisRoles {
        step: "θ step",
        direction: "θ direction",
        clock: "θ encoder clock",
        data: "θ encoder data",
        first: "θ ring A",
        second: "θ ring B",
        index: "θ ring index",
        home_switch: "θ home switch",
        alarm: "θ driver's alarm",
        driver_line: "θ driver's UART or select",
    },
    AxisRoles {
        step: "φ step",
        direction: "φ direction",
        clock: "φ encoder clock",
        data: "φ encoder data",
        first: "φ ring A",
        second: "φ ring B",
        index: "φ ring index",
        home_switch: "φ home switch",
        alarm: "φ driver's alarm",
        driver_line: "φ driver's UART or select",
    },
];
