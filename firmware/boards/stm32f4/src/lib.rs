//! The arm controller on boards with an STM32F446 at 168 MHz.
//!
//! What it is: the firmware core on real pins. One board an arm; a jumper tells which. Which pin does what is
//! data, one file a board (`gonia_pins::boards`); everything here that touches a register does so for all of
//! them. The tables of the wiring pages are made from the same data.
//!
//! In reset every pin floats: the resistors of the wiring page hold the outputs off, which is no step, no
//! trigger, no current, and the chain open.
//!
//! Log: defmt over RTT (`cargo run --release --bin gonia-NAME` with probe-rs).
#![no_std]

mod alive;
mod arm;
mod before;
mod drivers;
mod encoder;
mod gpio;
mod pulses;
mod quadrature;
mod sectors;
mod steps;
mod tick;
mod time;

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m::singleton;
use cortex_m_rt::{ExceptionFrame, exception};
use defmt_rtt as _;
use embassy_futures::select::{Either3, select3};
use embassy_stm32::flash::Flash;
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{Interrupt, USART2};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{BufferedUart, BufferedUartRx, BufferedUartTx, Config as UartConfig};
use embassy_stm32::{Peri, bind_interrupts, pac, peripherals, usart};
use embassy_time::{Instant, Timer};
use embedded_io_async::{Read, Write};
use gonia_firmware::board::{self, Board, Wake};
use gonia_firmware::controller::ArmController;
use gonia_firmware::node::{ControllerNode, identity};
use gonia_firmware::spi_encoder::SpiEncoder;
use gonia_firmware::store::Store;
use gonia_pins::check::PLL_INPUT_HZ;
use gonia_pins::{Board as Pins, Crystal, Pin};
use gonia_protocol::message::ResetReason;
use gonia_protocol::{BAUD, NODE_CAMERA, NODE_LIGHT};
use static_cell::StaticCell;

use crate::arm::ArmPins;
use crate::drivers::Drivers;
use crate::encoder::EncoderSpi;
use crate::sectors::FlashSectors;

bind_interrupts!(struct Interrupts {
    USART2 => usart::BufferedInterruptHandler<peripherals::USART2>;
});

/// A pin whose pull-up has just been switched on is high after this, cycles of the processor: 50 µs, for 1 nF
/// of cable at 40 kΩ.
const PULL_UP_CYCLES: u32 = 8_400;

/// Runs the arm's controller on a board, for ever.
pub async fn run(of: &'static Pins) -> ! {
    let reset = take_reset_reason();
    let p = embassy_stm32::init(clocks(of.crystal));
    switch_on_caches();
    set_brown_out_level();
    time::start();

    let mut sectors = FlashSectors::new(Flash::new_blocking(p.FLASH), of.layout.settings);
    let (store, settings) = Store::open(&mut sectors);
    let is_camera = {
        let jumper = gpio::switch(of.camera_jumper);
        cortex_m::asm::delay(PULL_UP_CYCLES);
        jumper.is_low()
    };
    let address = if is_camera { NODE_CAMERA } else { NODE_LIGHT };
    let encoders = of
        .axes
        .map(|axis| SpiEncoder::new(EncoderSpi::start(axis.encoder)));
    pulses::start(of);
    steps::start(&of.axes);
    quadrature::start(&of.axes);
    tick::start();
    let pins = ArmPins {
        encoders,
        home_switches: of.axes.map(|axis| gpio::switch(axis.home_switch)),
        alarms: of.alarms.map(|alarms| alarms.map(gpio::switch)),
        drivers: of.drivers.map(Drivers::start),
        interlock: gpio::switch(of.interlock),
        store,
        sectors,
    };
    let (to_host, from_host) = host_wire(of, p.USART2).split();
    // Behind the steps' and the trigger's.
    USART2::set_priority(Priority::P4);

    static NODE: StaticCell<ControllerNode> = StaticCell::new();
    alive::start(of);
    pins.await_chain();
    let controller = ArmController::new(now_us(), settings.as_deref());
    let last_panic = panic_persist::get_panic_message_utf8().unwrap_or_default();
    let identity = identity(of.name, board::next_boot_id(), reset, last_panic);
    let node = NODE.init(ControllerNode::new(address, identity, controller));
    defmt::info!("ready, address {}", address);
    let mut board = Wired {
        pins,
        to_host,
        from_host,
    };
    board::run(node, &mut board).await
}

