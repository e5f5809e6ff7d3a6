//! Steps ahead of time: the main loop queues periods, a timer's interrupt plays them.
//!
//! A period is an interval and what happens at its end: a step, a new direction, or nothing. The
//! timer makes the edge of a step itself, so that it comes at its time whatever the processor does;
//! the interrupt at the end of each period only sets what is to happen at the end of the next one.
//! For that the timer's reload and pulse registers are *preloaded*: what is written to them counts
//! when the running period ends. An axis at rest plays short periods that end with nothing.
//!
//! ```text
//! period          |--- n-1 ---|----- n -----|--- n+1 ---|
//! at its end                  step          step
//! the interrupt               |             |
//!   sets for the running one: pulse at end of n
//!   sets for the next one:    length of n+1
//! ```

use heapless::spsc;

/// Periods that can wait; at 6000 steps/s they last 21 ms.
pub const DEPTH: usize = 127;
/// The period of an axis at rest, 1/256 µs: a run begins so much later at most.
pub const REST_TICKS: u32 = 500 * 256;
/// Longest period, 1/256 µs: 4.19 s.
pub const LONGEST_TICKS: u32 = (1 << 30) - 1;

/// What happens at the end of a period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Nothing.
    Rest,
    /// A step in the direction that was last set.
    Step,
    /// The direction of the steps to come is set: up for `true`. No step is given, so that the driver
    /// sees the direction a whole period after the last step and before the next.
    Turn(bool),
}

/// A period in a word: two bits for its end, thirty for its length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Period(u32);

impl Period {
    /// `ticks` in 1/256 µs, cut to 1 ..= [`LONGEST_TICKS`].
    pub fn new(ticks: u32, end: End) -> Self {
        let code = match end {
            End::Rest => 0,
            End::Step => 1,
            End::Turn(false) => 2,
            End::Turn(true) => 3,
        };
        Self(ticks.clamp(1, LONGEST_TICKS) << 2 | code)
    }

    /// Its length, 1/256 µs.
    pub fn ticks(self) -> u32 {
        self.0 >> 2
    }

    /// What happens at its end.
    pub fn end(self) -> End {
        match self.0 & 3 {
            0 => End::Rest,
            1 => End::Step,
            2 => End::Turn(false),
            _ => End::Turn(true),
        }
    }
}

/// The timer of an axis, and the pin that tells its driver which way.
pub trait StepTimer {
    /// The running period will end with a step, or without. Counts when it ends.
    fn end_with_pulse(&mut self, pulse: bool);
    /// How long the period after the running one is, 1/256 µs. Counts when the running one ends.
    fn reload(&mut self, ticks: u32);
    /// Cuts the running period short: one without a step begins now, and so does one after it, each so
    /// many 1/256 µs long.
    fn restart(&mut self, ticks: u32);
    /// Tells the driver which way, at once.
    fn set_direction(&mut self, up: bool);
}

/// How far the steps of an axis are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepProgress {
    /// Steps given so far, up minus down; it wraps.
    pub given: i32,
    /// Periods that wait.
    pub waiting: usize,
    /// Whether a step or a turn is still to come.
    pub is_playing: bool,
}

/// The steps of one axis, from the main loop to the timer. Both get at it one at a time: on a board
/// behind a critical section.
#[derive(Debug)]
pub struct StepChannel<T> {
    timer: T,
    waiting: spsc::Queue<Period, { DEPTH + 1 }>,
    /// What the running period ends with.
    running: End,
    /// What the one after it ends with.
    next: End,
    up: bool,
    given: i32,
}

impl<T: StepTimer> StepChannel<T> {
    /// At rest, on a timer that runs with periods of [`REST_TICKS`].
    pub const fn new(timer: T) -> Self {
        Self {
            timer,
            waiting: spsc::Queue::new(),
            running: End::Rest,
            next: End::Rest,
            up: true,
            given: 0,
        }
    }

    /// The main loop has one more. Returns it when there is no room.
    pub fn push(&mut self, period: Period) -> Result<(), Period> {
        self.waiting.enqueue(period)
    }

    /// How far it is.
    pub fn progress(&self) -> StepProgress {
        let waiting = self.waiting.len();
        let is_at_rest = waiting == 0 && self.running == End::Rest && self.next == End::Rest;
        StepProgress {
            given: self.given,
            waiting,
            is_playing: !is_at_rest,
        }
    }

    /// No step after this; whatever waits is dropped.
    pub fn halt(&mut self) {
        while self.waiting.dequeue().is_some() {}
        self.running = End::Rest;
        self.next = End::Rest;
        self.timer.restart(REST_TICKS);
    }

