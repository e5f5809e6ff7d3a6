//! embassy's clock: the FPGAIO counter at 1 MHz, and CMSDK TIMER0 as the alarm.

use core::cell::RefCell;
use core::task::Waker;

use critical_section::Mutex;
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;
use gonia_firmware::clock::{WideCounter, next_alarm};

use crate::register::Register;

const COUNTER: Register = Register(0x4002_8018);
const PRESCALE: Register = Register(0x4002_801C);
const TIMER_CTRL: Register = Register(0x4000_0000);
const TIMER_VALUE: Register = Register(0x4000_0004);
const TIMER_RELOAD: Register = Register(0x4000_0008);
const TIMER_INTCLEAR: Register = Register(0x4000_000C);
/// IRQ of TIMER0.
pub const IRQ: u16 = 8;

const CLOCK_MHZ: u64 = 25;
/// The 32-bit counter turns over every 71 minutes; the alarm rings often enough to notice.
const LONGEST_US: u64 = 60_000_000;

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
        self.counter.now(COUNTER.read())
    }

    /// Sets the alarm to the next expiry.
    fn set_alarm(&mut self) {
        let (now, next) = next_alarm(
            || self.counter.now(COUNTER.read()),
            |by| self.queue.next_expiration(by),
        );
        let wait = (next - now).min(LONGEST_US) * CLOCK_MHZ;
        TIMER_CTRL.write(0);
        TIMER_INTCLEAR.write(1);
        TIMER_RELOAD.write(wait as u32);
        TIMER_VALUE.write(wait as u32);
        TIMER_CTRL.write(0b1001);
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

/// Starts the counter and the alarm.
pub fn start() {
    PRESCALE.write(CLOCK_MHZ as u32 - 1);
    COUNTER.write(0);
    on_alarm();
}

/// TIMER0 has run down.
pub fn on_alarm() {
    critical_section::with(|cs| CLOCK.state.borrow_ref_mut(cs).set_alarm());
}
