//! The step timers: TIM5 times θ's steps, TIM2 φ's, both of 32 bits at 84 MHz.
//!
//! Where the step pin is a channel of its timer: PWM mode 1, a period begins with a pulse of fixed width, or with
//! none where the compare value is 0. Reload and compare values are preloaded, so that edges come at their time as
//! long as the interrupt of a period runs before the period is over.
//!
//! Where no timer reaches the pin, the interrupt at the period's end raises it first of all, and lowers it last:
//! an edge is late by what other interrupts and critical sections take, microseconds, and there is none without
//! the processor.
//! Both timers count only while TIM8 runs (`alive`): a timer whose
//! interrupt no longer comes would repeat its last period for ever.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::interrupt::typelevel::{Interrupt, TIM2, TIM5};
use embassy_stm32::interrupt::{self, Priority};
use embassy_stm32::pac;
use embassy_stm32::pac::timer::vals::{Ocm, Sms, Ts, Urs};
use embassy_stm32::peripherals;
use embassy_stm32::rcc;
use gonia_firmware::steps::{Period, REST_TICKS, StepChannel, StepProgress, StepTimer};
use gonia_pins::signals::Signal;
use gonia_pins::{Axis as AxisPins, Level, STEP_TIMERS, StepEdge};
use gonia_protocol::settings::Axis;

use crate::gpio::{DRIVEN, Line, give, output};

/// What optocoupled drivers need between edges: 2.5 µs.
const PULSE_CLOCKS: u32 = 210;
/// No period is shorter: a pulse, and as long again without. 200,000 steps/s.
const SHORTEST_CLOCKS: u32 = 2 * PULSE_CLOCKS;
/// Cycles of the processor that a pulse of an interrupt lasts at least: 0.5 µs, where drivers in sockets ask for
/// 0.1 µs.
const RAISED_CYCLES: u32 = 84;

type Channel = Mutex<RefCell<Option<StepChannel<PulseTimer>>>>;

/// θ and φ.
static CHANNELS: [Channel; 2] = [const { Mutex::new(RefCell::new(None)) }; 2];

/// What makes the edges.
enum Edge {
    /// This compare channel, counted from 0.
    Compare(usize),
    /// The interrupt, where the period that has ended is to end with one.
    Raised { line: Line, is_due: bool },
}

/// A timer, which of its internal triggers TIM8 is, what makes its edges, and the direction pin of the driver.
pub struct PulseTimer {
    registers: pac::timer::TimGp32,
    gate: Ts,
    edge: Edge,
    direction: Line,
}

/// Starts both timers, at rest.
pub fn start(axes: &[AxisPins; 2]) {
    rcc::enable_and_reset::<peripherals::TIM5>();
    rcc::enable_and_reset::<peripherals::TIM2>();
    let timers = [(pac::TIM5, Ts::ITR3), (pac::TIM2, Ts::ITR1)];
    for (i, (pins, (registers, gate))) in axes.iter().zip(timers).enumerate() {
        let edge = match pins.edge {
            StepEdge::Timer(channel) => {
                let signal = Signal::Timer(STEP_TIMERS[i], channel);
                give(pins.step, signal, DRIVEN);
                Edge::Compare(usize::from(channel) - 1)
            }
            StepEdge::Interrupt => Edge::Raised {
                line: output(pins.step, Level::Low),
                is_due: false,
            },
        };
        let mut timer = PulseTimer {
            registers,
            gate,
            edge,
            direction: output(pins.direction, Level::Low),
        };
        timer.start();
        critical_section::with(|cs| CHANNELS[i].replace(cs, Some(StepChannel::new(timer))));
    }
    TIM5::set_priority(Priority::P0);
    TIM2::set_priority(Priority::P0);
    // SAFETY: the handlers share data with the main loop through critical sections only.
    unsafe {
        TIM5::enable();
        TIM2::enable();
    }
}

/// The main loop has a period for an axis.
pub fn queue(axis: Axis, period: Period) {
    with_channel(axis, |channel| {
        // The firmware queues only where there is room.
        let _ = channel.push(period);
    });
}

