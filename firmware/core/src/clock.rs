//! The clock of a board: a counter of 32 bits made one of 64, and when its alarm rings next.

/// A counter of microseconds that turns over, and what it has counted in all.
#[derive(Debug, Default)]
pub struct WideCounter {
    high: u64,
    last: u32,
}

impl WideCounter {
    /// One that begins at 0.
    pub const fn new() -> Self {
        Self { high: 0, last: 0 }
    }

    /// Time since the beginning, µs, where the counter stands at `low`. Called more often than it turns over, which
    /// is every 71 minutes.
    pub fn now(&mut self, low: u32) -> u64 {
        if low < self.last {
            self.high += 1 << 32;
        }
        self.last = low;
        self.high + u64::from(low)
    }
}

/// Time now and the next expiry after it, µs. `expire` wakes all that has expired by a time and returns the next
/// expiry; what expires while it works is woken at once.
pub fn next_alarm(mut now: impl FnMut() -> u64, mut expire: impl FnMut(u64) -> u64) -> (u64, u64) {
    loop {
        let time = now();
        let next = expire(time);
        if next > time {
            return (time, next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_that_turns_over_goes_on() {
        let mut clock = WideCounter::new();
        let read = [5, u32::MAX, 3, 3, 2].map(|low| clock.now(low));
        let turn = 1 << 32;
        assert_eq!(read, [5, turn - 1, turn + 3, turn + 3, 2 * turn + 2]);
    }

    #[test]
    fn what_expires_meanwhile_is_woken_before_the_alarm_is_set() {
        let mut expiries = [3, 10, 11, 50].into_iter().peekable();
        let mut woken = 0;
        let mut times = [9, 12].into_iter();
        let (now, next) = next_alarm(
            || times.next().unwrap(),
            |by| {
                while expiries.next_if(|&at| at <= by).is_some() {
                    woken += 1;
                }
                // By now it is 11 or later.
                if by == 9 {
                    9
                } else {
                    *expiries.peek().unwrap()
                }
            },
        );
        assert_eq!((now, next, woken), (12, 50, 3));
    }
}
