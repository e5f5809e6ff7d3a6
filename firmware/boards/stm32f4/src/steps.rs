//! The step timers: TIM5 gives θ's pulses, TIM2 φ's, both of 32 bits at 84 MHz.
//!
//! PWM mode 1: a period begins with a pulse of fixed width, or with none where the compare value is 0.
//! Reload and compare values are preloaded, so that edges come at their time as long as the interrupt
//! of a period runs before the period is over. Both count only while TIM8 runs (`alive`): a timer whose
//! interrupt no longer comes would repeat its last period for ever.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::gpio::Output;
use embassy_stm32::interrupt::typelevel::{Interrupt, TIM2, TIM5};
use embassy_stm32::interrupt::{self, Priority};
use embassy_stm32::pac;
use embassy_stm32::pac::timer::vals::{Ocm, Sms, Ts, Urs};
use embassy_stm32::peripherals;
use embassy_stm32::rcc;
use gonia_firmware::steps::{Period, REST_TICKS, StepChannel, StepProgress, StepTimer};
use gonia_protocol::settings::Axis;

/// What optocoupled drivers need between edges: 2.5 µs.
const PULSE_CLOCKS: u32 = 210;
/// No period is shorter: a pulse, and as long again without. 200,000 steps/s.
const SHORTEST_CLOCKS: u32 = 2 * PULSE_CLOCKS;

type Channel = Mutex<RefCell<Option<StepChannel<PulseTimer>>>>;

/// θ and φ.
static CHANNELS: [Channel; 2] = [const { Mutex::new(RefCell::new(None)) }; 2];

/// A timer, which of its internal triggers TIM8 is, its compare channel, and the direction pin of the driver.
pub struct PulseTimer {
    registers: pac::timer::TimGp32,
    gate: Ts,
    compare: usize,
    direction: Output<'static>,
}

/// Starts both timers, at rest. Their step pins are given to them already.
pub fn start(directions: [Output<'static>; 2]) {
    rcc::enable_and_reset::<peripherals::TIM5>();
    rcc::enable_and_reset::<peripherals::TIM2>();
    let timers = [(pac::TIM5, Ts::ITR3, 0), (pac::TIM2, Ts::ITR1, 2)];
    for ((channel, (registers, gate, compare)), direction) in
        CHANNELS.iter().zip(timers).zip(directions)
    {
        let mut timer = PulseTimer {
            registers,
            gate,
            compare,
            direction,
        };
        timer.start();
        critical_section::with(|cs| channel.replace(cs, Some(StepChannel::new(timer))));
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
        if channel.timer().take_update() {
            channel.period_ended();
        }
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
    with_channel(axis, |channel| {
        if channel.timer().take_update() {
            channel.period_ended();
        }
    });
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
        let (registers, compare) = (self.registers, self.compare);
        registers.cr1().write(|w| {
            w.set_arpe(true);
            w.set_urs(Urs::COUNTER_ONLY);
        });
        registers.smcr().write(|w| {
            w.set_ts(self.gate);
            w.set_sms(Sms::GATED_MODE);
        });
        registers.ccmr_output(compare / 2).modify(|w| {
            w.set_ocm(compare % 2, Ocm::PWM_MODE1);
            w.set_ocpe(compare % 2, true);
        });
        registers.ccer().modify(|w| w.set_cce(compare, true));
        self.restart(REST_TICKS);
        registers.dier().write(|w| w.set_uie(true));
        registers.cr1().modify(|w| w.set_cen(true));
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
        let width = if pulse { PULSE_CLOCKS } else { 0 };
        self.registers.ccr(self.compare).write_value(width);
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
        self.direction.set_level(up.into());
    }
}
