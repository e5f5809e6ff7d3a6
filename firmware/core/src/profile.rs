//! When the next step is due: a jerk-limited run in integers.
//!
//! The speed of a run is three boxes folded with one another, p, r and j milliseconds long: a box of
//! full speed, whose ends the second one rounds to ramps of acceleration, whose corners the third one
//! rounds in turn (L. Biagiotti and C. Melchiorri, "FIR filters for online trajectory planning with
//! time- and frequency-domain specifications", 2012). A run of N steps then keeps to the speed N/p, the
//! acceleration N/(p·r) and, as p ≥ r + j, the jerk N/(p·r·j). An arm that swings with a period near
//! j, or near p or r in a short run, is hardly made to: a box has no such frequency in it.
//!
//! In whole milliseconds nothing is rounded. Folded boxes are three running sums; all they ever add up
//! to is p·r·j, and step n is due where N times the sum reaches (n − ½)·p·r·j. Within a millisecond the
//! speed is taken as constant, which puts a step off by a·(1 ms)²/8: 0.003 steps at 60°/s². Two
//! divisions a millisecond with steps in it. Intervals are in 1/256 µs.
//!
//! A stop in mid-run ends the box of full speed there and then; what follows is rounded like any other
//! end, so that it keeps to the speed and the acceleration. Where it comes while the run still speeds
//! up, the jerk may be twice as high.

/// Fixed-point intervals: fractions of a µs.
pub const TICKS_PER_US: u64 = 256;

/// What boxes are measured in, 1/256 µs.
const MS: u64 = 1000 * TICKS_PER_US;
/// No run is longer: four turns at ten million steps each, and more.
const MAX_STEPS: u32 = 1 << 27;
/// Longest boxes, ms, so that no product overflows: the settings allow half an hour of acceleration.
const MAX_CRUISE_MS: u64 = 1 << 30;
const MAX_RAMP_MS: u64 = 1 << 21;
const MAX_RISE_MS: u64 = 1 << 10;
/// Times [`MAX_STEPS`] it is a `u64`: 268 s a step.
const MOST_A_STEP: u64 = 1 << 36;
/// Fraction bits of [`Ramp::ms2_per_step`].
const AREA_BITS: u32 = 12;
/// Bits of a step that are left to work out times within a millisecond.
const TIME_BITS: u32 = 45;
/// After so long without a step a pause is put in, ms.
const LONGEST_PAUSE_MS: u32 = 100;

/// Speed, acceleration and jerk of a run, made once a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ramp {
    /// Shortest interval, 1/256 µs.
    interval: u64,
    /// 1/acceleration.
    ms2_per_step: u64,
    /// To full speed.
    ramp_ms: u64,
    rise_ms: u64,
}

impl Ramp {
    /// From µdeg/s and µdeg/s² (both positive), the time in which acceleration builds up (µs; 0 for a
    /// trapezoid of speed) and steps a turn.
    pub fn new(
        speed_udeg_s: u64,
        acceleration_udeg_s2: u64,
        rise_us: u64,
        steps_per_turn: u64,
    ) -> Self {
        const TURN_UDEG: u64 = 360_000_000;
        // Beyond what the settings allow, so that no product below overflows.
        let speed = speed_udeg_s.clamp(1, 1 << 30);
        let acceleration = acceleration_udeg_s2.clamp(1, 1 << 31);
        let steps_per_turn = steps_per_turn.clamp(1, 1 << 24);
        // 360e6 µdeg · 1e6 ms²/s² · 2¹² = 1.5e18 fits; so does 360e6 µdeg · 256e6 ticks/s.
        let ms2_turn = (TURN_UDEG * 1_000_000) << AREA_BITS;
        let ticks_turn = TURN_UDEG * 1_000_000 * TICKS_PER_US;
        Self {
            interval: ticks_turn.div_ceil(speed * steps_per_turn).min(MOST_A_STEP),
            ms2_per_step: ms2_turn
                .div_ceil(acceleration * steps_per_turn)
                .min(MOST_A_STEP),
            ramp_ms: (speed * 1000).div_ceil(acceleration).min(MAX_RAMP_MS),
            rise_ms: rise_us.div_ceil(1000).clamp(1, MAX_RISE_MS),
        }
    }

    /// The boxes p and r of a run.
    fn boxes(&self, steps: u64) -> (u64, u64) {
        let cruise_ms = (steps * self.interval).div_ceil(MS);
        let (mut ramp_ms, rise_ms) = (self.ramp_ms, self.rise_ms);
        if cruise_ms < ramp_ms + rise_ms {
            // Too short for full speed: N = a·p·r with p = r + j.
            let area = ((steps * self.ms2_per_step) >> AREA_BITS) + 1;
            let root = (rise_ms * rise_ms + 4 * area).isqrt();
            ramp_ms = ramp_ms.min((root - rise_ms) / 2 + 1);
        }
        let cruise_ms = cruise_ms.max(ramp_ms + rise_ms).min(MAX_CRUISE_MS);
        (cruise_ms, ramp_ms)
    }
}

