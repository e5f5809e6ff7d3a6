//! CPU time.

use rustix::time::{ClockId, clock_gettime};

/// Seconds that all threads of this program have worked so far.
pub fn cpu_seconds() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
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
