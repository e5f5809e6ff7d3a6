//! NUCLEO-F446RE, for drivers in boxes of their own. Places are those of ST's user manual UM1724.

use crate::{
    Axis, Board, Crystal, DriverSpi, DriverWires, Encoder, Layout, Level, Output, Pin,
    QuadratureWires, StepEdge, TimerOutput, wire,
};

/// Settings in sectors 1 and 2, of 16 kB, which are erased in half a second; the program lies behind them.
pub const NUCLEO_F446RE: Board = Board {
    name: "nucleo-f446re",
    title: "NUCLEO-F446RE",
    crystal: Crystal {
        hz: 8_000_000,
        is_given: true,
    },
    layout: Layout {
        image: 0,
        program: Some(0xC000),
        settings: [0x4000, 0x8000],
    },
    host_tx: wire(Pin::new('A', 2), "ST-Link"),
    host_rx: wire(Pin::new('A', 3), "ST-Link"),
    axes: [
        Axis {
            step: wire(Pin::new('A', 0), "A0"),
            edge: StepEdge::Timer(1),
            direction: wire(Pin::new('A', 9), "D8"),
            encoder: Encoder {
                spi: 1,
                clock: wire(Pin::new('A', 5), "D13"),
                data: wire(Pin::new('A', 6), "D12"),
            },
            quadrature: Some(QuadratureWires {
                first: wire(Pin::new('B', 6), "D10"),
                second: wire(Pin::new('B', 8), "D15"),
                index: wire(Pin::new('B', 9), "D14"),
            }),
            home_switch: wire(Pin::new('C', 0), "A5"),
        },
        Axis {
            step: wire(Pin::new('B', 10), "D6"),
            edge: StepEdge::Timer(3),
            direction: wire(Pin::new('B', 4), "D5"),
            encoder: Encoder {
                spi: 2,
                clock: wire(Pin::new('B', 13), "CN10-30"),
                data: wire(Pin::new('B', 14), "CN10-28"),
            },
            quadrature: Some(QuadratureWires {
                first: wire(Pin::new('B', 15), "CN10-26"),
                second: wire(Pin::new('B', 12), "CN10-16"),
                index: wire(Pin::new('B', 1), "CN10-24"),
            }),
            home_switch: wire(Pin::new('C', 1), "A4"),
        },
    ],
    drivers: Some(DriverWires {
        lines: [wire(Pin::new('A', 8), "D7"), wire(Pin::new('A', 10), "D2")],
        spi: DriverSpi {
            spi: 3,
            clock: wire(Pin::new('C', 10), "CN7-1"),
            out: wire(Pin::new('C', 12), "CN7-3"),
            data: wire(Pin::new('C', 11), "CN7-2"),
        },
    }),
    enables: &[Output {
        wire: wire(Pin::new('C', 3), "CN7-37"),
        on: Level::High,
    }],
    interlock: wire(Pin::new('C', 2), "CN7-35"),
    relay: TimerOutput {
        wire: wire(Pin::new('C', 6), "CN10-4"),
        channel: 1,
        is_complementary: false,
    },
    brakes: Some(TimerOutput {
        wire: wire(Pin::new('C', 7), "D9"),
        channel: 2,
        is_complementary: false,
    }),
    alarms: Some([
        wire(Pin::new('C', 4), "CN10-34"),
        wire(Pin::new('C', 5), "CN10-6"),
    ]),
    trigger_out: TimerOutput {
        wire: wire(Pin::new('B', 5), "D4"),
        channel: 2,
        is_complementary: false,
    },
    trigger_in: TimerOutput {
        wire: wire(Pin::new('C', 8), "CN10-2"),
        channel: 3,
        is_complementary: false,
    },
    camera_jumper: wire(Pin::new('B', 0), "A3"),
};
