//! How fast any order of the poses can be at best.

use crate::MoveTime;
use gonia_brdf::Direction;

/// A step of one arm to or from another direction of its list.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    seconds: f64,
    /// Whether it is the light's, and where it leads: two steps of a pose must differ in this.
    other: (bool, usize),
}

/// The two quickest steps into a direction, and out of it.
struct Quickest {
    into: Vec<Step>,
    out_of: Vec<Step>,
}

/// Travelling time below which no order of all pairs of the directions can come, seconds.
///
/// On an open path every pose but the first is entered, every pose but the last is left, and the pose
/// that it is entered from is not the one that it is left to. So the sum over all poses of the
/// cheapest such pair of steps, halved because each step has two ends, is a bound once what the two
/// ends of the path save is taken off. (It is the two-neighbour bound of the travelling salesman,
/// for ways that take longer in one direction.) A step of both arms at once is no quicker than that
/// of either alone, so such steps need not be looked at.
pub fn bound(
    lights: &[Direction],
    views: &[Direction],
    light_time: MoveTime,
    view_time: MoveTime,
) -> f64 {
    let (lights, views) = (
        quickest(true, lights, light_time),
        quickest(false, views, view_time),
    );
    let (mut sum, mut saved) = (0.0, 0.0f64);
    for light in &lights {
        for view in &views {
            let into = || light.into.iter().chain(&view.into);
            let out_of = || light.out_of.iter().chain(&view.out_of);
            let pairs = into().flat_map(|i| out_of().map(move |o| (i, o)));
            let pair = pairs
                .filter(|(i, o)| i.other != o.other)
                .map(|(i, o)| i.seconds + o.seconds)
                .fold(f64::INFINITY, f64::min);
            let single = into().chain(out_of()).map(|s| s.seconds);
            let single = single.fold(f64::INFINITY, f64::min);
            // A plan of one pose or two has no pair of neighbours.
            if pair.is_finite() {
                sum += pair;
                saved = saved.max(pair - single);
            }
        }
    }
    (0.5 * sum - saved).max(0.0)
}

fn quickest(is_light: bool, of: &[Direction], time: MoveTime) -> Vec<Quickest> {
    let two = |steps: &mut dyn Iterator<Item = Step>| {
        let mut steps: Vec<Step> = steps.collect();
        steps.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        steps.truncate(2);
        steps
    };
    let others = |k: usize| (0..of.len()).filter(move |j| *j != k);
    let step = |seconds, j| Step {
        seconds,
        other: (is_light, j),
    };
    (0..of.len())
        .map(|k| Quickest {
            into: two(&mut others(k).map(|j| step(time(of[j], of[k]), j))),
            out_of: two(&mut others(k).map(|j| step(time(of[k], of[j]), j))),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::travel_time;
    use gonia_brdf::Pose;

    /// Up is quicker than down.
    fn time(a: Direction, b: Direction) -> f64 {
        let way = b.theta_deg() - a.theta_deg();
        if way > 0.0 { way } else { -1.5 * way }
    }

    #[test]
    fn no_order_of_a_small_plan_beats_the_bound() {
        let at = |degrees: &[f64]| -> Vec<Direction> {
            degrees
                .iter()
                .map(|t| Direction::from_deg(*t, 0.0))
                .collect()
        };
        for (lights, views) in [
            (at(&[0.0, 7.0, 9.0]), at(&[0.0, 4.0])),
            (at(&[0.0, 1.0, 5.0]), at(&[3.0])),
        ] {
            let poses: Vec<Pose> = lights
                .iter()
                .flat_map(|&light| views.iter().map(move |&view| Pose { light, view }))
                .collect();
            let mut best = f64::INFINITY;
            orders(&mut poses.clone(), 0, &mut |order| {
                best = best.min(travel_time(order, &time, &time));
            });
            let bound = bound(&lights, &views, &time, &time);
            assert!(bound <= best + 1e-9 && bound > 0.5 * best, "{bound} {best}");
        }
    }

    fn orders(poses: &mut Vec<Pose>, from: usize, each: &mut dyn FnMut(&[Pose])) {
        if from == poses.len() {
            each(poses);
        }
        for i in from..poses.len() {
            poses.swap(from, i);
            orders(poses, from + 1, each);
            poses.swap(from, i);
        }
    }
}
