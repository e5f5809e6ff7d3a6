//! The board's clock: TIM3 counts microseconds, and TIM4 how often TIM3 has turned over. Together they are 32
//! bits of hardware, so that no stall of the processor, such as an erase of flash, loses time.
//!
//! TIM3 is also what trigger pulses are timed with (`pulses`), so that a pulse and its time stamp are from
//! one clock.

use core::cell::RefCell;
use core::task::Waker;

use critical_section::Mutex;
use embassy_stm32::pac::timer::vals::{Mms, Sms, Ts, Urs};
use embassy_stm32::pac::{TIM3, TIM4};
use embassy_stm32::{peripherals, rcc};
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;
use gonia_firmware::clock::{WideCounter, next_alarm};

/// 84 MHz to 1 MHz.
const PRESCALER: u16 = 84;
/// The alarm's channel of TIM3.
const ALARM: usize = 0;
/// The alarm rings at least this often, µs: before TIM3 has turned over.
const LONGEST_US: u64 = 50_000;
/// Nearer than this, µs, the counter may be there first.
const NEAREST_US: u64 = 3;

struct State {
    counter: WideCounter,
    queue: Queue,
}

struct BoardClock {
    state: Mutex<RefCell<State>>,
}

embassy_time_driver::time_driver_impl!(static CLOCK: BoardClock = BoardClock {
    state: Mutex::new(RefCell::new(State { counter: WideCounter::new(), queue: Queue::new() })),
});

impl State {
    fn now(&mut self) -> u64 {
        self.counter.now(counted())
    }

    /// Rings every 50 ms at least, where the counter would allow 71 minutes.
    fn set_alarm(&mut self) {
        let (now, next) = next_alarm(
            || self.counter.now(counted()),
            |by| self.queue.next_expiration(by),
        );
        let wait = (next - now).clamp(NEAREST_US, LONGEST_US);
        TIM3.ccr(ALARM).write(|w| w.set_ccr((now + wait) as u16));
    }
}

/// Both counters, as one number.
fn counted() -> u32 {
    loop {
        let (high, low, again) = (
            TIM4.cnt().read().cnt(),
            TIM3.cnt().read().cnt(),
            TIM4.cnt().read().cnt(),
        );
        // In the microsecond in which TIM3 turns over, TIM4 may be a clock or two behind.
        if high == again && low != 0 {
            return u32::from(high) << 16 | u32::from(low);
        }
    }
}

impl Driver for BoardClock {
    fn now(&self) -> u64 {
        critical_section::with(|cs| self.state.borrow_ref_mut(cs).now())
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            let mut state = self.state.borrow_ref_mut(cs);
            if state.queue.schedule_wake(at, waker) {
                state.set_alarm();
            }
        });
    }
}

/// Starts both counters and the alarm. TIM4 is clocked by TIM3's turning over: its internal trigger 2.
pub fn start() {
    rcc::enable_and_reset::<peripherals::TIM3>();
    rcc::enable_and_reset::<peripherals::TIM4>();
    TIM4.smcr().write(|w| {
        w.set_ts(Ts::ITR2);
        w.set_sms(Sms::EXT_CLOCK_MODE);
    });
    TIM4.cr1().write(|w| w.set_cen(true));
    TIM3.psc().write_value(PRESCALER - 1);
    TIM3.cr1().write(|w| w.set_urs(Urs::COUNTER_ONLY));
    TIM3.egr().write(|w| w.set_ug(true));
    TIM3.cr2().write(|w| w.set_mms(Mms::UPDATE));
    TIM3.dier().modify(|w| w.set_ccie(ALARM, true));
    TIM3.cr1().modify(|w| w.set_cen(true));
    on_alarm();
}

/// The alarm rings, or may have rung.
pub fn on_alarm() {
    critical_section::with(|cs| CLOCK.state.borrow_ref_mut(cs).set_alarm());
}
