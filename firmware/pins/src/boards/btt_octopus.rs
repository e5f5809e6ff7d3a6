//! BIGTREETECH Octopus 1.0 and 1.1 with the STM32F446ZE, drivers in its sockets MOTOR0 (θ) and MOTOR1 (φ).
//!
//! Which pin is where: the pin drawing of BIGTREETECH, as Klipper's `generic-bigtreetech-octopus-v1.1.cfg`,
//! Marlin's `pins_BTT_OCTOPUS_V1_common.h` and RatOS's `btt-octopus-11` name it (pins only). The host's UART on
//! the Raspberry Pi's header is that of BIGTREETECH's own README for Klipper.
//!
//! No socket's step pin is a channel of TIM2 or TIM5, nor of any timer that TIM8 can gate, so the interrupt of
//! the step timers makes the edges: no processor, no step.

use crate::{
    Axis, Board, Crystal, DriverSpi, DriverWires, Encoder, Layout, Level, Output, Pin,
    QuadratureWires, StepEdge, TimerOutput, wire,
};

/// The bootloader that the board is sold with has the first 32 kB. Settings in the last two sectors, of 128 kB,
/// so that an update by SD card, which writes from the image's beginning, does not reach them.
pub const BTT_OCTOPUS: Board = Board {
    name: "btt-octopus",
    title: "BTT Octopus 1.0/1.1 (STM32F446)",
    crystal: Crystal {
        hz: 12_000_000,
        is_given: false,
    },
    layout: Layout {
        image: 0x8000,
        program: None,
        settings: [0x4_0000, 0x6_0000],
    },
    host_tx: wire(Pin::new('D', 5), "Raspberry Pi: TX2"),
    host_rx: wire(Pin::new('D', 6), "Raspberry Pi: RX2"),
    axes: [
        Axis {
            step: wire(Pin::new('F', 13), "socket MOTOR0"),
            edge: StepEdge::Interrupt,
            direction: wire(Pin::new('F', 12), "socket MOTOR0"),
            encoder: Encoder {
                spi: 3,
                clock: wire(Pin::new('B', 3), "SPI3: SCK"),
                data: wire(Pin::new('B', 4), "SPI3: MISO"),
            },
            quadrature: Some(QuadratureWires {
                first: wire(Pin::new('E', 8), "EXP1-1"),
                second: wire(Pin::new('E', 7), "EXP1-2"),
                index: wire(Pin::new('E', 9), "EXP1-3"),
            }),
            home_switch: wire(Pin::new('G', 12), "STOP_4"),
        },
        Axis {
            step: wire(Pin::new('G', 0), "socket MOTOR1"),
            edge: StepEdge::Interrupt,
            direction: wire(Pin::new('G', 1), "socket MOTOR1"),
            encoder: Encoder {
                spi: 4,
                clock: wire(Pin::new('E', 12), "EXP1-5"),
                data: wire(Pin::new('E', 13), "EXP1-6"),
            },
            quadrature: Some(QuadratureWires {
                first: wire(Pin::new('E', 14), "EXP1-7"),
                second: wire(Pin::new('E', 15), "EXP1-8"),
                index: wire(Pin::new('E', 10), "EXP1-4"),
            }),
            home_switch: wire(Pin::new('G', 13), "STOP_5"),
        },
    ],
    // Each socket has one pin for PDN_UART or CS, by its jumpers; all share SPI1.
    drivers: Some(DriverWires {
        lines: [
            wire(Pin::new('C', 4), "socket MOTOR0"),
            wire(Pin::new('D', 11), "socket MOTOR1"),
        ],
        spi: DriverSpi {
            spi: 1,
            clock: wire(Pin::new('A', 5), "all sockets"),
            out: wire(Pin::new('A', 7), "all sockets"),
            data: wire(Pin::new('A', 6), "all sockets"),
        },
    }),
    enables: &[
        Output {
            wire: wire(Pin::new('F', 14), "socket MOTOR0"),
            on: Level::Low,
        },
        Output {
            wire: wire(Pin::new('F', 15), "socket MOTOR1"),
            on: Level::Low,
        },
    ],
    interlock: wire(Pin::new('G', 10), "STOP_2"),
    relay: TimerOutput {
        wire: wire(Pin::new('B', 0), "RGB"),
        channel: 2,
        is_complementary: true,
    },
    // The pin that leads to PDN_UART or CS of a socket that is left empty.
    brakes: Some(TimerOutput {
        wire: wire(Pin::new('C', 6), "socket MOTOR2: CS"),
        channel: 1,
        is_complementary: false,
    }),
    // DIAG of the modules in MOTOR0 and MOTOR1, by the board's own jumpers: low while all is well.
    alarms: Some([
        wire(Pin::new('G', 6), "jumper DIAG of STOP_0"),
        wire(Pin::new('G', 9), "jumper DIAG of STOP_1"),
    ]),
    trigger_out: TimerOutput {
        wire: wire(Pin::new('B', 5), "SPI3: MOSI"),
        channel: 2,
        is_complementary: false,
    },
    trigger_in: TimerOutput {
        wire: wire(Pin::new('B', 1), "EXP2-3"),
        channel: 4,
        is_complementary: false,
    },
    camera_jumper: wire(Pin::new('G', 11), "STOP_3"),
};
