//! How one axis comes to rest: a target is reached only when the encoder has stayed within the
//! in-position window for the whole settling time.

/// SettlingLimits of settling, from the settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SettlingLimits {
    /// Largest error, µdeg.
    pub window_udeg: i32,
    /// How long the error must stay within it, µs.
    pub time_us: u64,
    /// How long ringing may last before a correction, µs.
    pub timeout_us: u64,
}

/// Evaluations without either outcome after which settling is given up.
const MAX_EVALUATIONS: u32 = 50;

/// Watches one axis after its motion.
#[derive(Clone, Copy, Debug)]
pub struct SettlingMonitor {
    limits: SettlingLimits,
    inside_since_us: u64,
    /// Of the readings since then.
    inside_sum: i64,
    inside_count: i64,
    evaluation_us: u64,
    last_outside_us: Option<u64>,
    error_sum: i64,
    error_count: i32,
    evaluations: u32,
}

/// The state of settling after a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettlingResult {
    /// Not yet.
    Wait,
    /// Within the in-position window for the whole settling time, up to now.
    Reached,
    /// At rest, but off by so many µdeg (encoder − target).
    Off(i32),
    /// It neither comes to rest nor stays away.
    Restless,
}

impl SettlingMonitor {
    /// The motion has just ended.
    pub fn new(now_us: u64, limits: SettlingLimits) -> Self {
        Self {
            limits,
            inside_since_us: now_us,
            inside_sum: 0,
            inside_count: 0,
            evaluation_us: now_us,
            last_outside_us: None,
            error_sum: 0,
            error_count: 0,
            evaluations: 0,
        }
    }

    /// Takes a reading: encoder − target.
    pub fn reading(&mut self, now_us: u64, error_udeg: i32) -> SettlingResult {
        if error_udeg.unsigned_abs() > self.limits.window_udeg.unsigned_abs() {
            self.inside_since_us = now_us;
            (self.inside_sum, self.inside_count) = (0, 0);
            self.last_outside_us = Some(now_us);
        } else {
            self.inside_sum += i64::from(error_udeg);
            self.inside_count += 1;
            if now_us - self.inside_since_us >= self.limits.time_us {
                return SettlingResult::Reached;
            }
        }
        let half = self.evaluation_us + self.limits.timeout_us / 2;
        if now_us >= half {
            self.error_sum += i64::from(error_udeg);
            self.error_count += 1;
        }
        if now_us < self.evaluation_us + self.limits.timeout_us {
            return SettlingResult::Wait;
        }
        self.evaluate(now_us, half)
    }

    /// Mean error since it has been within the in-position window, µdeg.
    pub fn mean_udeg(&self) -> i64 {
        self.inside_sum / self.inside_count.max(1)
    }

    /// Ringing has had its time: judges the second half of it.
    fn evaluate(&mut self, now_us: u64, half_us: u64) -> SettlingResult {
        let mean = (self.error_sum / i64::from(self.error_count.max(1))) as i32;
        let was_outside = self.last_outside_us.is_some_and(|at| at >= half_us);
        self.evaluation_us = now_us;
        self.error_sum = 0;
        self.error_count = 0;
        self.evaluations += 1;
        if was_outside && mean.unsigned_abs() > self.limits.window_udeg.unsigned_abs() / 2 {
            SettlingResult::Off(mean)
        } else if self.evaluations > MAX_EVALUATIONS {
            SettlingResult::Restless
        } else {
            SettlingResult::Wait
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: SettlingLimits = SettlingLimits {
        window_udeg: 6000,
        time_us: 100_000,
        timeout_us: 160_000,
    };

    fn watch(error: impl Fn(u64) -> i32) -> (u64, SettlingResult) {
        let mut settle = SettlingMonitor::new(0, LIMITS);
        (0..)
            .map(|i| i * 2000)
            .find_map(|t| match settle.reading(t, error(t)) {
                SettlingResult::Wait => None,
                verdict => Some((t, verdict)),
            })
            .unwrap()
    }

    #[test]
    fn reached_means_the_whole_window() {
        assert_eq!(watch(|_| 6000), (100_000, SettlingResult::Reached));
        // One reading outside starts the window anew.
        let (t, verdict) = watch(|t| if t == 90_000 { 6001 } else { 0 });
        assert_eq!((t, verdict), (190_000, SettlingResult::Reached));
    }

    // Far from a limit: the last bit does not matter.
    #[allow(clippy::disallowed_methods)]
    #[test]
    fn ringing_that_dies_down_needs_no_correction() {
        let (t, verdict) = watch(|t| (20_000.0 * (-(t as f64) / 50_000.0).exp()) as i32);
        assert_eq!(verdict, SettlingResult::Reached);
        assert!((150_000..200_000).contains(&t), "{t}");
    }

    #[test]
    fn a_steady_error_is_reported_with_its_mean() {
        assert_eq!(watch(|_| -9000), (160_000, SettlingResult::Off(-9000)));
    }

    #[test]
    fn an_arm_that_never_rests_is_given_up() {
        assert_eq!(
            watch(|t| if t % 4000 == 0 { 20_000 } else { -20_000 }).1,
            SettlingResult::Restless
        );
    }
}
