//! CPU time.

use cpu_time::ProcessTime;

/// Seconds that all threads of this program have worked so far; NaN where the system does not say.
pub fn cpu_seconds() -> f64 {
    ProcessTime::try_now().map_or(f64::NAN, |now| now.as_duration().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_counts_and_sleep_does_not() {
        let start = cpu_seconds();
        let mut x = 0u64;
        while cpu_seconds() - start < 0.02 {
            x = std::hint::black_box(x + 1);
        }
        assert!(x > 0);
    }
}
