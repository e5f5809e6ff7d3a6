//! What a limit of jerk brings: moves of one simulated axis by the firmware's own profile, from the
//! first step until the axis has stayed within the in-position window for the settling time; on arms
//! that swing faster and slower than the one the defaults are made for, since real arms differ from it.

use core::f64::consts::TAU;
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::plant::{AxisPlant, PlantConfig};
use gonia_sim::profile::{Profile, Ramp, TICKS_PER_US};
use rayon::prelude::*;

/// Lengths of the moves of the paper's plan, degrees: steps of θ and of φ.
pub const WAYS_DEG: [f64; 6] = [10.0, 15.0, 18.0, 20.0, 30.0, 60.0];
/// Accelerations, deg/s².
pub const ACCELERATIONS: [u32; 5] = [20, 30, 45, 60, 90];
/// Frequencies of the arms' swing, Hz.
pub const SWINGS_HZ: [f64; 5] = [6.0, 8.0, 10.0, 12.5, 16.0];
/// Its damping, as a share of the critical one.
pub const DAMPINGS: [f64; 2] = [0.04, 0.08];
/// How long acceleration takes to build up, ms; 0 is the trapezoid.
pub const RISES_MS: [u32; 8] = [0, 25, 50, 75, 100, 125, 150, 200];

/// When the axis is looked at, µs.
const LOOK_US: u64 = 1_000;
/// Longer than any swing lasts, µs.
const REST_US: u64 = 4_000_000;

/// Moves with one acceleration and one rise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JerkRow {
    /// Acceleration, deg/s².
    pub acceleration: u32,
    /// How long it takes to build up, ms.
    pub rise_ms: u32,
    /// Whether these are the defaults.
    pub is_default: bool,
    /// From the beginning to the last step, mean of [`WAYS_DEG`], s.
    pub motion_s: f64,
    /// Until the in-position window is not left again, and the settling time is over, mean of all
    /// arms, s.
    pub settled_s: f64,
    /// The same of the arm that takes longest.
    pub slowest_s: f64,
    /// The same of the arm of the default plant.
    pub own_s: f64,
    /// How far the arms swing after the last step, the largest, degrees.
    pub swing_deg: f64,
}

/// Every acceleration with every rise.
pub fn jerk_rows() -> Vec<JerkRow> {
    let pairs: Vec<(u32, u32)> = ACCELERATIONS
        .iter()
        .flat_map(|a| RISES_MS.iter().map(move |rise| (*a, *rise)))
        .collect();
    pairs
        .into_par_iter()
        .map(|(a, rise)| row(a, rise))
        .collect()
}

fn row(acceleration: u32, rise_ms: u32) -> JerkRow {
    let runs: Vec<Vec<u64>> = WAYS_DEG
        .iter()
        .map(|way| step_times_us(*way, acceleration, rise_ms))
        .collect();
    let mut row = JerkRow {
        acceleration,
        rise_ms,
        is_default: f64::from(acceleration) == default_of(Key::Acceleration)
            && f64::from(rise_ms) * 1e-3 == default_of(Key::JerkTime),
        motion_s: mean(
            runs.iter()
                .map(|run| run.last().map_or(0.0, |us| *us as f64 * 1e-6)),
        ),
        settled_s: 0.0,
        slowest_s: 0.0,
        own_s: f64::NAN,
        swing_deg: 0.0,
    };
    let mut arms = Vec::new();
    for hz in SWINGS_HZ {
        for damping in DAMPINGS {
            let settled: Vec<(f64, f64)> = runs
                .iter()
                .map(|run| settle(run, plant_that_swings(hz, damping)))
                .collect();
            let arm_s = mean(settled.iter().map(|(s, _)| *s));
            row.slowest_s = row.slowest_s.max(arm_s);
            row.swing_deg = settled
                .iter()
                .map(|(_, deg)| *deg)
                .fold(row.swing_deg, f64::max);
            arms.push(arm_s);
        }
    }
    row.settled_s = mean(arms.into_iter());
    let own = PlantConfig::worm_axis(HOME_UDEG, 0.0);
    row.own_s = mean(runs.iter().map(|run| settle(run, own.clone()).0));
    row
}

