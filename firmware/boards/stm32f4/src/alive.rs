//! What keeps the arm safe when the processor does not: hardware that stops pulses and opens the chain by
//! itself, and a watchdog.
//!
//! TIM8 runs for 10 ms and stops (one-pulse mode); the main loop sets it back every round. While it runs, its
//! trigger output lets TIM5 and TIM2 count, which give the steps, and its channels hold the interlock's
//! relay and the brakes. So whatever stops the processor (a fault in a fault handler, a loop without end, a
//! debugger) stops the steps within 10 ms, the relay lets go, and the brakes engage while the drivers still hold
//! the arm. The watchdog restarts the chip soon after, and the drivers lose their current.

use core::cell::Cell;

use critical_section::Mutex;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};
use embassy_stm32::pac::timer::vals::{Mms, Ocm, Urs};
use embassy_stm32::pac::{self};
use embassy_stm32::{peripherals, rcc};
use gonia_pins::signals::Signal;
use gonia_pins::{Board, LIFE_TIMER, StepEdge, TimerOutput};

use crate::gpio::{DRIVEN, Line, give, off, output, switch_output};
use crate::pulses;

/// The main loop comes round at least this often, µs.
pub const ROUND_US: u64 = 4_000;
/// TIM8 counts at 10 kHz.
const PRESCALER: u16 = 16_800;
/// 10 ms.
const STEPS_END: u16 = 100;
/// 2.5 s, for an erase, which takes two at most: at rest.
const STRETCHED: u16 = 25_000;
/// Of the watchdog, whose clock is somewhere between 17 and 47 kHz: 100 ms and 3.6 s at 32 kHz, which are 2.4 s at
/// 47 kHz.
const WATCHDOG: u16 = 100;
const WATCHDOG_STRETCHED: u16 = 3_600;
/// The output is high from this count on: as soon as the timer runs.
const ENERGISED: u16 = 1;
/// The count that it never reaches.
const OPEN: u16 = u16::MAX;
/// A brake has engaged after so many parts of so many cycles of the processor, which are 5 ms at least and 10 at
/// most.
const BRAKE_PARTS: u32 = 10;
const PART_CYCLES: u32 = 840_000;

/// What is switched off when the processor cannot go on.
static BOARD: Mutex<Cell<Option<&'static Board>>> = Mutex::new(Cell::new(None));

fn board() -> Option<&'static Board> {
    critical_section::with(|cs| BOARD.borrow(cs).get())
}

/// Starts the timer and the watchdog; the relay closes, and steps can be given.
pub fn start(of: &'static Board) {
    critical_section::with(|cs| BOARD.borrow(cs).set(Some(of)));
    for &enable in of.enables {
        output(enable.wire, off(enable));
    }
    // A debugger that halts the processor halts these too: no step, no relay, no reset meanwhile.
    pac::DBGMCU.apb1fzr().modify(|w| {
        w.set_tim2(true);
        w.set_tim3(true);
        w.set_tim4(true);
        w.set_tim5(true);
        w.set_iwdg(true);
    });
    pac::DBGMCU.apb2fzr().modify(|w| w.set_tim8(true));

    rcc::enable_and_reset::<peripherals::TIM8>();
    let tim = pac::TIM8;
    tim.psc().write_value(PRESCALER - 1);
    tim.arr().write(|w| w.set_arr(STEPS_END));
    tim.cr2().write(|w| w.set_mms(Mms::ENABLE));
    start_output(of.relay, ENERGISED);
    if let Some(brakes) = of.brakes {
        start_output(brakes, OPEN);
    }
    tim.bdtr().write(|w| w.set_moe(true));
    tim.cr1().write(|w| {
        w.set_opm(true);
        w.set_urs(Urs::COUNTER_ONLY);
    });
    tim.egr().write(|w| w.set_ug(true));
    for output in [Some(of.relay), of.brakes].into_iter().flatten() {
        give(output.wire, signal_of(output), DRIVEN);
    }

    pac::IWDG.kr().write(|w| w.set_key(Key::START));
    set_watchdog(WATCHDOG);
    keep();
}

