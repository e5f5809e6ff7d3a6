//! When the next step is due: a trapezoid of speed in integers.
//!
//! The interval between steps follows the recurrence cₙ = cₙ₋₁ − 2cₙ₋₁/(4n + 1) of a constant
//! acceleration (D. Austin, "Generate stepper-motor speed profiles in real time", 2004), backwards
//! for the deceleration; remainders are carried, so that rounding does not add up. One division a
//! step and no square root. Intervals are in 1/256 µs.

/// Fixed-point intervals: fractions of a µs.
pub const TICKS_PER_US: u64 = 256;

/// Speed and acceleration of a run, made once a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ramp {
    first_interval: u32,
    min_interval: u32,
}

impl Ramp {
    /// From µdeg/s and µdeg/s² (both positive) and steps a turn.
    pub fn new(speed_udeg_s: u64, acceleration_udeg_s2: u64, steps_per_turn: u64) -> Self {
        const TURN_UDEG: u64 = 360_000_000;
        let as_interval = |ticks: u64| ticks.clamp(1, u64::from(u32::MAX / 4)) as u32;
        // 360e6 µdeg · 256e6 ticks/s = 9.2e16 fits.
        let min = TURN_UDEG * 1_000_000 * TICKS_PER_US / (speed_udeg_s * steps_per_turn).max(1);
        // c₀ = 0.676 · sqrt(2/a); the factor makes up for the recurrence's error at its first step.
        let acceleration_steps = (acceleration_udeg_s2 * steps_per_turn / TURN_UDEG).max(1);
        let first_squared = 173_056_000u64.pow(2) * 2 / acceleration_steps;
        Self {
            first_interval: as_interval(first_squared.isqrt()),
            min_interval: as_interval(min),
        }
    }
}

/// A run of steps in one direction, from rest to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Profile {
    remaining: u32,
    /// Steps of acceleration so far: as many are needed to stop.
    ramp_steps: u32,
    interval: u32,
    remainder: u32,
    min_interval: u32,
}

impl Profile {
    /// A run of so many steps; `None` for no steps.
    pub fn new(steps: u32, ramp: Ramp) -> Option<Self> {
        (steps > 0).then_some(Self {
            remaining: steps,
            ramp_steps: 0,
            interval: ramp.first_interval.max(ramp.min_interval),
            remainder: 0,
            min_interval: ramp.min_interval,
        })
    }

    /// Time from rest to the first step, or from the last step to the next, in 1/256 µs.
    pub fn interval(&self) -> u32 {
        self.interval
    }

    /// A step was given. Returns whether there is another, whose interval is then set.
    pub fn advance(&mut self) -> bool {
        self.remaining = self.remaining.saturating_sub(1);
        if self.remaining == 0 {
            return false;
        }
        if self.remaining <= self.ramp_steps {
            self.ramp_steps = self.remaining;
            self.change_speed(4 * self.remaining - 1, false);
        } else if self.interval > self.min_interval {
            self.ramp_steps += 1;
            self.change_speed(4 * self.ramp_steps + 1, true);
            if self.interval <= self.min_interval {
                self.interval = self.min_interval;
                self.remainder = 0;
            }
        }
        true
    }

    /// Slows down from here on. Returns whether there is still a step to come.
    pub fn decelerate(&mut self) -> bool {
        self.remaining = self.remaining.min(self.ramp_steps);
        self.remaining > 0
    }

    fn change_speed(&mut self, divisor: u32, faster: bool) {
        let dividend = 2 * self.interval + self.remainder;
        let change = dividend / divisor;
        self.remainder = dividend % divisor;
        self.interval = if faster {
            self.interval - change
        } else {
            self.interval.saturating_add(change).min(u32::MAX / 4)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times of all steps, in µs.
    fn run(profile: &mut Profile) -> (u32, f64, f64) {
        let (mut steps, mut t, mut fastest) = (0, 0.0, f64::MAX);
        loop {
            let interval = f64::from(profile.interval()) / 256.0;
            t += interval;
            fastest = fastest.min(interval);
            steps += 1;
            if !profile.advance() {
                return (steps, t, fastest);
            }
        }
    }

    fn ramp(speed_deg: u64, acceleration_deg: u64) -> Ramp {
        Ramp::new(speed_deg * 1_000_000, acceleration_deg * 1_000_000, 144_000)
    }

    #[test]
    fn a_run_gives_exactly_its_steps_in_the_time_of_a_trapezoid() {
        for (steps, speed, acceleration) in [
            (1_u32, 15, 30),
            (40, 15, 30),
            (2500, 15, 30),
            (6000, 15, 30),
            (80_000, 15, 30),
            (20_000, 40, 100),
            (4000, 2, 300),
        ] {
            let mut profile = Profile::new(steps, ramp(speed, acceleration)).unwrap();
            let (given, t_us, _) = run(&mut profile);
            assert_eq!(given, steps);
            let (d, v, a) = (f64::from(steps) * 0.0025, speed as f64, acceleration as f64);
            let expected = if d > v * v / a {
                d / v + v / a
            } else {
                2.0 * (d / a).sqrt()
            };
            // The first step comes early, by a fixed time.
            let tolerance = 0.01 * expected + 0.01;
            assert!(
                (t_us * 1e-6 - expected).abs() < tolerance,
                "{steps}: {} {expected}",
                t_us * 1e-6
            );
        }
    }

    #[test]
    fn the_speed_limit_is_reached_and_never_passed() {
        let (_, _, fastest) = run(&mut Profile::new(50_000, ramp(15, 30)).unwrap());
        // 15°/s are 6000 steps/s.
        assert!((fastest - 1e6 / 6000.0).abs() < 0.01, "{fastest}");
    }

    #[test]
    fn slowing_down_midway_takes_as_long_as_speeding_up_did() {
        let mut profile = Profile::new(50_000, ramp(15, 30)).unwrap();
        let mut up = 0.0;
        for _ in 0..1000 {
            up += f64::from(profile.interval());
            profile.advance();
        }
        assert!(profile.decelerate());
        let (steps, down, _) = run(&mut profile);
        assert_eq!(steps, 1000);
        assert!((down * 256.0 / up - 1.0).abs() < 0.02, "{down} {up}");
    }

    #[test]
    fn no_setting_makes_it_panic() {
        for speed in [1, 1000, 1_000_000_000] {
            for acceleration in [1, 1_000_000_000] {
                for steps_per_turn in [1, 10_000_000] {
                    let ramp = Ramp::new(speed, acceleration, steps_per_turn);
                    let mut profile = Profile::new(2000, ramp).unwrap();
                    assert_eq!(run(&mut profile).0, 2000);
                }
            }
        }
        assert_eq!(Profile::new(0, ramp(15, 30)), None);
    }
}