/// The UART of the host, on the pins that the board has it on.
fn host_wire(of: &Pins, usart: Peri<'static, peripherals::USART2>) -> BufferedUart<'static> {
    let (Some(tx), Some(rx)) = (
        singleton!(: [u8; 2048] = [0; 2048]),
        singleton!(: [u8; 1024] = [0; 1024]),
    ) else {
        defmt::panic!("the program begins once");
    };
    let mut config = UartConfig::default();
    config.baudrate = BAUD;
    // SAFETY: a board uses each pin once (`gonia_pins::check`).
    let p = unsafe { embassy_stm32::Peripherals::steal() };
    let uart = if of.host_tx.pin == Pin::new('A', 2) {
        BufferedUart::new(usart, p.PA3, p.PA2, tx, rx, Interrupts, config)
    } else {
        BufferedUart::new(usart, p.PD6, p.PD5, tx, rx, Interrupts, config)
    };
    match uart {
        Ok(uart) => uart,
        Err(_) => defmt::panic!("USART2 cannot do {} baud", BAUD),
    }
}

/// What the board offers to the main loop.
struct Wired {
    pins: ArmPins,
    to_host: BufferedUartTx<'static>,
    from_host: BufferedUartRx<'static>,
}

impl Board for Wired {
    type Pins = ArmPins;

    fn now_us(&self) -> u64 {
        now_us()
    }

    fn pins(&mut self, _: u64) -> &mut ArmPins {
        &mut self.pins
    }

    async fn send(&mut self, packet: &[u8]) {
        // The buffer holds more than the node ever has waiting: this does not wait for the wire.
        if self.to_host.write_all(packet).await.is_err() {
            defmt::warn!("packet not sent");
        }
    }

    async fn sleep(&mut self, until_us: u64, bytes: &mut [u8]) -> Wake {
        alive::keep();
        let round_us = now_us() + alive::ROUND_US;
        let time = Timer::at(Instant::from_micros(until_us.min(round_us)));
        match select3(pulses::EDGES.receive(), self.from_host.read(bytes), time).await {
            Either3::First(edge_us) => Wake::TriggerEdge(edge_us),
            Either3::Second(Ok(received)) => Wake::Bytes(received),
            // Noise on the line, or too much of it: the packet's checksum shows it, the host repeats.
            Either3::Second(Err(_)) | Either3::Third(()) => Wake::Time,
        }
    }
}

/// Caches and prefetch: without them the processor waits five cycles for most of its instructions.
fn switch_on_caches() {
    pac::FLASH.acr().modify(|w| {
        w.set_icen(true);
        w.set_dcen(true);
        w.set_prften(true);
    });
}

/// Reset below 2.7 V (level 3): less is too little for 168 MHz and for erasing by words, and a processor that
/// runs on does anything. The level is an option byte, which is written once in a board's life, and holds from
/// the next reset on.
fn set_brown_out_level() {
    const KEYS: [u32; 2] = [0x0819_2A3B, 0x4C5D_6E7F];
    const LEVEL_3: u8 = 0;
    if pac::FLASH.optcr().read().bor_lev() == LEVEL_3 {
        return;
    }
    for key in KEYS {
        pac::FLASH.optkeyr().write_value(key);
    }
    pac::FLASH.optcr().modify(|w| w.set_bor_lev(LEVEL_3));
    pac::FLASH.optcr().modify(|w| w.set_optstrt(true));
    while pac::FLASH.sr().read().bsy() {}
    pac::FLASH.optcr().modify(|w| w.set_optlock(true));
}

/// The processor cannot go on: what moves is stopped first.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    alive::all_off();
    defmt::error!("hard fault at {:#010x}", frame.pc());
    panic!("hard fault at {:#010x}", frame.pc())
}

/// What moves is stopped; the message is kept for the next `hello`, and the chip starts anew.
#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    alive::all_off();
    panic_persist::report_panic_info(info);
    SCB::sys_reset()
}

/// 168 MHz from what the board has.
fn clocks(crystal: Crystal) -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(Hse {
        freq: Hertz(crystal.hz),
        mode: if crystal.is_given {
            HseMode::Bypass
        } else {
            HseMode::Oscillator
        },
    });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::from_bits((crystal.hz / PLL_INPUT_HZ) as u8),
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: None,
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

/// Why the chip started; the flags are cleared for the next time.
fn take_reset_reason() -> ResetReason {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    // Power coming on sets the brown-out flag too, so it comes first; every reset sets the pin's.
    if flags.porrstf() {
        ResetReason::PowerOn
    } else if flags.borrstf() {
        ResetReason::BrownOut
    } else if flags.wdgrstf() || flags.wwdgrstf() {
        ResetReason::Watchdog
    } else if flags.sftrstf() {
        ResetReason::Software
    } else if flags.padrstf() {
        ResetReason::Pin
    } else {
        ResetReason::Unknown
    }
}

fn now_us() -> u64 {
    Instant::now().as_micros()
}