    /// The interrupt: a period has ended, and with it came what is returned; the next one runs.
    #[inline]
    pub fn period_ended(&mut self) -> End {
        let ended = self.running;
        match ended {
            End::Rest => {}
            End::Step => self.given = self.given.wrapping_add(if self.up { 1 } else { -1 }),
            End::Turn(up) => {
                self.up = up;
                self.timer.set_direction(up);
            }
        }
        self.running = self.next;
        self.timer.end_with_pulse(self.running == End::Step);
        match self.waiting.dequeue() {
            Some(period) => {
                self.next = period.end();
                self.timer.reload(period.ticks());
            }
            None => {
                self.next = End::Rest;
                self.timer.reload(REST_TICKS);
            }
        }
        ended
    }

    /// The timer.
    pub fn timer(&mut self) -> &mut T {
        &mut self.timer
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    /// A timer with preloaded registers, and what a driver would see of it.
    #[derive(Default)]
    struct Registers {
        pulse: bool,
        reload: u32,
        left: u32,
        up: bool,
        now: u64,
        edges: Vec<(u64, bool)>,
    }

    impl StepTimer for Registers {
        fn end_with_pulse(&mut self, pulse: bool) {
            self.pulse = pulse;
        }
        fn reload(&mut self, ticks: u32) {
            self.reload = ticks;
        }
        fn restart(&mut self, ticks: u32) {
            (self.pulse, self.reload, self.left) = (false, ticks, ticks);
        }
        fn set_direction(&mut self, up: bool) {
            self.up = up;
        }
    }

    fn channel() -> StepChannel<Registers> {
        let mut timer = Registers::default();
        timer.restart(REST_TICKS);
        StepChannel::new(timer)
    }

    /// As the hardware does it: the edge first, from what was preloaded; then the interrupt.
    fn play(channel: &mut StepChannel<Registers>, periods: usize) {
        for _ in 0..periods {
            let timer = channel.timer();
            timer.now += u64::from(timer.left);
            timer.left = timer.reload;
            if timer.pulse {
                timer.edges.push((timer.now, timer.up));
            }
            channel.period_ended();
        }
    }

    #[test]
    fn steps_come_at_their_intervals_with_the_direction_set_before() {
        let mut channel = channel();
        let periods = [
            (1000, End::Turn(true)),
            (1000, End::Step),
            (700, End::Step),
            (900, End::Turn(false)),
            (800, End::Step),
        ];
        for (ticks, end) in periods {
            channel.push(Period::new(ticks, end)).unwrap();
        }
        assert!(channel.progress().is_playing);
        play(&mut channel, 8);
        // Two rests were under way when the first came.
        let began = 2 * u64::from(REST_TICKS);
        let edges = [(2000, true), (2700, true), (4400, false)];
        assert_eq!(
            channel.timer().edges,
            edges.map(|(at, up)| (began + at, up))
        );
        let at_rest = StepProgress {
            given: 1,
            waiting: 0,
            is_playing: false,
        };
        assert_eq!(channel.progress(), at_rest);
    }

    #[test]
    fn a_halt_drops_what_waits_and_what_is_under_way_and_counts_only_what_was_given() {
        for after in 0..20 {
            let mut channel = channel();
            for _ in 0..10 {
                channel.push(Period::new(5000, End::Step)).unwrap();
            }
            play(&mut channel, after);
            channel.halt();
            let given = channel.progress().given;
            assert_eq!(channel.timer().edges.len(), given as usize);
            play(&mut channel, 5);
            assert_eq!(
                channel.progress(),
                StepProgress {
                    given,
                    ..StepProgress::default()
                }
            );
            assert_eq!(channel.timer().edges.len(), given as usize);
        }
    }

    #[test]
    fn a_main_loop_that_is_late_makes_a_pause_and_loses_no_step() {
        let mut channel = channel();
        channel.push(Period::new(5000, End::Step)).unwrap();
        play(&mut channel, 30);
        channel.push(Period::new(5000, End::Step)).unwrap();
        play(&mut channel, 3);
        assert_eq!(channel.timer().edges.len(), 2);
        assert_eq!(channel.progress().given, 2);
    }

    #[test]
    fn a_full_queue_gives_the_period_back() {
        let mut channel = channel();
        let period = Period::new(7, End::Step);
        for _ in 0..DEPTH {
            channel.push(period).unwrap();
        }
        assert_eq!(channel.push(period), Err(period));
    }

    #[test]
    fn a_period_is_what_it_was_made_of() {
        for end in [End::Rest, End::Step, End::Turn(true), End::Turn(false)] {
            for (ticks, kept) in [
                (0, 1),
                (1, 1),
                (LONGEST_TICKS, LONGEST_TICKS),
                (u32::MAX, LONGEST_TICKS),
            ] {
                let period = Period::new(ticks, end);
                assert_eq!((period.ticks(), period.end()), (kept, end));
            }
        }
    }
}
