//! How long an arm takes, and which way round it goes. All from the default settings of the
//! controllers; a planner needs no controller for it.

use gonia_protocol::settings::{Axis, Key};

/// No frame is kept whose arms were further than this from their target, by encoder, degrees.
pub const POINTING_LIMIT_DEG: f64 = 0.03;

/// Time from the last step to the end of the settling time on the simulated rig, seconds. It is
/// the same for every move, so a planner may leave it out of a comparison, not out of an estimate.
pub const SETTLE_TIME_S: f64 = 0.25;

/// Time of a move of one axis between two *axis* angles (φ not wrapped), seconds, without settling.
///
/// The firmware's three boxes folded, p + r + j: d/v at full speed, v/a for the ramps, and the jerk
/// time; where full speed is not reached, p = r + j and d = a·p·r (`gonia_firmware::profile`).
/// A move downwards goes past its target by the backlash take-up and comes back up.
pub fn move_time_s(axis: Axis, from_deg: f64, to_deg: f64) -> f64 {
    let value = |key: Key| f64::from(key.default_of(axis)) * 1e-6;
    let (speed, acceleration) = (value(Key::MaxSpeed), value(Key::Acceleration));
    let rise = value(Key::JerkTime);
    let run = |way: f64| {
        if way <= 0.0 {
            0.0
        } else if way / speed >= speed / acceleration + rise {
            way / speed + speed / acceleration + rise
        } else {
            rise + (rise * rise + 4.0 * way / acceleration).sqrt()
        }
    };
    let way = to_deg - from_deg;
    if way >= 0.0 {
        run(way)
    } else {
        let take_up = value(Key::BacklashTakeup);
        run(take_up - way) + run(take_up)
    }
}

/// Where an axis at `from_deg` goes for an azimuth of `phi_deg`: of the angles φ + k·360° within
/// the limits the nearest. `None` if no turn of it is within them.
pub fn nearest_turn_deg(from_deg: f64, phi_deg: f64, limits_deg: [f64; 2]) -> Option<f64> {
    let [low, high] = limits_deg;
    let nearest = phi_deg + 360.0 * ((from_deg - phi_deg) / 360.0).round();
    [nearest, nearest - 360.0, nearest + 360.0]
        .into_iter()
        .find(|angle| (low..=high).contains(angle))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: [f64; 2] = [-185.0, 545.0];

    #[test]
    fn a_move_takes_the_time_of_its_profile() {
        // 15°/s, 90°/s² and 125 ms: 1 s, 1/6 s and 1/8 s.
        let long = 1.0 + 1.0 / 6.0 + 0.125;
        assert!((move_time_s(Axis::Theta, 0.0, 15.0) - long).abs() < 1e-9);
        // 0.1 s of ramp: p = 0.225 s, and 90 · 0.225 · 0.1 = 2.025°.
        assert!((move_time_s(Axis::Phi, 0.0, 2.025) - 0.45).abs() < 1e-9);
        // Down: 15.1° and then 0.1° back up.
        let down = move_time_s(Axis::Theta, 15.0, 0.0);
        let back_up = move_time_s(Axis::Theta, 0.0, 0.1);
        assert!((down - (long + 0.1 / 15.0 + back_up)).abs() < 1e-9);
        assert_eq!(move_time_s(Axis::Theta, 5.0, 5.0), 0.0);
    }

    #[test]
    fn an_azimuth_is_reached_the_shorter_way_within_the_limits() {
        assert_eq!(nearest_turn_deg(350.0, 10.0, LIMITS), Some(370.0));
        assert_eq!(nearest_turn_deg(540.0, 190.0, LIMITS), Some(190.0));
        assert_eq!(nearest_turn_deg(-180.0, 170.0, LIMITS), Some(170.0));
        assert_eq!(nearest_turn_deg(0.0, 270.0, LIMITS), Some(-90.0));
        assert_eq!(nearest_turn_deg(0.0, 50.0, [100.0, 300.0]), None);
    }
}
