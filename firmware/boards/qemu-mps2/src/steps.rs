//! The step timers: the two halves of the CMSDK dual timer. Each has a reload register that counts
//! when it next runs down, as a real board's has.
//!
//! The pulses go nowhere but into a list, with the time at which a timer that keeps time would have
//! given them and a main loop that is never late; that loop moves the simulated motors by it. QEMU's
//! interrupts come late and in bunches and its main loop may wait for a busy machine while the queue
//! runs dry, and a motor would lose steps by either.

use core::cell::RefCell;

use critical_section::Mutex;
use gonia_firmware::profile::TICKS_PER_US;
use gonia_firmware::steps::{End, Period, REST_TICKS, StepChannel, StepProgress, StepTimer};
use gonia_protocol::settings::Axis;
use heapless::Deque;

use crate::now_us;
use crate::register::Register;

/// IRQ of both timers.
pub const IRQ: u16 = 10;

const BASE: [usize; 2] = [0x4000_2000, 0x4000_2020];
/// Enabled, periodic, with interrupt, 32 bits.
const RUN: u32 = 0b1110_0010;
/// 25 MHz.
const CLOCKS: u64 = 25;
/// A run that begins so soon after the last one may be the rest of it, 1/256 µs: 1 s.
const LATE_TICKS: u64 = 1_000_000 * TICKS_PER_US;

type Channel = Mutex<RefCell<StepChannel<HalfTimer>>>;

/// θ and φ.
static CHANNELS: [Channel; 2] = [
    Mutex::new(RefCell::new(StepChannel::new(HalfTimer::new(0)))),
    Mutex::new(RefCell::new(StepChannel::new(HalfTimer::new(1)))),
];

/// A step of a simulated motor.
pub struct Given {
    /// Of this axis.
    pub axis: Axis,
    /// Which way.
    pub up: bool,
    /// When it was due, µs.
    pub at_us: u64,
}

/// Steps that the simulated motors have not seen yet.
static GIVEN: Mutex<RefCell<Deque<Given, 512>>> = Mutex::new(RefCell::new(Deque::new()));

/// One half of the dual timer.
pub struct HalfTimer {
    base: usize,
    running_ticks: u32,
    next_ticks: u32,
    /// The time that a timer would have which keeps time, 1/256 µs.
    ideal_ticks: u64,
    /// When the last period with a step or a turn has ended, 1/256 µs.
    ended_ticks: u64,
    up: bool,
}

/// Starts both timers, at rest.
pub fn start() {
    for channel in &CHANNELS {
        critical_section::with(|cs| channel.borrow_ref_mut(cs).timer().restart(REST_TICKS));
    }
}

/// The main loop has a period for an axis.
pub fn queue(axis: Axis, period: Period) {
    critical_section::with(|cs| {
        let mut channel = CHANNELS[axis.index()].borrow_ref_mut(cs);
        if !channel.progress().is_playing {
            let now_ticks = now_us() * TICKS_PER_US;
            let timer = channel.timer();
            if now_ticks.saturating_sub(timer.ended_ticks) > LATE_TICKS {
                timer.ideal_ticks = now_ticks;
            }
        }
        // The firmware queues only where there is room.
        let _ = channel.push(period);
    });
}

/// How far an axis is.
pub fn progress(axis: Axis) -> StepProgress {
    critical_section::with(|cs| CHANNELS[axis.index()].borrow_ref(cs).progress())
}

/// No step of an axis after this.
pub fn halt(axis: Axis) {
    critical_section::with(|cs| CHANNELS[axis.index()].borrow_ref_mut(cs).halt());
}

/// The next step that a simulated motor has not seen.
pub fn take_given() -> Option<Given> {
    critical_section::with(|cs| GIVEN.borrow_ref_mut(cs).pop_front())
}

/// A timer has run down, or both.
pub fn on_period() {
    for axis in Axis::BOTH {
        critical_section::with(|cs| {
            on_period_of(axis, &mut CHANNELS[axis.index()].borrow_ref_mut(cs))
        });
    }
}

fn on_period_of(axis: Axis, channel: &mut StepChannel<HalfTimer>) {
    if !channel.timer().take_interrupt() {
        return;
    }
    let timer = channel.timer();
    let ended_ticks = timer.ideal_ticks + u64::from(timer.running_ticks);
    timer.running_ticks = timer.next_ticks;
    let end = channel.period_ended();
    if end == End::Rest {
        return;
    }
    channel.timer().ideal_ticks = ended_ticks;
    channel.timer().ended_ticks = now_us() * TICKS_PER_US;
    if end == End::Step {
        let up = channel.timer().up;
        let at_us = ended_ticks / TICKS_PER_US;
        // The main loop takes them out more often than there is room for.
        let _ = critical_section::with(|cs| {
            GIVEN
                .borrow_ref_mut(cs)
                .push_back(Given { axis, up, at_us })
        });
    }
}

impl HalfTimer {
    const fn new(half: usize) -> Self {
        Self {
            base: BASE[half],
            running_ticks: REST_TICKS,
            next_ticks: REST_TICKS,
            ideal_ticks: 0,
            ended_ticks: 0,
            up: true,
        }
    }

    fn register(&self, offset: usize) -> Register {
        Register(self.base + offset)
    }

    /// Whether it has run down since the last call.
    fn take_interrupt(&self) -> bool {
        let ended = self.register(0x14).read() & 1 != 0;
        if ended {
            self.register(0x0C).write(1);
        }
        ended
    }
}

fn clocks(ticks: u32) -> u32 {
    (u64::from(ticks) * CLOCKS / TICKS_PER_US).max(1) as u32
}

impl StepTimer for HalfTimer {
    // The pulse goes into the list when the period has ended.
    fn end_with_pulse(&mut self, _: bool) {}

    fn reload(&mut self, ticks: u32) {
        self.next_ticks = ticks;
        self.register(0x18).write(clocks(ticks));
    }

    fn restart(&mut self, ticks: u32) {
        (self.running_ticks, self.next_ticks) = (ticks, ticks);
        self.register(0x08).write(0);
        self.register(0x0C).write(1);
        self.register(0x00).write(clocks(ticks));
        self.register(0x18).write(clocks(ticks));
        self.register(0x08).write(RUN);
    }

    fn set_direction(&mut self, up: bool) {
        self.up = up;
    }
}
