//! What cannot be of a board: found on the host, before anything is built for a chip.

use core::fmt;

use crate::signals::{Signal, function};
use crate::{Board, CLOCK_TIMER, FLASH_LEN, Pin, SECTORS, Use};

/// Characters of the name that an identity has room for.
const NAME_MAX: usize = 16;
/// The PLL's input, Hz.
pub const PLL_INPUT_HZ: u32 = 2_000_000;
/// Crystals that the chip takes, Hz (DS10693, table 38).
const CRYSTAL_HZ: core::ops::RangeInclusive<u32> = 4_000_000..=26_000_000;
/// The channel of the board's clock that is its alarm.
const ALARM: u8 = 1;
/// Ports of the chip.
const PORTS: core::ops::RangeInclusive<char> = 'A'..='H';
/// The debugger's.
const DEBUG_PINS: [Pin; 2] = [Pin::new('A', 13), Pin::new('A', 14)];

/// Why a board cannot be as it is described.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Two uses of a pin.
    Twice(Pin, &'static str, &'static str),
    /// A pin that does not carry the signal.
    NotReached(Pin, &'static str, Signal),
    /// The chip has no such pin.
    NoPin(Pin, &'static str),
    /// The pin is the debugger's.
    Debugger(Pin, &'static str),
    /// The channel of the clock is its alarm.
    Alarm(&'static str),
    /// An input of a timer is a channel, never its complementary output.
    Complement(&'static str),
    /// The host's wire is on two ports.
    HostPorts,
    /// The waves and the index of a quadrature ring are on more than one port.
    QuadraturePorts,
    /// SPIs 1 to 4 read encoders, each one.
    SharedSpi(u8),
    /// The drivers' SPI is an encoder's.
    DriversSpi(u8),
    /// Relay and brakes on one channel of TIM8, which has one count for both.
    SharedChannel(u8),
    /// The name is empty, too long, or has other characters than small letters, digits and hyphens.
    Name,
    /// Hz: the PLL cannot start from it.
    Crystal(u32),
    /// Here no sector begins.
    NoSector(u32),
    /// The settings lie within the image.
    SettingsInImage(u32),
    /// Settings and settings.
    SameSector(u32),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Twice(pin, first, second) => {
                write!(
                    f,
                    "{pin} is both {first} and {second}; choose another pin for one"
                )
            }
            Self::NotReached(pin, role, signal) => write!(
                f,
                "{pin} ({role}) does not carry {signal}; choose a pin of that signal in signals.rs"
            ),
            Self::NoPin(pin, role) => {
                write!(f, "{pin} ({role}) is no pin of the chip; write A0 to H15")
            }
            Self::Debugger(pin, role) => {
                write!(f, "{pin} ({role}) is the debugger's; choose another pin")
            }
            Self::Alarm(role) => write!(
                f,
                "{role}: channel {ALARM} of TIM{CLOCK_TIMER} is the clock's alarm; choose another"
            ),
            Self::Complement(role) => {
                write!(
                    f,
                    "{role} is an input; choose a channel, no complementary output"
                )
            }
            Self::HostPorts => write!(
                f,
                "the host's wires are on two ports; write PA2 with PA3, or PD5 with PD6"
            ),
            Self::QuadraturePorts => write!(
                f,
                "A, B and index of a ring are on two ports; put all three on one"
            ),
            Self::SharedSpi(spi) => {
                write!(
                    f,
                    "both encoders are on SPI{spi}; give each an SPI of its own"
                )
            }
            Self::DriversSpi(spi) => write!(
                f,
                "the drivers are on SPI{spi}, which reads an encoder; give them an SPI of their own"
            ),
            Self::SharedChannel(channel) => write!(
                f,
                "relay and brakes are on channel {channel} of TIM8; give each a channel of its own"
            ),
            Self::Name => write!(
                f,
                "the name must have 1 to {NAME_MAX} small letters, digits and hyphens"
            ),
            Self::Crystal(hz) => write!(
                f,
                "a crystal of {hz} Hz; the PLL needs a whole number of 2 MHz, 4 to 26 MHz"
            ),
            Self::NoSector(at) => {
                write!(f, "no sector of the flash begins at {at:#x}; see SECTORS")
            }
            Self::SettingsInImage(at) => write!(
                f,
                "the settings at {at:#x} lie within the image; move them, or the program"
            ),
            Self::SameSector(at) => {
                write!(
                    f,
                    "both copies of the settings lie at {at:#x}; give each a sector"
                )
            }
        }
    }
}

/// Reports everything that cannot be.
pub fn check(board: &Board, mut report: impl FnMut(Fault)) {
    let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let length = board.name.len();
    if length == 0 || length > NAME_MAX || !board.name.chars().all(is_plain) {
        report(Fault::Name);
    }
    let hz = board.crystal.hz;
    if !CRYSTAL_HZ.contains(&hz) || !hz.is_multiple_of(PLL_INPUT_HZ) {
        report(Fault::Crystal(hz));
    }
    check_pins(board, &mut report);
    check_layout(board, &mut report);
}

fn check_pins(board: &Board, report: &mut impl FnMut(Fault)) {
    let mut nth = 0;
    board.for_each_use(|this| {
        check_use(this, report);
        let mut earlier = 0;
        board.for_each_use(|other| {
            if earlier < nth && other.wire.pin == this.wire.pin {
                report(Fault::Twice(this.wire.pin, other.role, this.role));
            }
            earlier += 1;
        });
        nth += 1;
    });
    for (output, role) in [
        (board.trigger_out, "trigger out"),
        (board.trigger_in, "trigger in"),
    ] {
        if output.channel == ALARM {
            report(Fault::Alarm(role));
        }
    }
    if board.trigger_in.is_complementary {
        report(Fault::Complement("trigger in"));
    }
    if board.host_tx.pin.port != board.host_rx.pin.port {
        report(Fault::HostPorts);
    }
    for ring in board.axes.iter().filter_map(|axis| axis.quadrature) {
        let port = ring.first.pin.port;
        if ring.second.pin.port != port || ring.index.pin.port != port {
            report(Fault::QuadraturePorts);
        }
    }
    let relay = board.relay.channel;
    if board.brakes.is_some_and(|brakes| brakes.channel == relay) {
        report(Fault::SharedChannel(relay));
    }
    let [theta, phi] = board.axes.map(|axis| axis.encoder.spi);
    if theta == phi {
        report(Fault::SharedSpi(theta));
    }
    let of_drivers = board.drivers.map(|drivers| drivers.spi.spi);
    for encoder in [theta, phi] {
        if of_drivers == Some(encoder) {
            report(Fault::DriversSpi(encoder));
        }
    }
}

fn check_use(this: Use, report: &mut impl FnMut(Fault)) {
    let (pin, role) = (this.wire.pin, this.role);
    if !PORTS.contains(&pin.port) || pin.number > 15 {
        report(Fault::NoPin(pin, role));
    }
    if DEBUG_PINS.contains(&pin) {
        report(Fault::Debugger(pin, role));
    }
    if let Some(signal) = this.signal
        && function(pin, signal).is_none()
    {
        report(Fault::NotReached(pin, role, signal));
    }
}

/// The length of the sector that begins here.
pub fn sector_len(offset: u32) -> Option<u32> {
    let mut begins = 0;
    for len in SECTORS {
        if begins == offset {
            return Some(len);
        }
        begins += len;
    }
    None
}

/// Where the flash that the image may take ends: at the settings behind it, or at the chip's end.
pub fn image_end(board: &Board) -> u32 {
    let program = board.layout.program.unwrap_or(board.layout.image);
    let behind = board.layout.settings.into_iter().filter(|&at| at > program);
    behind.min().unwrap_or(FLASH_LEN)
}

fn check_layout(board: &Board, report: &mut impl FnMut(Fault)) {
    let layout = board.layout;
    let [one, other] = layout.settings;
    if one == other {
        report(Fault::SameSector(one));
    }
    let program = layout.program.unwrap_or(layout.image);
    for at in [layout.image, program, one, other] {
        if sector_len(at).is_none() {
            report(Fault::NoSector(at));
        }
    }
    for at in layout.settings {
        let end = at + sector_len(at).unwrap_or(0);
        // The vector table has the sector where the image begins; the program, what is behind its beginning.
        let is_table = at == layout.image;
        let is_between = layout.image < at && end <= program;
        let is_before = end <= layout.image;
        if is_table || !(is_between || is_before || at >= image_end(board)) {
            report(Fault::SettingsInImage(at));
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::{String, ToString};
    use std::vec::Vec;

    use super::*;
    use crate::boards::{BOARDS, BTT_OCTOPUS, NUCLEO_F446RE};
    use crate::{Level, Output, QuadratureWires, wire};

    fn faults(board: &Board) -> Vec<Fault> {
        let mut faults = Vec::new();
        check(board, |fault| faults.push(fault));
        faults
    }

    #[test]
    fn every_board_can_be_as_it_is_described() {
        for board in BOARDS {
            let found: Vec<String> = faults(board).iter().map(Fault::to_string).collect();
            assert!(found.is_empty(), "{}: {}", board.name, found.join("; "));
        }
    }

    #[test]
    fn two_uses_of_a_pin_are_found_and_named() {
        let mut board = NUCLEO_F446RE;
        board.interlock.pin = board.axes[1].direction.pin;
        assert_eq!(
            faults(&board),
            [Fault::Twice(
                Pin::new('B', 4),
                "φ direction",
                "interlock chain"
            )]
        );
        // Three uses are three pairs.
        board.camera_jumper.pin = board.interlock.pin;
        assert_eq!(faults(&board).len(), 3);
        let fault = faults(&board)[0].to_string();
        assert_eq!(
            fault,
            "PB4 is both φ direction and interlock chain; choose another pin for one"
        );
    }

    #[test]
    fn a_pin_that_its_timer_spi_or_uart_does_not_reach_is_found() {
        let mut board = NUCLEO_F446RE;
        // TIM5_CH2 where channel 1 was meant.
        board.axes[0].step.pin = Pin::new('A', 1);
        board.axes[1].encoder.data.pin = Pin::new('B', 15);
        board.host_tx.pin = Pin::new('A', 8);
        let signals: Vec<Signal> = faults(&board)
            .into_iter()
            .filter_map(|fault| match fault {
                Fault::NotReached(_, _, signal) => Some(signal),
                _ => None,
            })
            .collect();
        let expected = [Signal::Timer(5, 1), Signal::SpiData(2), Signal::UartTx(2)];
        assert_eq!(signals, expected);
        // The Octopus's step pins are no timer's.
        let mut board = BTT_OCTOPUS;
        board.axes[0].edge = crate::StepEdge::Timer(1);
        assert_eq!(faults(&board).len(), 1);
    }

    #[test]
    fn what_belongs_to_the_debugger_the_clock_or_no_chip_is_found() {
        let mut board = NUCLEO_F446RE;
        board.interlock.pin = Pin::new('A', 13);
        board.camera_jumper.pin = Pin::new('J', 1);
        board.trigger_in.channel = 1;
        board.axes[1].encoder.spi = 1;
        if let Some(drivers) = &mut board.drivers {
            drivers.spi.spi = 1;
        }
        board.host_rx.pin = Pin::new('D', 6);
        board.axes[1].quadrature = board.axes[1].quadrature.map(|ring| QuadratureWires {
            index: wire(Pin::new('C', 13), ""),
            ..ring
        });
        if let Some(brakes) = &mut board.brakes {
            brakes.channel = board.relay.channel;
        }
        let found = faults(&board);
        for fault in [
            Fault::Debugger(Pin::new('A', 13), "interlock chain"),
            Fault::NoPin(Pin::new('J', 1), "camera arm"),
            Fault::Alarm("trigger in"),
            Fault::SharedSpi(1),
            Fault::DriversSpi(1),
            Fault::SharedChannel(1),
            Fault::HostPorts,
            Fault::QuadraturePorts,
        ] {
            assert!(found.contains(&fault), "{fault}: {found:?}");
        }
    }

    #[test]
    fn settings_within_the_image_are_found() {
        for (settings, fault) in [
            ([0, 0x4000], Fault::SettingsInImage(0)),
            ([0x8000, 0x8000], Fault::SameSector(0x8000)),
            ([0x4000, 0x5000], Fault::NoSector(0x5000)),
        ] {
            let mut board = NUCLEO_F446RE;
            board.layout.settings = settings;
            assert!(faults(&board).contains(&fault), "{fault}");
        }
        // The program begins behind its vector table, where the settings are.
        let mut board = NUCLEO_F446RE;
        board.layout.program = None;
        assert_eq!(image_end(&board), 0x4000);
        let mut board = BTT_OCTOPUS;
        board.layout.settings = [0x4000, 0x8000];
        assert!(faults(&board).contains(&Fault::SettingsInImage(0x8000)));
    }

    #[test]
    fn names_and_crystals_are_checked() {
        for name in ["", "Nucleo", "a-board-with-a-long-name"] {
            let board = Board {
                name,
                ..NUCLEO_F446RE
            };
            assert_eq!(faults(&board), [Fault::Name], "{name}");
        }
        for hz in [0, 8_000_001, 28_000_000] {
            let mut board = NUCLEO_F446RE;
            board.crystal.hz = hz;
            assert_eq!(faults(&board), [Fault::Crystal(hz)]);
        }
    }

    #[test]
    fn every_output_has_a_resistor_that_holds_it_off() {
        const FREE: Output = Output {
            wire: wire(Pin::new('D', 2), ""),
            on: Level::Low,
        };
        let board = Board {
            enables: &[FREE],
            ..NUCLEO_F446RE
        };
        let mut held = None;
        board.for_each_use(|this| {
            if this.wire.pin == FREE.wire.pin {
                held = this.resistor;
            }
        });
        assert_eq!(held, Some(Level::High));
    }
}