const HOME_UDEG: f64 = -5e6;

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
    sum / n
}

fn plant_that_swings(hz: f64, damping: f64) -> PlantConfig {
    PlantConfig {
        ring_hz: hz,
        ring_decay_s: 1.0 / (damping * TAU * hz),
        ..PlantConfig::worm_axis(HOME_UDEG, 0.0)
    }
}

fn default_of(key: Key) -> f64 {
    f64::from(key.default_of(Axis::Theta)) * 1e-6
}

/// When each step of a move is due, µs.
fn step_times_us(way_deg: f64, acceleration: u32, rise_ms: u32) -> Vec<u64> {
    let of_the_default = |key: Key| u64::from(key.default_of(Axis::Theta).unsigned_abs());
    let steps_per_turn = of_the_default(Key::StepsPerTurn);
    let ramp = Ramp::new(
        of_the_default(Key::MaxSpeed),
        u64::from(acceleration) * 1_000_000,
        u64::from(rise_ms) * 1000,
        steps_per_turn,
    );
    let steps = (way_deg / 360.0 * steps_per_turn as f64).round() as u32;
    let (mut ticks, mut times) = (0, Vec::new());
    let mut profile = Profile::new(steps, ramp);
    while let Some(run) = &mut profile {
        ticks += u64::from(run.interval());
        if run.is_step() {
            times.push(ticks / TICKS_PER_US);
        }
        if !run.advance() {
            profile = None;
        }
    }
    times
}

/// Time until settled, and the swing after the last step.
fn settle(times_us: &[u64], config: PlantConfig) -> (f64, f64) {
    let config = PlantConfig {
        encoder_noise_udeg: 0.0,
        ..config
    };
    let mut plant = AxisPlant::new(config, 1);
    // The play is taken up before, as the firmware's approach does.
    let mut start_us = 1_000_000;
    for _ in 0..20 {
        plant.step(true, start_us);
        start_us += 10_000;
    }
    start_us += REST_US;
    for us in times_us {
        plant.step(true, start_us + us);
    }
    let end_us = start_us + times_us.last().copied().unwrap_or(0);
    let rest_udeg = plant.true_udeg(end_us + REST_US);
    let window_udeg = f64::from(Key::InPositionWindow.default_of(Axis::Theta));
    let (mut left_us, mut swing) = (end_us, 0.0f64);
    for now_us in (end_us..end_us + REST_US).step_by(LOOK_US as usize) {
        let off = (plant.true_udeg(now_us) - rest_udeg).abs();
        swing = swing.max(off);
        if off > window_udeg {
            left_us = now_us + LOOK_US;
        }
    }
    let settled_s = (left_us - start_us) as f64 * 1e-6 + default_of(Key::SettlingTime);
    (settled_s, swing * 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rise_makes_a_move_longer_by_itself() {
        let [sharp, round] = [0, 100].map(|rise| step_times_us(15.0, 30, rise));
        assert_eq!((sharp.len(), round.len()), (6000, 6000));
        // 15°/s after 0.5 s: 1.5 s in all; the last half step is not waited for.
        let [sharp, round] = [sharp, round].map(|times| times[5999] as f64 * 1e-6);
        assert!((sharp - 1.5).abs() < 0.02, "{sharp}");
        assert!((round - sharp - 0.1).abs() < 0.04, "{round}");
    }

    #[test]
    fn a_rise_of_a_period_leaves_hardly_any_swing_and_other_arms_swing_less_too() {
        for hz in SWINGS_HZ {
            let swing =
                |rise| settle(&step_times_us(15.0, 60, rise), plant_that_swings(hz, 0.08)).1;
            let [sharp, round] = [swing(0), swing(100)];
            let share = if hz == 10.0 { 0.2 } else { 0.7 };
            assert!(round < share * sharp, "{hz} Hz: {round} {sharp}");
        }
    }
}