/// A run of steps in one direction, from rest to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Profile {
    steps: u64,
    /// Steps still to come, the next one among them.
    remaining: u64,
    /// p as planned, and as a stop has left it.
    planned_ms: u32,
    cruise_ms: u32,
    ramp_ms: u32,
    rise_ms: u32,
    /// Milliseconds summed up so far.
    ms: u32,
    /// The running sums: of jerk, and of that, acceleration and speed.
    slope: i64,
    speed: u64,
    /// What a step is in sums: p·r·j.
    whole: u64,
    /// How much of the next step there is.
    part: u64,
    /// Steps left in this millisecond, when the next one is due, and their interval, 1/256 µs.
    due: u32,
    due_at: u32,
    spacing: u32,
    /// Where in this millisecond the last period ended.
    at: u32,
    interval: u32,
    is_step: bool,
}

impl Profile {
    /// A run of so many steps; `None` for no steps.
    pub fn new(steps: u32, ramp: Ramp) -> Option<Self> {
        let steps = u64::from(steps.min(MAX_STEPS));
        let (cruise_ms, ramp_ms) = ramp.boxes(steps);
        let whole = cruise_ms * ramp_ms * ramp.rise_ms;
        let [cruise_ms, ramp_ms, rise_ms] = [cruise_ms, ramp_ms, ramp.rise_ms].map(|ms| ms as u32);
        let mut profile = Self {
            steps,
            remaining: steps,
            planned_ms: cruise_ms,
            cruise_ms,
            ramp_ms,
            rise_ms,
            ms: 0,
            slope: 0,
            speed: 0,
            whole,
            part: whole / 2,
            due: 0,
            due_at: 0,
            spacing: 0,
            // The millisecond before the first is over.
            at: MS as u32,
            interval: 0,
            is_step: false,
        };
        profile.next_period().then_some(profile)
    }

    /// Time from the end of the last period to the end of the next one, in 1/256 µs.
    pub fn interval(&self) -> u32 {
        self.interval
    }

    /// Whether the next period ends with a step: a slow run has pauses between its steps.
    pub fn is_step(&self) -> bool {
        self.is_step
    }

    /// The next period was taken. Returns whether there is another.
    pub fn advance(&mut self) -> bool {
        self.remaining -= u64::from(self.is_step).min(self.remaining);
        self.next_period()
    }

    /// Slows down from here on. Returns whether there is still a step to come.
    pub fn decelerate(&mut self) -> bool {
        if self.ms < self.cruise_ms {
            self.cruise_ms = self.ms;
            // As many as the sums will still reach.
            let [cruise_ms, planned_ms] = [self.cruise_ms, self.planned_ms].map(u64::from);
            let will_give = (2 * self.steps * cruise_ms + planned_ms) / (2 * planned_ms);
            let given = self.steps - self.remaining;
            self.remaining = will_give.saturating_sub(given);
        }
        self.remaining > 0
    }

    /// Works out the next period. Returns whether there is one.
    #[inline(never)] // Flash: it is asked for in several places.
    fn next_period(&mut self) -> bool {
        if self.remaining == 0 {
            return false;
        }
        let mut waited = 0;
        for _ in 0..LONGEST_PAUSE_MS {
            if self.due > 0 {
                self.interval = waited + self.due_at - self.at;
                self.is_step = true;
                self.at = self.due_at;
                self.due_at += self.spacing;
                self.due -= 1;
                return true;
            }
            waited += MS as u32 - self.at;
            self.at = 0;
            self.sum_up();
        }
        self.interval = waited;
        self.is_step = false;
        true
    }