/// Gives a channel of the timer its work: low at rest, and high from this count on.
fn start_output(output: TimerOutput, count: u16) {
    let (tim, channel) = (pac::TIM8, channel_of(output));
    tim.ccmr_output(channel / 2)
        .modify(|w| w.set_ocm(channel % 2, Ocm::PWM_MODE2));
    tim.ccr(channel).write(|w| w.set_ccr(count));
    tim.ccer().modify(|w| match output.is_complementary {
        // Enabled alone, it is not the other's opposite (RM0390, table of OCx and OCxN).
        true => w.set_ccne(channel, true),
        false => w.set_cce(channel, true),
    });
}

/// Counted from 0.
fn channel_of(output: TimerOutput) -> usize {
    usize::from(output.channel) - 1
}

fn signal_of(output: TimerOutput) -> Signal {
    match output.is_complementary {
        true => Signal::TimerComplement(LIFE_TIMER, output.channel),
        false => Signal::Timer(LIFE_TIMER, output.channel),
    }
}

/// The drivers get their current, or lose it.
pub fn switch_drivers(on: bool) {
    for &enable in board().map_or(&[][..], |of| of.enables) {
        switch_output(enable, on);
    }
}

/// The main loop has come round.
pub fn keep() {
    run_on();
    pac::IWDG.kr().write(|w| w.set_key(Key::RESET));
}

/// Sets TIM8 back to its beginning. Not to zero, where the relay's output is low.
fn run_on() {
    pac::TIM8.cnt().write(|w| w.set_cnt(ENERGISED));
    pac::TIM8.cr1().modify(|w| w.set_cen(true));
}

/// Holds this controller's part of the chain open, or closes it.
pub fn hold_open(open: bool) {
    let count = if open { OPEN } else { ENERGISED };
    if let Some(of) = board() {
        let relay = pac::TIM8.ccr(channel_of(of.relay));
        relay.write(|w| w.set_ccr(count));
    }
}

/// Lets the brakes go, or engages them, where the board has an output for them.
pub fn release_brakes(released: bool) {
    let count = if released { ENERGISED } else { OPEN };
    if let Some(brakes) = board().and_then(|of| of.brakes) {
        pac::TIM8
            .ccr(channel_of(brakes))
            .write(|w| w.set_ccr(count));
    }
}

/// Work that takes longer than a round, at rest: nothing moves, so nothing has to be stopped meanwhile.
pub fn stretched<R>(work: impl FnOnce() -> R) -> R {
    pac::TIM8.arr().write(|w| w.set_arr(STRETCHED));
    set_watchdog(WATCHDOG_STRETCHED);
    keep();
    let result = work();
    // The counter is beyond the shorter end by now: first back, then shorter.
    run_on();
    pac::TIM8.arr().write(|w| w.set_arr(STEPS_END));
    set_watchdog(WATCHDOG);
    keep();
    result
}

/// The watchdog's clock takes some of its own cycles to take a new value over.
fn set_watchdog(reload: u16) {
    let iwdg = pac::IWDG;
    iwdg.kr().write(|w| w.set_key(Key::ENABLE));
    iwdg.pr().write(|w| w.set_pr(Pr::DIVIDE_BY32));
    iwdg.rlr().write(|w| w.set_rl(reload));
    while iwdg.sr().read().rvu() || iwdg.sr().read().pvu() {}
    iwdg.kr().write(|w| w.set_key(Key::RESET));
}

/// No step, no trigger, the chain open, brakes engaged, then no current: whatever state the rest is in. Nothing
/// but registers.
pub fn all_off() {
    for tim in [pac::TIM5, pac::TIM2] {
        tim.cr1().write(|_| {});
        tim.ccer().write(|_| {});
    }
    pac::TIM8.bdtr().write(|_| {});
    pac::TIM8.cr1().write(|_| {});
    pulses::off();
    let Some(of) = board() else {
        return;
    };
    for axis in of.axes {
        if axis.edge == StepEdge::Interrupt {
            Line::of(axis.step.pin).set(gonia_pins::Level::Low);
        }
    }
    if of.brakes.is_some() {
        // The drivers hold the arm until the brakes do; the watchdog waits for that.
        for _ in 0..BRAKE_PARTS {
            pac::IWDG.kr().write(|w| w.set_key(Key::RESET));
            cortex_m::asm::delay(PART_CYCLES);
        }
    }
    switch_drivers(false);
}