/// How far an axis is.
pub fn progress(axis: Axis) -> StepProgress {
    with_channel(axis, |channel| channel.progress()).unwrap_or_default()
}

/// No step of an axis after this.
pub fn halt(axis: Axis) {
    with_channel(axis, |channel| {
        // A pulse whose interrupt is still to come counts.
        end_period(channel);
        channel.halt();
    });
}

fn with_channel<R>(axis: Axis, work: impl FnOnce(&mut StepChannel<PulseTimer>) -> R) -> Option<R> {
    critical_section::with(|cs| {
        let mut channel = CHANNELS[axis.index()].borrow_ref_mut(cs);
        channel.as_mut().map(work)
    })
}

fn on_update(axis: Axis) {
    with_channel(axis, end_period);
}

/// If a period has ended: its edge, where the timer does not make it, and what comes next.
#[inline]
fn end_period(channel: &mut StepChannel<PulseTimer>) {
    if !channel.timer().take_update() {
        return;
    }
    let raised = channel.timer().raise();
    channel.period_ended();
    if let Some(line) = raised {
        cortex_m::asm::delay(RAISED_CYCLES);
        line.set(Level::Low);
    }
}

#[embassy_stm32::interrupt]
fn TIM5() {
    on_update(Axis::Theta);
}

#[embassy_stm32::interrupt]
fn TIM2() {
    on_update(Axis::Phi);
}

impl PulseTimer {
    fn start(&mut self) {
        let registers = self.registers;
        registers.cr1().write(|w| {
            w.set_arpe(true);
            w.set_urs(Urs::COUNTER_ONLY);
        });
        registers.smcr().write(|w| {
            w.set_ts(self.gate);
            w.set_sms(Sms::GATED_MODE);
        });
        if let Edge::Compare(compare) = self.edge {
            registers.ccmr_output(compare / 2).modify(|w| {
                w.set_ocm(compare % 2, Ocm::PWM_MODE1);
                w.set_ocpe(compare % 2, true);
            });
            registers.ccer().modify(|w| w.set_cce(compare, true));
        }
        self.restart(REST_TICKS);
        registers.dier().write(|w| w.set_uie(true));
        registers.cr1().modify(|w| w.set_cen(true));
    }

    /// Raises the step pin, if that is due and the timer does not do it.
    #[inline]
    fn raise(&mut self) -> Option<Line> {
        match self.edge {
            Edge::Raised { line, is_due: true } => {
                line.set(Level::High);
                Some(line)
            }
            _ => None,
        }
    }

    /// Whether a period has ended since the last call.
    fn take_update(&mut self) -> bool {
        let ended = self.registers.sr().read().uif();
        // The flags are cleared by writing 0; 1 leaves the others alone.
        self.registers
            .sr()
            .write_value(pac::timer::regs::SrGp16(!1));
        ended
    }
}

impl StepTimer for PulseTimer {
    #[inline]
    fn end_with_pulse(&mut self, pulse: bool) {
        match &mut self.edge {
            Edge::Compare(compare) => {
                let width = if pulse { PULSE_CLOCKS } else { 0 };
                self.registers.ccr(*compare).write_value(width);
            }
            Edge::Raised { is_due, .. } => *is_due = pulse,
        }
    }

    #[inline]
    fn reload(&mut self, ticks: u32) {
        // 84 clocks are 256 ticks; the product fits, as no period is longer than 2³⁰ ticks.
        let clocks = ((u64::from(ticks) * 21) >> 6) as u32;
        let clocks = clocks.max(SHORTEST_CLOCKS);
        self.registers.arr().write_value(clocks - 1);
    }

    fn restart(&mut self, ticks: u32) {
        self.reload(ticks);
        self.end_with_pulse(false);
        self.registers.egr().write(|w| w.set_ug(true));
    }

    #[inline]
    fn set_direction(&mut self, up: bool) {
        self.direction
            .set(if up { Level::High } else { Level::Low });
    }
}
