//! The trigger wire: pulses out by one of TIM3's channels, and the edges of the other arm's captured by another,
//! both in the microseconds that the board's clock counts.
//!
//! The timer raises and lowers the output; the interrupt only sets the count at which. A pulse longer than TIM3
//! counts is timed in parts.

use core::cell::RefCell;
use core::sync::atomic::{AtomicUsize, Ordering};

use critical_section::Mutex;
use embassy_stm32::gpio::{AfType, Pull};
use embassy_stm32::interrupt::typelevel::{Interrupt, TIM3 as IRQ};
use embassy_stm32::interrupt::{self, Priority};
use embassy_stm32::pac::TIM3;
use embassy_stm32::pac::timer::regs::SrGp16;
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, FilterValue, Ocm};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use gonia_pins::signals::Signal;
use gonia_pins::{Board, CLOCK_TIMER};
use gonia_protocol::message::MAX_PULSES;

use crate::gpio::{DRIVEN, give};
use crate::{now_us, time};

/// The channels that give pulses and capture edges, counted from 0.
static OUT: AtomicUsize = AtomicUsize::new(1);
static IN: AtomicUsize = AtomicUsize::new(2);

fn out_channel() -> usize {
    OUT.load(Ordering::Relaxed)
}

/// A pulse begins so long after its request, µs: the registers are written by then.
const LEAD_US: u64 = 8;
/// The rest of a pulse is timed in one part up to this, µs; a longer one in parts of the second constant.
const LONGEST_US: u64 = 60_000;
const PART_US: u64 = 30_000;

/// Edges of the other arm's trigger, µs since the start.
pub static EDGES: Channel<CriticalSectionRawMutex, u64, MAX_PULSES> = Channel::new();

/// The pulse under way.
#[derive(Clone, Copy)]
enum Pulse {
    None,
    /// The output rises at the next match.
    Rising {
        ends_us: u64,
    },
    /// It is high, and ends beyond what the timer counts.
    High {
        ends_us: u64,
    },
    /// It falls at the next match.
    Falling,
}

static PULSE: Mutex<RefCell<Pulse>> = Mutex::new(RefCell::new(Pulse::None));

/// Gives TIM3's channels their pins and their work.
pub fn start(of: &Board) {
    let (out, into) = (of.trigger_out, of.trigger_in);
    let (out_channel, in_channel) = (usize::from(out.channel) - 1, usize::from(into.channel) - 1);
    OUT.store(out_channel, Ordering::Relaxed);
    IN.store(in_channel, Ordering::Relaxed);
    set_mode(Ocm::FORCE_INACTIVE);
    give(out.wire, Signal::Timer(CLOCK_TIMER, out.channel), DRIVEN);
    let pulled_down = AfType::input(Pull::Down);
    give(
        into.wire,
        Signal::Timer(CLOCK_TIMER, into.channel),
        pulled_down,
    );
    TIM3.ccmr_input(in_channel / 2).modify(|w| {
        w.set_ccs(in_channel % 2, CcmrInputCcs::TI4);
        // 8 equal samples at 84 MHz: a spike of 90 ns is none.
        w.set_icf(in_channel % 2, FilterValue::FCK_INT_N8);
    });
    TIM3.ccer().modify(|w| {
        w.set_cce(out_channel, true);
        w.set_cce(in_channel, true);
    });
    TIM3.dier().modify(|w| w.set_ccie(in_channel, true));
    IRQ::set_priority(Priority::P1);
    // SAFETY: the handler shares data with the main loop through critical sections only.
    unsafe { IRQ::enable() };
}

/// Begins a pulse, and returns when it rises.
pub fn begin(length_us: u32) -> u64 {
    critical_section::with(|cs| {
        let begins_us = now_us() + LEAD_US;
        let ends_us = begins_us + u64::from(length_us);
        TIM3.ccr(out_channel())
            .write(|w| w.set_ccr(begins_us as u16));
        set_mode(Ocm::ACTIVE_ON_MATCH);
        clear(out_channel());
        TIM3.dier().modify(|w| w.set_ccie(out_channel(), true));
        PULSE.replace(cs, Pulse::Rising { ends_us });
        begins_us
    })
}

/// The output is low from here on.
pub fn end() {
    critical_section::with(|cs| {
        off();
        PULSE.replace(cs, Pulse::None);
    });
}

/// The output is low, whatever state the rest is in.
pub fn off() {
    set_mode(Ocm::FORCE_INACTIVE);
    TIM3.dier().modify(|w| w.set_ccie(out_channel(), false));
}

fn set_mode(mode: Ocm) {
    TIM3.ccmr_output(out_channel() / 2)
        .modify(|w| w.set_ocm(out_channel() % 2, mode));
}

/// Flags are cleared by writing 0; 1 leaves the others alone.
fn clear(channel: usize) {
    TIM3.sr().write_value(SrGp16(!(2 << channel)));
}

/// A match on the output's channel.
fn on_match() {
    critical_section::with(|cs| {
        let mut pulse = PULSE.borrow_ref_mut(cs);
        *pulse = match *pulse {
            Pulse::Rising { ends_us } | Pulse::High { ends_us } => go_on(ends_us),
            Pulse::Falling | Pulse::None => {
                TIM3.dier().modify(|w| w.set_ccie(out_channel(), false));
                Pulse::None
            }
        };
    });
}

/// The output is high: sets the count at which it falls, or at which its next part begins.
fn go_on(ends_us: u64) -> Pulse {
    let left_us = ends_us.saturating_sub(now_us());
    if left_us > LONGEST_US {
        set_mode(Ocm::FORCE_ACTIVE);
        let next_us = ends_us - left_us + PART_US;
        TIM3.ccr(out_channel()).write(|w| w.set_ccr(next_us as u16));
        return Pulse::High { ends_us };
    }
    TIM3.ccr(out_channel()).write(|w| w.set_ccr(ends_us as u16));
    set_mode(Ocm::INACTIVE_ON_MATCH);
    if now_us() >= ends_us && !TIM3.sr().read().ccif(out_channel()) {
        // Shorter than this interrupt took.
        off();
        return Pulse::None;
    }
    Pulse::Falling
}

#[embassy_stm32::interrupt]
fn TIM3() {
    let flags = TIM3.sr().read();
    if flags.ccif(out_channel()) {
        clear(out_channel());
        on_match();
    }
    if flags.ccif(IN.load(Ordering::Relaxed)) {
        // Reading it clears its flag.
        let captured = TIM3.ccr(IN.load(Ordering::Relaxed)).read().ccr();
        let now = now_us();
        let since = (now as u16).wrapping_sub(captured);
        // Nobody waits for more edges than a train has.
        let _ = EDGES.try_send(now - u64::from(since));
    }
    if flags.ccif(0) {
        clear(0);
        time::on_alarm();
    }
}