    /// A millisecond more of the folded boxes, and the steps in it.
    #[inline(never)] // A step that is due already needs nothing of it.
    fn sum_up(&mut self) {
        let (p, r, j) = (self.cruise_ms, self.ramp_ms, self.rise_ms);
        let past = |ms: u32| i32::from(self.ms >= ms);
        let jerk = 1 - past(p) - past(r) - past(j) + past(p + r) + past(p + j) + past(r + j)
            - past(p + r + j);
        self.ms += 1;
        self.slope += i64::from(jerk);
        self.speed = self.speed.saturating_add_signed(self.slope);
        let gain = self.steps * self.speed;
        let before = self.part;
        self.part += gain;
        if self.part < self.whole {
            return;
        }
        let due = self.part / self.whole;
        self.part -= due * self.whole;
        self.due = due as u32;
        // Only times are cut to fewer bits; the sums stay whole.
        let shift = (u64::BITS - self.whole.leading_zeros()).saturating_sub(TIME_BITS);
        let per_ms = (gain >> shift).max(1);
        let time_of = |sum: u64| ((sum >> shift) * MS / per_ms).min(MS) as u32;
        self.due_at = time_of(self.whole - before);
        self.spacing = time_of(self.whole);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    const STEP_DEG: f64 = 0.0025;

    fn ramp(speed_deg: u64, acceleration_deg: u64, rise_ms: u64) -> Ramp {
        let udeg = 1_000_000;
        let (speed, acceleration) = (speed_deg * udeg, acceleration_deg * udeg);
        Ramp::new(speed, acceleration, rise_ms * 1000, 144_000)
    }

    /// Times of the steps that are left, ms.
    fn step_times(profile: &mut Profile) -> Vec<f64> {
        let (mut times, mut t) = (Vec::new(), 0.0);
        loop {
            t += f64::from(profile.interval()) / MS as f64;
            if profile.is_step() {
                times.push(t);
            }
            if !profile.advance() {
                return times;
            }
        }
    }

    /// Steps by the time t of three boxes folded, by real arithmetic: N Σ ±(t − s)³ / 6prj.
    fn folded(steps: f64, boxes: [f64; 3], t: f64) -> f64 {
        let mut sum = 0.0;
        for set in 0..8u32 {
            let s: f64 = (0..3).filter(|i| set >> i & 1 == 1).map(|i| boxes[i]).sum();
            let sign = if set.count_ones() % 2 == 1 { -1.0 } else { 1.0 };
            sum += sign * (t - s).max(0.0).powi(3);
        }
        steps * sum / (6.0 * boxes.iter().product::<f64>())
    }

    /// Evenly scattered numbers.
    struct Dice(u64);

    impl Dice {
        fn below(&mut self, n: u64) -> u64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (self.0 >> 33) % n
        }

        /// Short runs as often as long ones, and every setting that makes sense.
        fn run(&mut self) -> (u32, [u64; 3]) {
            let digits = self.below(17);
            let steps = 1 + self.below(2 << digits) as u32;
            let settings = [1 + self.below(60), 1 + self.below(300), self.below(300)];
            (steps, settings)
        }
    }

    /// Sums a profile up to its end; the largest speed, acceleration and jerk, in deg and s.
    fn extremes(mut profile: Profile, stop_after: u64) -> [f64; 3] {
        let (mut most, mut before) = ([0.0f64; 3], profile);
        for ms in 0..profile.planned_ms + profile.ramp_ms + profile.rise_ms {
            if u64::from(ms) == stop_after {
                profile.decelerate();
            }
            profile.sum_up();
            let deg = STEP_DEG * profile.steps as f64 / profile.whole as f64;
            let (slope, speed) = (profile.slope as f64, profile.speed as f64);
            let jerk = slope - before.slope as f64;
            for (most, new) in most.iter_mut().zip([speed * 1e3, slope * 1e6, jerk * 1e9]) {
                *most = most.max(new.abs() * deg);
            }
            before = profile;
        }
        assert_eq!((profile.slope, profile.speed), (0, 0), "it rests");
        most
    }

    #[test]
    fn every_run_gives_exactly_its_steps_where_real_arithmetic_has_them() {
        let mut dice = Dice(1);
        for _ in 0..400 {
            let (steps, [speed, acceleration, rise_ms]) = dice.run();
            let mut profile = Profile::new(steps, ramp(speed, acceleration, rise_ms)).unwrap();
            let boxes = [profile.planned_ms, profile.ramp_ms, profile.rise_ms].map(f64::from);
            let times = step_times(&mut profile);
            assert_eq!(times.len(), steps as usize);
            for (n, t) in (0..).zip(times) {
                // Three boxes in whole ms are ahead of real ones by half of one each, less half of one.
                let real = folded(f64::from(steps), boxes, t + 1.0);
                let off = f64::from(n) + 0.5 - real;
                assert!(
                    off.abs() < 0.1,
                    "{steps} {speed} {acceleration} {rise_ms}: {n} {off}"
                );
            }
        }
    }

    #[test]
    fn no_run_passes_its_speed_its_acceleration_or_its_jerk() {
        let mut dice = Dice(2);
        for _ in 0..2000 {
            let (steps, [speed, acceleration, rise_ms]) = dice.run();
            let profile = Profile::new(steps, ramp(speed, acceleration, rise_ms)).unwrap();
            let [v, a, jerk] = extremes(profile, u64::MAX);
            let (speed, acceleration) = (speed as f64, acceleration as f64);
            let most = acceleration / (rise_ms.max(1) as f64 * 1e-3);
            let is_within =
                v <= 1.0001 * speed && a <= 1.0001 * acceleration && jerk <= 1.0001 * most;
            assert!(
                is_within,
                "{steps} {speed} {acceleration} {rise_ms}: {v} {a} {jerk}"
            );
        }
    }

