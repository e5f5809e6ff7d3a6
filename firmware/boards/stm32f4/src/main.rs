//! The arm controller on a NUCLEO-F446RE (STM32F446RE, 168 MHz).
//!
//! What it is: the firmware core on real pins. One board an arm; a jumper tells which.
//!
//! | function | pin | Nucleo |
//! |---|---|---|
//! | wire to the host: USART2, through the ST-Link's USB | PA2, PA3 | – |
//! | θ: step (TIM5), direction | PA0, PA9 | A0, D8 |
//! | φ: step (TIM2), direction | PB10, PB4 | D6, D5 |
//! | θ encoder (SSI): clock, data | PA5, PA6 | D13, D12 |
//! | φ encoder (SSI): clock, data | PB13, PB14 | CN10-30, CN10-28 |
//! | home switches θ, φ (to ground when closed) | PC0, PC1 | A5, A4 |
//! | interlock chain (to ground when closed) | PC2 | CN7-35 |
//! | interlock relay (TIM8, high: its contact closes this arm's part of the chain) | PC6 | CN10-4 |
//! | drivers' current (high: on) | PC3 | CN7-37 |
//! | trigger out, trigger in from the other arm (both TIM3) | PB5, PC8 | D4, CN10-2 |
//! | camera arm: jumper to ground; light arm: open | PB0 | A3 |
//!
//! In reset every pin floats: the pull-downs of `docs/src/guides/arms.md` hold the outputs low, which is no
//! step, no trigger, no current, and the chain open.
//!
//! Settings: flash sectors 1 and 2. Log: defmt over RTT (`cargo run --release` with probe-rs).
#![no_std]
#![no_main]

mod alive;
mod arm;
mod pulses;
mod sectors;
mod steps;
mod time;

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m::singleton;
use cortex_m_rt::{ExceptionFrame, exception};
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_futures::select::{Either3, select3};
use embassy_stm32::flash::Flash;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::interrupt::Priority;
use embassy_stm32::interrupt::typelevel::{Interrupt, USART2};
use embassy_stm32::peripherals::{TIM2, TIM3, TIM5, TIM8};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllSource, Sysclk,
};
use embassy_stm32::spi::{self, MODE_2, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::input_capture::CapturePin;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Ch2, Ch3};
use embassy_stm32::usart::{BufferedUart, BufferedUartRx, BufferedUartTx, Config as UartConfig};
use embassy_stm32::{Peri, bind_interrupts, pac, peripherals, usart};
use embassy_time::{Instant, Timer};
use embedded_io_async::{Read, Write};
use gonia_firmware::board::{self, Board, Wake};
use gonia_firmware::controller::ArmController;
use gonia_firmware::node::{ControllerNode, identity};
use gonia_firmware::ssi::SsiEncoder;
use gonia_firmware::store::Store;
use gonia_protocol::message::ResetReason;
use gonia_protocol::{BAUD, NODE_CAMERA, NODE_LIGHT};
use static_cell::StaticCell;

use crate::arm::ArmPins;
use crate::sectors::FlashSectors;

bind_interrupts!(struct Interrupts {
    USART2 => usart::BufferedInterruptHandler<peripherals::USART2>;
});

/// Clock of both rings, Hz: what 50 m of cable allow, and dividers make of both buses' clocks exactly (84 MHz
/// by 256, 42 MHz by 128).
const SSI_HZ: u32 = 328_125;
/// A pin whose pull-up has just been switched on is high after this, cycles of the processor: 50 µs, for 1 nF
/// of cable at 40 kΩ.
const PULL_UP_CYCLES: u32 = 8_400;

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let reset = take_reset_reason();
    let p = embassy_stm32::init(clocks());
    switch_on_caches();
    time::start();

    let mut sectors = FlashSectors(Flash::new_blocking(p.FLASH));
    let (store, settings) = Store::open(&mut sectors);
    let output = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Medium);
    let switch = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
    let is_camera = {
        let jumper = Input::new(p.PB0, Pull::Up);
        cortex_m::asm::delay(PULL_UP_CYCLES);
        jumper.is_low()
    };
    let address = if is_camera { NODE_CAMERA } else { NODE_LIGHT };
    let theta = Spi::new_blocking_rxonly(p.SPI1, p.PA5, p.PA6, ssi_config());
    let phi = Spi::new_blocking_rxonly(p.SPI2, p.PB13, p.PB14, ssi_config());
    // A dropped pin goes back to an input: these stay with their timers.
    core::mem::forget(PwmPin::<TIM5, Ch1>::new(p.PA0, OutputType::PushPull));
    core::mem::forget(PwmPin::<TIM2, Ch3>::new(p.PB10, OutputType::PushPull));
    core::mem::forget(PwmPin::<TIM3, Ch2>::new(p.PB5, OutputType::PushPull));
    core::mem::forget(CapturePin::<TIM3, Ch3>::new(p.PC8, Pull::Down));
    core::mem::forget(PwmPin::<TIM8, Ch1>::new(p.PC6, OutputType::PushPull));
    pulses::start();
    steps::start([output(p.PA9.into()), output(p.PB4.into())]);
    let pins = ArmPins {
        encoders: [SsiEncoder::new(theta), SsiEncoder::new(phi)],
        home_switches: [switch(p.PC0.into()), switch(p.PC1.into())],
        interlock: switch(p.PC2.into()),
        store,
        sectors,
    };

    let (Some(tx), Some(rx)) = (
        singleton!(: [u8; 2048] = [0; 2048]),
        singleton!(: [u8; 1024] = [0; 1024]),
    ) else {
        defmt::panic!("main runs once");
    };
    let mut config = UartConfig::default();
    config.baudrate = BAUD;
    let uart = BufferedUart::new(p.USART2, p.PA3, p.PA2, tx, rx, Interrupts, config);
    let Ok(uart) = uart else {
        defmt::panic!("USART2 cannot do {} baud", BAUD);
    };
    let (to_host, from_host) = uart.split();
    // Behind the steps' and the trigger's.
    USART2::set_priority(Priority::P4);

    static NODE: StaticCell<ControllerNode> = StaticCell::new();
    alive::start();
    pins.await_chain();
    let mut drivers = output(p.PC3.into());
    drivers.set_high();
    core::mem::forget(drivers);
    let controller = ArmController::new(now_us(), settings.as_deref());
    let last_panic = panic_persist::get_panic_message_utf8().unwrap_or_default();
    let identity = identity("stm32f4", board::next_boot_id(), reset, last_panic);
    let node = NODE.init(ControllerNode::new(address, identity, controller));
    defmt::info!("ready, address {}", address);
    let mut nucleo = Nucleo {
        pins,
        to_host,
        from_host,
    };
    board::run(node, &mut nucleo).await
}

/// What the board offers to the main loop.
struct Nucleo {
    pins: ArmPins,
    to_host: BufferedUartTx<'static>,
    from_host: BufferedUartRx<'static>,
}

impl Board for Nucleo {
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

/// SPI settings that speak SSI.
fn ssi_config() -> spi::Config {
    let mut config = spi::Config::default();
    config.mode = MODE_2;
    config.frequency = Hertz(SSI_HZ);
    config
}

/// 168 MHz from the 8 MHz that the ST-Link provides.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(Hse {
        freq: Hertz(8_000_000),
        mode: HseMode::Bypass,
    });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
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
