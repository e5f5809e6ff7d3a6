//! What a limit of jerk would bring: moves of one simulated axis, from the first step until it has
//! stayed within the deadband for the settle window, with the trapezoid's corners rounded or not.

use gonia_protocol::settings::{Axis, Key};
use gonia_sim::plant::{AxisPlant, PlantConfig};

/// Lengths of the moves of the paper's plan, degrees: steps of θ and of φ.
pub const WAYS_DEG: [f64; 6] = [10.0, 15.0, 18.0, 20.0, 30.0, 60.0];
/// Accelerations, deg/s²; the default is the first.
pub const ACCELERATIONS: [f64; 4] = [30.0, 45.0, 60.0, 90.0];
/// How long acceleration takes to build up, ms; 0 is the trapezoid. 100 ms is a period of the swing.
pub const RISES_MS: [f64; 6] = [0.0, 25.0, 50.0, 75.0, 100.0, 150.0];

/// Time resolution of a profile, s.
const DT_S: f64 = 2e-5;
/// When the axis is looked at, µs.
const LOOK_US: u64 = 1_000;
/// Longer than any swing lasts, µs.
const REST_US: u64 = 3_000_000;

/// Moves with one acceleration and one rise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JerkRow {
    /// Acceleration, deg/s².
    pub acceleration: f64,
    /// How long it takes to build up, ms.
    pub rise_ms: f64,
    /// From the first step to the last, mean of [`WAYS_DEG`], s.
    pub motion_s: f64,
    /// Until the deadband is not left again, and the settle window is over, mean, s.
    pub settled_s: f64,
    /// How far the arm swings after the last step, the largest, degrees.
    pub swing_deg: f64,
}

/// Every acceleration with every rise.
pub fn jerk_rows() -> Vec<JerkRow> {
    let pairs = ACCELERATIONS
        .iter()
        .flat_map(|a| RISES_MS.iter().map(move |rise| (*a, *rise)));
    pairs.map(|(a, rise_ms)| row(a, rise_ms)).collect()
}

fn row(acceleration: f64, rise_ms: f64) -> JerkRow {
    let n = WAYS_DEG.len() as f64;
    let mut row = JerkRow {
        acceleration,
        rise_ms,
        motion_s: 0.0,
        settled_s: 0.0,
        swing_deg: 0.0,
    };
    for way in WAYS_DEG {
        let (motion_s, settled_s, swing_deg) = settle(&step_times(way, acceleration, rise_ms));
        row.motion_s += motion_s / n;
        row.settled_s += settled_s / n;
        row.swing_deg = row.swing_deg.max(swing_deg);
    }
    row
}

fn default_of(key: Key) -> f64 {
    f64::from(key.default_of(Axis::Theta)) * 1e-6
}

/// When each step of a move is due, s: the trapezoid of speed, averaged over the rise. That rounds its
/// corners to ramps of acceleration and lengthens it by just the rise.
fn step_times(way_deg: f64, acceleration: f64, rise_ms: f64) -> Vec<f64> {
    let speed = default_of(Key::MaxSpeed);
    let reached = (way_deg * acceleration).sqrt().min(speed);
    let ramp_s = reached / acceleration;
    let move_s = way_deg / reached + ramp_s;
    let place = |t: f64| -> f64 {
        let t = t.clamp(0.0, move_s);
        let up = |t: f64| 0.5 * acceleration * t * t;
        if t < ramp_s {
            up(t)
        } else if t > move_s - ramp_s {
            way_deg - up(move_s - t)
        } else {
            up(ramp_s) + reached * (t - ramp_s)
        }
    };
    let rise = (rise_ms * 1e-3 / DT_S).round() as usize;
    let total = ((move_s / DT_S).ceil() as usize) + rise + 1;
    let step_deg = 360.0 / f64::from(Key::StepsPerTurn.default_of(Axis::Theta));
    let mut sum = 0.0;
    let mut times = Vec::new();
    for i in 0..=total {
        let t = i as f64 * DT_S;
        let x = if rise == 0 {
            place(t)
        } else {
            sum += place(t) - place(t - rise as f64 * DT_S);
            sum / rise as f64
        };
        // Half a step ahead, as the firmware's ramp is.
        while x + 0.5 * step_deg >= (times.len() + 1) as f64 * step_deg {
            times.push(t);
        }
    }
    times
}

/// Time of motion, time until settled, and the swing after the last step.
fn settle(times: &[f64]) -> (f64, f64, f64) {
    let config = PlantConfig {
        encoder_noise_udeg: 0.0,
        ..PlantConfig::worm_axis(-5e6, 0.0)
    };
    let mut plant = AxisPlant::new(config, 1);
    // The play is taken up before, as the firmware's approach does.
    let mut start_us = 1_000_000;
    for _ in 0..20 {
        plant.step(true, start_us);
        start_us += 10_000;
    }
    start_us += REST_US;
    let at_us = |t: f64| start_us + (t * 1e6) as u64;
    for &t in times {
        plant.step(true, at_us(t));
    }
    let motion_s = times.last().copied().unwrap_or(0.0);
    let end_us = at_us(motion_s);
    let rest_udeg = plant.true_udeg(end_us + REST_US);
    let deadband_udeg = f64::from(Key::Deadband.default_of(Axis::Theta));
    let (mut left_us, mut swing) = (end_us, 0.0f64);
    for now_us in (end_us..end_us + REST_US).step_by(LOOK_US as usize) {
        let off = (plant.true_udeg(now_us) - rest_udeg).abs();
        swing = swing.max(off);
        if off > deadband_udeg {
            left_us = now_us + LOOK_US;
        }
    }
    let settled_s = (left_us - start_us) as f64 * 1e-6 + default_of(Key::SettleWindow);
    (motion_s, settled_s, swing * 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_trapezoid_ends_at_the_same_place_later_by_its_rise() {
        let sharp = step_times(15.0, 30.0, 0.0);
        let round = step_times(15.0, 30.0, 100.0);
        assert_eq!((sharp.len(), round.len()), (6000, 6000));
        let last = |times: &[f64]| times[times.len() - 1];
        // 15°/s after 0.5 s: 1.5 s in all; the last half step is not waited for.
        assert!((last(&sharp) - 1.5).abs() < 0.02, "{}", last(&sharp));
        assert!((last(&round) - last(&sharp) - 0.1).abs() < 0.04);
    }

    #[test]
    fn a_rise_of_a_period_leaves_hardly_any_swing() {
        let swing = |rise| settle(&step_times(15.0, 30.0, rise)).2;
        assert!(
            swing(100.0) < 0.5 * swing(0.0),
            "{} {}",
            swing(100.0),
            swing(0.0)
        );
    }
}
