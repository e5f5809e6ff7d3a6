//! The arm controller in QEMU.
//!
//! What it is: the firmware core on an emulated Cortex-M4F, wired to the simulator's plant instead
//! of pins. Wire: UART0, log (defmt): UART1. It answers to the light arm's address. Settings live
//! in RAM and are gone after a restart. QEMU does not keep real time: counts and positions here are
//! worth looking at, rates are not.
//!
//! ```text
//! qemu-system-arm -M mps2-an386 -display none -monitor none -kernel ELF \
//!     -serial unix:gonia.sock,server=on,wait=off -serial file:defmt.bin
//! ```
#![no_std]
#![no_main]

mod arm;
mod register;
mod steps;
mod time;
mod uart;

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::{entry, exception};
use embassy_executor::InterruptExecutor;
use embassy_futures::select::{Either, select};
use embassy_time::{Instant, Timer};
use gonia_firmware::board::{self, Board, Wake};
use gonia_firmware::controller::ArmController;
use gonia_firmware::node::{ControllerNode, identity};
use gonia_protocol::NODE_LIGHT;
use gonia_protocol::message::{Identity, ResetReason};
use gonia_sim::arm::SimulatedArm;
use panic_persist as _;
use static_cell::StaticCell;

use crate::arm::EmulatedArm;

/// The tasks run in an interrupt, so that the processor sleeps by `wfi`. A thread's executor sleeps by
/// `wfe`, which the emulator takes for an invitation to spin; it then holds its lock so often that
/// the bytes of the wire wait for seconds.
static TASKS: InterruptExecutor = InterruptExecutor::new();
/// Of an interrupt that no peripheral of this program uses (TIMER1).
const TASKS_IRQ: u16 = 9;
/// Below that of the peripherals, which keep the highest.
const TASKS_PRIORITY: u8 = 0x80;

#[entry]
fn main() -> ! {
    static LOG_PORT: StaticCell<uart::LogPort> = StaticCell::new();
    time::start();
    uart::start();
    steps::start();
    defmt_serial::defmt_serial(LOG_PORT.init(uart::LogPort));
    if let Some(mut cores) = cortex_m::Peripherals::take() {
        // SAFETY: nothing runs yet that counts on another priority.
        unsafe { cores.NVIC.set_priority(Irq(TASKS_IRQ), TASKS_PRIORITY) };
    }
    let spawner = TASKS.start(Irq(TASKS_IRQ));
    for irq in [time::IRQ, steps::IRQ, uart::RX_IRQ] {
        // SAFETY: the handlers share data with tasks only through critical sections.
        unsafe { NVIC::unmask(Irq(irq)) };
    }
    match run_arm() {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::error!("the arm's task is running already"),
    }
    loop {
        cortex_m::asm::wfi();
    }
}

/// The arm's controller, for ever.
#[embassy_executor::task]
async fn run_arm() {
    static NODE: StaticCell<ControllerNode> = StaticCell::new();
    static BOARD: StaticCell<Emulated> = StaticCell::new();
    let controller = ArmController::new(now_us(), None);
    let node = NODE.init(ControllerNode::new(NODE_LIGHT, who_it_is(), controller));
    let board = BOARD.init(Emulated(EmulatedArm(SimulatedArm::quiet_arm_near_home())));
    defmt::info!("ready");
    board::run(node, board).await
}

/// What the emulator offers to the main loop.
struct Emulated(EmulatedArm);

impl Board for Emulated {
    type Pins = EmulatedArm;

    fn now_us(&self) -> u64 {
        now_us()
    }

    fn pins(&mut self, now_us: u64) -> &mut EmulatedArm {
        self.0.set_now(now_us);
        &mut self.0
    }

    async fn send(&mut self, packet: &[u8]) {
        uart::WIRE.send(packet);
    }

    async fn sleep(&mut self, until_us: u64, bytes: &mut [u8]) -> Wake {
        let time = Timer::at(Instant::from_micros(until_us));
        match select(uart::RECEIVED.read(bytes), time).await {
            Either::First(received) => Wake::Bytes(received),
            Either::Second(()) => Wake::Time,
        }
    }
}

fn who_it_is() -> Identity {
    let last_panic = panic_persist::get_panic_message_utf8();
    let reset = match last_panic {
        Some(_) => ResetReason::Software,
        None => ResetReason::Unknown,
    };
    identity(
        "qemu-mps2",
        board::next_boot_id(),
        reset,
        last_panic.unwrap_or_default(),
    )
}

fn now_us() -> u64 {
    Instant::now().as_micros()
}

#[derive(Clone, Copy)]
struct Irq(u16);

// SAFETY: the numbers used are interrupts of the board.
unsafe impl InterruptNumber for Irq {
    fn number(self) -> u16 {
        self.0
    }
}

/// All interrupts come here: without a device crate the vector table has one handler.
// SAFETY: it touches registers and critical-section data only.
#[exception]
unsafe fn DefaultHandler(irq: i16) {
    match irq as u16 {
        steps::IRQ => steps::on_period(),
        time::IRQ => time::on_alarm(),
        uart::RX_IRQ => uart::on_receive(),
        // SAFETY: this is the interrupt that `main` has started the tasks with.
        TASKS_IRQ => unsafe { TASKS.on_interrupt() },
        _ => {}
    }
}
