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
use gonia_firmware::controller::Controller;
use gonia_firmware::node::{Node, identity};
use gonia_protocol::NODE_LIGHT;
use gonia_protocol::message::{Identity, ResetReason};
use gonia_sim::bench::Bench;
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

/// The arm: bytes in, steps and bytes out, and sleep until the next of either.
#[embassy_executor::task]
async fn run_arm() {
    static NODE: StaticCell<Node> = StaticCell::new();
    static ARM: StaticCell<EmulatedArm> = StaticCell::new();
    let controller = Controller::new(now_us(), None);
    let node = NODE.init(Node::new(NODE_LIGHT, who_it_is(), controller));
    let arm = ARM.init(EmulatedArm(Bench::quiet_arm_near_home()));
    defmt::info!("ready");
    let mut bytes = [0; 64];
    loop {
        arm.set_now(now_us());
        node.poll(now_us(), arm);
        while let Some(frame) = node.take_frame() {
            uart::WIRE.send(&frame);
        }
        let wake = Timer::at(Instant::from_micros(node.wake_us()));
        if let Either::First(received) = select(uart::RECEIVED.read(&mut bytes), wake).await {
            arm.set_now(now_us());
            for &byte in &bytes[..received] {
                node.receive(byte, now_us(), arm);
            }
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
        next_boot_id(),
        reset,
        last_panic.unwrap_or_default(),
    )
}

/// Counts starts since power came on, in memory that a reset leaves alone.
fn next_boot_id() -> u32 {
    #[unsafe(link_section = ".uninit.boots")]
    static mut BOOTS: core::mem::MaybeUninit<u32> = core::mem::MaybeUninit::uninit();
    // SAFETY: called once, before anybody else could; any bit pattern is a number.
    unsafe {
        let boots = (&raw mut BOOTS).cast::<u32>();
        boots.write_volatile(boots.read_volatile().wrapping_add(1));
        boots.read_volatile()
    }
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
