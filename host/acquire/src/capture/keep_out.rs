//! Arms that can touch: how both get from pose to pose without coming too near to each other.
//!
//! An axis moves at its own pace: it may be held up, or make corrections. So a leg of a way counts as
//! clear only if *no* combination of angles between its ends is too near, whatever the timing. Where
//! both arms cannot go at once they go one after the other, axis by axis, or over another polar angle or
//! another turn of the azimuth; the way with the fewest legs is taken.
//!
//! Angles here are those of the axes: \[θ, φ\] in degrees, φ not wrapped, θ below 0 beyond the zenith.

use gonia_brdf::Elementary;
use std::collections::VecDeque;

/// \[θ, φ\] of one arm.
pub type Axes = [f64; 2];
/// Light arm and camera arm.
pub type ArmAngles = [Axes; 2];

/// Polar angles at which one arm may pass the other.
const PASSES_DEG: [f64; 7] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0];
/// Polar angles within a leg are checked in steps of this.
const FINENESS_DEG: f64 = 0.5;
/// What rounding may take off an angle.
const SLACK_DEG: f64 = 1e-6;

/// The angle between the directions of two arms, degrees.
pub fn apart_deg(pair: &ArmAngles) -> f64 {
    nearest_deg(pair, pair)
}

/// The legs of a way that is clear of `keep_out_deg`, the last one ending at `to`; `None` if there is
/// none. Arms that stand nearer than that, as after homing, may part: the first legs come no nearer
/// than they are.
pub fn way(from: &ArmAngles, to: &ArmAngles, keep_out_deg: f64) -> Option<Vec<ArmAngles>> {
    if is_clear(from, to, keep_out_deg) {
        return Some(vec![*to]);
    }
    let stations = [0, 1].map(|arm| stations_of(from[arm], to[arm]));
    let node = |at: [usize; 2]| [stations[0][at[0]], stations[1][at[1]]];
    let width = stations[1].len();
    // Breadth first: the first way found has the fewest legs. Station 0 is `from`, 1 is `to`.
    let mut came_from = vec![None; stations[0].len() * width];
    let mut open = VecDeque::from([[0, 0]]);
    came_from[0] = Some([0, 0]);
    while let Some(at) = open.pop_front() {
        for arm in [0, 1] {
            for next in 0..stations[arm].len() {
                let mut there = at;
                there[arm] = next;
                let is_known = came_from[there[0] * width + there[1]].is_some();
                if is_known || !is_clear(&node(at), &node(there), keep_out_deg) {
                    continue;
                }
                came_from[there[0] * width + there[1]] = Some(at);
                if there == [1, 1] {
                    return Some(trace(&came_from, width, node));
                }
                open.push_back(there);
            }
        }
    }
    None
}

fn trace(
    came_from: &[Option<[usize; 2]>],
    width: usize,
    node: impl Fn([usize; 2]) -> ArmAngles,
) -> Vec<ArmAngles> {
    let mut legs = Vec::new();
    let mut at = [1, 1];
    while at != [0, 0] {
        legs.push(node(at));
        at = came_from[at[0] * width + at[1]].unwrap_or([0, 0]);
    }
    legs.reverse();
    legs
}

/// Where an arm may stand in between: `from`, `to`, and both azimuths at every polar angle to pass at.
fn stations_of(from: Axes, to: Axes) -> Vec<Axes> {
    let polar_angles = [from[0], to[0]].into_iter().chain(PASSES_DEG);
    let crossed = polar_angles.flat_map(|theta| [from[1], to[1]].map(|phi| [theta, phi]));
    let mut stations = vec![from, to];
    for station in crossed {
        if !stations[2..].contains(&station) {
            stations.push(station);
        }
    }
    stations
}

/// Whether both arms may go at once, at whatever pace, each axis on its own. Where they stand too near
/// already they may go no nearer, and must be clear at the end or at least further apart.
fn is_clear(from: &ArmAngles, to: &ArmAngles, keep_out_deg: f64) -> bool {
    let stand_deg = apart_deg(from);
    let nearest = nearest_deg(from, to);
    if stand_deg >= keep_out_deg {
        return nearest >= keep_out_deg - SLACK_DEG;
    }
    let parts = apart_deg(to) > stand_deg + SLACK_DEG;
    parts && nearest >= stand_deg - SLACK_DEG && !moves_both(from, to)
}

fn moves_both(from: &ArmAngles, to: &ArmAngles) -> bool {
    from[0] != to[0] && from[1] != to[1]
}

