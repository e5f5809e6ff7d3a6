//! How an arm swings on its gear: a damped oscillator that the motor's acceleration drives.
//!
//! With m the motor's place at the shaft and y the arm's, x = y − m obeys x″ + 2σx′ + (ω² + σ²)x = −m″.
//! Between two steps the motor's speed is taken as constant, so that m″ is an impulse at every step and
//! x a free oscillation in between, which is known in closed form.

use core::f64::consts::TAU;

/// Steps further apart than this belong to two runs, µs.
const NEW_RUN_US: u64 = 50_000;
/// After so many of its last intervals without a step the motor has stopped.
const STOPPED_INTERVALS: u64 = 3;
/// After so many decay times the swing is below a hundred-thousandth.
const DEAD: f64 = 12.0;

/// A swing: its state at a time. Angles in µdeg.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Swing {
    /// rad/s; 0 for an arm that is stiff.
    omega: f64,
    /// 1/s.
    sigma: f64,
    x_udeg: f64,
    v_udeg_s: f64,
    at_us: u64,
    /// Of the motor, µdeg/s.
    motor_udeg_s: f64,
    step_us: u64,
    interval_us: u64,
}

impl Swing {
    /// At rest. A frequency of 0 Hz is a stiff arm.
    pub fn new(hz: f64, decay_s: f64) -> Self {
        Self {
            omega: TAU * hz,
            sigma: if hz > 0.0 { 1.0 / decay_s } else { 0.0 },
            ..Self::default()
        }
    }

    /// The motor steps by so much.
    pub fn step(&mut self, by_udeg: f64, at_us: u64) {
        if self.omega == 0.0 {
            return;
        }
        let mut next = self.at(at_us);
        let interval_us = at_us.saturating_sub(self.step_us).max(1);
        // The first step of a run has no interval: its speed is not known before the second.
        let is_first = self.step_us == 0 || interval_us > NEW_RUN_US;
        let speed = if is_first {
            0.0
        } else {
            by_udeg * 1e6 / interval_us as f64
        };
        next.v_udeg_s -= speed - next.motor_udeg_s;
        next.motor_udeg_s = speed;
        next.step_us = at_us;
        next.interval_us = interval_us;
        *self = next;
    }

    /// How far the arm is from where the motor holds it, µdeg.
    pub fn udeg(&self, now_us: u64) -> f64 {
        if self.omega == 0.0 {
            return 0.0;
        }
        self.at(now_us).x_udeg
    }

    /// The swing at a later time; a motor that gives no more steps has stopped.
    fn at(&self, now_us: u64) -> Self {
        let mut swing = *self;
        let is_over = now_us > self.step_us + STOPPED_INTERVALS * self.interval_us;
        if self.motor_udeg_s != 0.0 && is_over {
            swing.evolve(self.step_us + self.interval_us);
            swing.v_udeg_s += self.motor_udeg_s;
            swing.motor_udeg_s = 0.0;
        }
        swing.evolve(now_us);
        swing
    }

    /// Free oscillation.
    fn evolve(&mut self, to_us: u64) {
        let t = to_us.saturating_sub(self.at_us) as f64 * 1e-6;
        self.at_us = self.at_us.max(to_us);
        if self.sigma * t > DEAD {
            (self.x_udeg, self.v_udeg_s) = (0.0, 0.0);
            return;
        }
        if self.x_udeg == 0.0 && self.v_udeg_s == 0.0 {
            return;
        }
        let (s, c, e) = (self.omega * t, self.omega * t, self.sigma * t);
        // Between two steps of a fast run the first terms are all.
        let (s, c, e) = if s < 0.1 {
            let q = s * s;
            (
                s * (1.0 - q / 6.0 * (1.0 - q / 20.0)),
                1.0 - q / 2.0 * (1.0 - q / 12.0 * (1.0 - q / 30.0)),
                1.0 - e * (1.0 - e / 2.0 * (1.0 - e / 3.0 * (1.0 - e / 4.0))),
            )
        } else {
            (libm::sin(s), libm::cos(c), libm::exp(-e))
        };
        let (x, v, w) = (self.x_udeg, self.v_udeg_s, self.omega);
        let stiffness = w * w + self.sigma * self.sigma;
        self.x_udeg = e * (x * c + (v + self.sigma * x) / w * s);
        self.v_udeg_s = e * (v * c - (self.sigma * v + stiffness * x) / w * s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HZ: f64 = 10.0;
    const DECAY_S: f64 = 0.2;
    /// As fine as the motor's.
    const STEP_UDEG: f64 = 2_500.0;

    #[test]
    fn a_sudden_stop_swings_with_the_speed_over_the_angular_frequency() {
        let mut swing = Swing::new(HZ, DECAY_S);
        // So long at 1°/s that the start has died down.
        let mut t = 0;
        for _ in 0..2000 {
            t += 2_500;
            swing.step(STEP_UDEG, t);
        }
        let peak = (0..200)
            .map(|i| swing.udeg(t + 2_500 + i * 500))
            .fold(0.0, f64::max);
        // A quarter of a period later, the decay of that time taken off.
        let expected = 1e6 / (TAU * HZ) * libm::exp(-0.025 / DECAY_S);
        assert!((peak / expected - 1.0).abs() < 0.02, "{peak} {expected}");
        assert_eq!(swing.udeg(t + 4_000_000), 0.0);
    }

    #[test]
    fn under_constant_acceleration_the_arm_lags_by_a_over_omega_squared() {
        let mut swing = Swing::new(HZ, DECAY_S);
        let acceleration = 30e6;
        let mut lag = 0.0;
        let mut n = 0.0;
        for i in 1..6000 {
            let t_s = libm::sqrt(2.0 * f64::from(i) * STEP_UDEG / acceleration);
            swing.step(STEP_UDEG, (t_s * 1e6) as u64);
            if t_s > 0.6 {
                lag += swing.udeg((t_s * 1e6) as u64);
                n += 1.0;
            }
        }
        let omega = TAU * HZ;
        let expected = -acceleration / (omega * omega + 1.0 / (DECAY_S * DECAY_S));
        let mean = lag / n;
        assert!((mean / expected - 1.0).abs() < 0.1, "{mean} {expected}");
    }

    #[test]
    fn a_stiff_arm_does_not_swing() {
        let mut swing = Swing::new(0.0, 0.0);
        for i in 1..100 {
            swing.step(STEP_UDEG, i * 1000);
            assert_eq!(swing.udeg(i * 1000 + 300), 0.0);
        }
    }
}
