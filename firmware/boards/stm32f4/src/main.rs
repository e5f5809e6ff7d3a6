//! The arm controller on a NUCLEO-F446RE (STM32F446RE, 168 MHz).
//!
//! What it is: the firmware core on real pins. One board an arm; a jumper tells which.
//!
//! | function | pin | Nucleo |
//! |---|---|---|
//! | wire to the host: USART2, 921,600 baud, through the ST-Link's USB | PA2, PA3 | – |
//! | θ: step (TIM5), direction | PA0, PA9 | A0, D8 |
//! | φ: step (TIM2), direction | PB10, PB4 | D6, D5 |
//! | θ encoder (SSI): clock, data | PA5, PA6 | D13, D12 |
//! | φ encoder (SSI): clock, data | PB13, PB14 | CN10-30, CN10-28 |
//! | home switches θ, φ (to ground when closed) | PC0, PC1 | A5, A4 |
//! | interlock chain (to ground when closed), relay that opens it | PC2, PC3 | CN7-35, CN7-37 |
//! | trigger out, trigger in from the other arm | PB5, PC7 | D4, D9 |
//! | camera arm: jumper to ground; light arm: open | PB0 | A3 |
//!
//! Settings: flash sectors 6 and 7. Log: defmt over RTT (`cargo run --release` with probe-rs).
#![no_std]
#![no_main]

mod arm;
mod sectors;
mod steps;

use cortex_m::singleton;
use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_futures::select::{Either3, select3};
use embassy_stm32::exti::ExtiInput;
use embassy_stm32::flash::Flash;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::mode::Async;
use embassy_stm32::peripherals::{TIM2, TIM5};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllSource, Sysclk,
};
use embassy_stm32::spi::{self, MODE_2, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Ch3};
use embassy_stm32::usart::{BufferedUart, BufferedUartRx, BufferedUartTx, Config as UartConfig};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, bind_interrupts, exti, interrupt, pac, peripherals, usart};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Instant, Timer};
use embedded_io_async::{Read, Write};
use gonia_firmware::board::{self, Board, Wake};
use gonia_firmware::controller::ArmController;
use gonia_firmware::node::{ControllerNode, identity};
use gonia_firmware::ssi::SsiEncoder;
use gonia_firmware::store::Store;
use gonia_protocol::message::ResetReason;
use gonia_protocol::{NODE_CAMERA, NODE_LIGHT};
use panic_persist as _;
use static_cell::StaticCell;

use crate::arm::ArmPins;
use crate::sectors::FlashSectors;

bind_interrupts!(struct Interrupts {
    USART2 => usart::BufferedInterruptHandler<peripherals::USART2>;
    EXTI9_5 => exti::InterruptHandler<interrupt::typelevel::EXTI9_5>;
});

/// The other arm has raised the trigger wire.
static TRIGGERED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

const BAUD: u32 = 921_600;
/// Longer than erasing a sector of flash takes.
const WATCHDOG_US: u32 = 8_000_000;

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let reset = take_reset_reason();
    let p = embassy_stm32::init(clocks());

    let mut sectors = FlashSectors(Flash::new_blocking(p.FLASH));
    let (store, settings) = Store::open(&mut sectors);
    let output = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Medium);
    let switch = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
    let address = match Input::new(p.PB0, Pull::Up).is_low() {
        true => NODE_CAMERA,
        false => NODE_LIGHT,
    };
    let theta = Spi::new_blocking_rxonly(p.SPI1, p.PA5, p.PA6, ssi_config());
    let phi = Spi::new_blocking_rxonly(p.SPI2, p.PB13, p.PB14, ssi_config());
    // A dropped pin goes back to an input: these stay with their timers.
    core::mem::forget(PwmPin::<TIM5, Ch1>::new(p.PA0, OutputType::PushPull));
    core::mem::forget(PwmPin::<TIM2, Ch3>::new(p.PB10, OutputType::PushPull));
    steps::start([output(p.PA9.into()), output(p.PB4.into())]);
    let pins = ArmPins {
        encoders: [SsiEncoder::new(theta), SsiEncoder::new(phi)],
        home_switches: [switch(p.PC0.into()), switch(p.PC1.into())],
        interlock: switch(p.PC2.into()),
        interlock_relay: output(p.PC3.into()),
        trigger: output(p.PB5.into()),
        store,
        sectors,
    };
    let trigger_in = ExtiInput::new(p.PC7, p.EXTI7, Pull::Down, Interrupts);
    match watch_trigger(trigger_in) {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::panic!("main runs once"),
    }

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

    static NODE: StaticCell<ControllerNode> = StaticCell::new();
    let controller = ArmController::new(now_us(), settings.as_deref());
    let last_panic = panic_persist::get_panic_message_utf8().unwrap_or_default();
    let identity = identity("stm32f4", board::next_boot_id(), reset, last_panic);
    let node = NODE.init(ControllerNode::new(address, identity, controller));
    let mut watchdog = IndependentWatchdog::new(p.IWDG, WATCHDOG_US);
    watchdog.unleash();
    defmt::info!("ready, address {}", address);
    let mut nucleo = Nucleo {
        pins,
        to_host,
        from_host,
        watchdog,
    };
    board::run(node, &mut nucleo).await
}

/// What the board offers to the main loop.
struct Nucleo {
    pins: ArmPins,
    to_host: BufferedUartTx<'static>,
    from_host: BufferedUartRx<'static>,
    watchdog: IndependentWatchdog<'static, peripherals::IWDG>,
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
        self.watchdog.pet();
        let time = Timer::at(Instant::from_micros(until_us));
        match select3(TRIGGERED.wait(), self.from_host.read(bytes), time).await {
            Either3::First(()) => Wake::TriggerEdge,
            Either3::Second(Ok(received)) => Wake::Bytes(received),
            // Noise on the line, or too much of it: the packet's checksum shows it, the host repeats.
            Either3::Second(Err(_)) | Either3::Third(()) => Wake::Time,
        }
    }
}

/// A task of its own, so that no edge falls between two looks at the pin.
#[embassy_executor::task]
async fn watch_trigger(mut pin: ExtiInput<'static, Async>) {
    loop {
        pin.wait_for_rising_edge().await;
        TRIGGERED.signal(());
    }
}

/// SPI settings that speak SSI at 1 MHz, which 50 m of cable allow.
fn ssi_config() -> spi::Config {
    let mut config = spi::Config::default();
    config.mode = MODE_2;
    config.frequency = Hertz(1_000_000);
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