/// The smallest angle between any place that the light arm may be at on its way and any of the camera
/// arm's, degrees: to about a fifth of a degree where both polar angles change.
fn nearest_deg(from: &ArmAngles, to: &ArmAngles) -> f64 {
    let [low, high] = [from[0][1] - from[1][1], to[0][1] - to[1][1]]
        .iter()
        .chain(&[from[0][1] - to[1][1], to[0][1] - from[1][1]])
        .fold([f64::MAX, f64::MIN], |[low, high], &deg| {
            [low.min(deg), high.max(deg)]
        });
    // cos of the smallest and of the largest difference of azimuth, the short way round.
    let near = turned_to(0.0, low, high).to_radians().cosine();
    let far = -turned_to(180.0, low, high).to_radians().cosine();
    let polar_angles = |arm: usize| {
        let (a, b) = (from[arm][0], to[arm][0]);
        let n = ((b - a).abs() / FINENESS_DEG).ceil().max(1.0) as usize;
        let last = if a == b { 0 } else { n };
        (0..=last).map(move |i| {
            (a + (b - a) * i as f64 / n as f64)
                .to_radians()
                .sine_cosine()
        })
    };
    let mut most = -1.0f64;
    for (sin, cos) in polar_angles(0) {
        for (other_sin, other_cos) in polar_angles(1) {
            let across = sin * other_sin;
            // Beyond the zenith the far side is the near one.
            let azimuth = if across >= 0.0 { near } else { far };
            most = most.max(cos * other_cos + across * azimuth);
        }
    }
    most.clamp(-1.0, 1.0).arc_cosine().to_degrees()
}

/// How near to `deg`, in whatever turn, the angles from `low` to `high` come.
fn turned_to(deg: f64, low: f64, high: f64) -> f64 {
    let next = deg + 360.0 * ((low - deg) / 360.0).ceil();
    if next <= high {
        return 0.0;
    }
    let off = |x: f64| ((x - deg + 180.0).rem_euclid(360.0) - 180.0).abs();
    off(low).min(off(high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;
    use gonia_brdf::direction::angle_between;

    fn angle_deg(pair: &ArmAngles) -> f64 {
        let [a, b] = pair.map(|[theta, phi]| Direction::from_deg(theta, phi).to_vec3());
        angle_between(a, b).to_degrees()
    }

    /// Goes a leg at many paces; the smallest angle on the way.
    fn nearest_of_many_paces(from: &ArmAngles, to: &ArmAngles) -> f64 {
        let at = |arm: usize, axis: usize, share: f64| {
            from[arm][axis] + share * (to[arm][axis] - from[arm][axis])
        };
        let n = 12;
        let mut nearest = f64::MAX;
        for code in 0..(n + 1u32).pow(4) {
            let share = |i: u32| f64::from(code / (n + 1).pow(i) % (n + 1)) / f64::from(n);
            let pair = [
                [at(0, 0, share(0)), at(0, 1, share(1))],
                [at(1, 0, share(2)), at(1, 1, share(3))],
            ];
            nearest = nearest.min(angle_deg(&pair));
        }
        nearest
    }

    #[test]
    fn no_pace_brings_the_arms_nearer_than_the_leg_says() {
        let legs: [[ArmAngles; 2]; 5] = [
            [[[10.0, 0.0], [60.0, 90.0]], [[70.0, 60.0], [50.0, 110.0]]],
            [[[45.0, 350.0], [45.0, 30.0]], [[45.0, 330.0], [40.0, 20.0]]],
            [
                [[-2.0, -185.0], [30.0, 0.0]],
                [[15.0, -100.0], [60.0, 40.0]],
            ],
            [[[80.0, 0.0], [80.0, 180.0]], [[80.0, 170.0], [80.0, 200.0]]],
            [[[20.0, 0.0], [70.0, 540.0]], [[20.0, 0.0], [30.0, 500.0]]],
        ];
        for [from, to] in legs {
            let (bound, found) = (nearest_deg(&from, &to), nearest_of_many_paces(&from, &to));
            // The search is coarse and the bound is not: it may be lower, never higher.
            assert!(bound <= found + 0.2, "{from:?} {to:?}: {bound} {found}");
            assert!((apart_deg(&from) - angle_deg(&from)).abs() < 1e-6);
        }
    }

    #[test]
    fn arms_that_would_pass_through_each_other_go_round() {
        // The light stands at 60°, the camera at 90° of azimuth; they swap places.
        let (from, to) = ([[45.0, 60.0], [45.0, 120.0]], [[45.0, 120.0], [45.0, 60.0]]);
        assert!(nearest_deg(&from, &to) < 1.0);
        let legs = way(&from, &to, 25.0).unwrap();
        assert_eq!(legs.last(), Some(&to));
        assert!(legs.len() > 1);
        let mut at = from;
        for leg in legs {
            assert!(nearest_of_many_paces(&at, &leg) > 24.8, "{at:?} {leg:?}");
            at = leg;
        }
    }

    #[test]
    fn a_clear_way_is_one_leg_and_an_impossible_one_none() {
        let (from, to) = ([[45.0, 0.0], [45.0, 180.0]], [[60.0, 20.0], [30.0, 200.0]]);
        assert_eq!(way(&from, &to, 25.0), Some(vec![to]));
        let too_near = [[45.0, 0.0], [45.0, 10.0]];
        assert_eq!(way(&from, &too_near, 25.0), None);
    }

    #[test]
    fn arms_that_are_too_near_after_homing_part_one_at_a_time() {
        let home = [[-2.0, -185.0]; 2];
        let to = [[45.0, 0.0], [60.0, 90.0]];
        let legs = way(&home, &to, 25.0).unwrap();
        assert!(!moves_both(&home, &legs[0]));
        let mut at = home;
        for leg in legs {
            let least = apart_deg(&at).min(25.0);
            assert!(
                nearest_of_many_paces(&at, &leg) > least - 0.2,
                "{at:?} {leg:?}"
            );
            at = leg;
        }
        assert_eq!(at, to);
    }
}