    #[test]
    fn a_long_run_takes_the_time_of_its_trapezoid_and_the_rise() {
        for (steps, speed, acceleration, rise_ms) in [
            (6000, 15, 30, 0),
            (6000, 15, 30, 100),
            (80_000, 15, 60, 75),
            (4000, 2, 300, 50),
        ] {
            let times =
                step_times(&mut Profile::new(steps, ramp(speed, acceleration, rise_ms)).unwrap());
            let (way, v, a) = (
                f64::from(steps) * STEP_DEG,
                speed as f64,
                acceleration as f64,
            );
            let expected_ms = 1e3 * (way / v + v / a) + rise_ms as f64;
            // The last half step is not waited for.
            let early = expected_ms - times[times.len() - 1];
            assert!((0.0..30.0).contains(&early), "{early}");
            let fastest = times
                .windows(2)
                .map(|pair| pair[1] - pair[0])
                .fold(f64::MAX, f64::min);
            assert!(
                (fastest * v / 1e3 / STEP_DEG - 1.0).abs() < 0.01,
                "{fastest}"
            );
        }
    }

    #[test]
    fn a_stop_keeps_to_speed_and_acceleration_wherever_it_comes() {
        let mut dice = Dice(3);
        for _ in 0..1000 {
            let (steps, [speed, acceleration, rise_ms]) = dice.run();
            let profile = Profile::new(steps, ramp(speed, acceleration, rise_ms)).unwrap();
            let length = profile.planned_ms + profile.ramp_ms + profile.rise_ms;
            let [v, a, jerk] = extremes(profile, dice.below(u64::from(length)));
            let most = 2.0 * acceleration as f64 / (rise_ms.max(1) as f64 * 1e-3);
            assert!(v <= 1.0001 * speed as f64 && a <= 1.0001 * acceleration as f64);
            assert!(
                jerk <= 1.0001 * most,
                "{steps} {speed} {acceleration} {rise_ms}: {jerk}"
            );
        }
    }

    #[test]
    fn a_stop_gives_the_steps_that_it_takes_and_then_no_more() {
        let mut dice = Dice(4);
        for _ in 0..400 {
            let (steps, [speed, acceleration, rise_ms]) = dice.run();
            let mut profile = Profile::new(steps, ramp(speed, acceleration, rise_ms)).unwrap();
            let mut given = 0;
            let after = dice.below(u64::from(steps));
            while given < after {
                given += u64::from(profile.is_step());
                assert!(profile.advance());
            }
            let is_going = profile.decelerate();
            let mut again = profile;
            again.decelerate();
            assert_eq!(profile, again, "a second stop changes nothing");
            let mut t = 0.0;
            if is_going {
                let times = step_times(&mut profile);
                given += times.len() as u64;
                t = times[times.len() - 1];
            }
            let planned = f64::from(profile.planned_ms);
            let expected = f64::from(steps) * f64::from(profile.cruise_ms) / planned;
            assert!((given as f64 - expected).abs() <= 0.5, "{given} {expected}");
            assert!(t <= f64::from(profile.ramp_ms + profile.rise_ms) + 101.0);
        }
    }

    #[test]
    fn no_setting_makes_it_panic_or_run_for_ever() {
        for speed in [1, 10_000, 180_000_000, u64::MAX] {
            for acceleration in [0, 1, 100_000, 1_000_000_000] {
                for steps_per_turn in [1, 10_000_000] {
                    for rise_us in [0, 1, u64::MAX] {
                        let ramp = Ramp::new(speed, acceleration, rise_us, steps_per_turn);
                        for steps in [1, 2000, u32::MAX] {
                            let mut profile = Profile::new(steps, ramp).unwrap();
                            for _ in 0..1000 {
                                profile.advance();
                            }
                            profile.decelerate();
                        }
                    }
                }
            }
        }
        assert_eq!(Profile::new(0, ramp(15, 30, 50)), None);
    }

    #[test]
    fn a_slow_run_has_pauses_between_its_steps_and_still_all_of_them() {
        // A step in 1.8 s.
        let ramp = Ramp::new(10_000, 1_000_000, 50_000, 20_000);
        let mut profile = Profile::new(4, ramp).unwrap();
        assert!(!profile.is_step());
        let times = step_times(&mut profile);
        assert_eq!(times.len(), 4);
        assert!((times[2] - times[1] - 1800.0).abs() < 1.0, "{times:?}");
    }
}
