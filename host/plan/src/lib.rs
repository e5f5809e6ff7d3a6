//! Which poses to measure, and in which order.
//!
//! All pairs of some light and some view directions are visited. Both arms move at the same time,
//! so a step costs the slowest axis; the order makes most steps a short move of one arm.

pub mod adaptive;
mod bound;
pub mod symmetry;
pub mod tour;

use gonia_brdf::hemisphere::{OBLIQUE_LIGHTS, Ring, UNIFORM_RINGS, directions};
use gonia_brdf::{Direction, Pose};
use std::str::FromStr;

/// The directions that a plan combines, each list in rings.
#[derive(Clone, Debug, PartialEq)]
pub struct Rings {
    /// Rings of light directions.
    pub lights: Vec<Ring>,
    /// Rings of view directions.
    pub views: Vec<Ring>,
}

impl Rings {
    /// The paper's 105 lights × 81 views = 8505 poses.
    pub fn paper() -> Self {
        let mut lights = UNIFORM_RINGS.to_vec();
        lights.push(OBLIQUE_LIGHTS);
        Self {
            lights,
            views: UNIFORM_RINGS.to_vec(),
        }
    }

    /// A plan of minutes rather than hours: 37 lights × 25 views = 925 poses.
    pub fn quick() -> Self {
        let views = vec![(0.0, 1), (25.0, 5), (50.0, 8), (73.0, 11)];
        let mut lights = views.clone();
        lights.push((85.0, 12));
        Self { lights, views }
    }

    /// How many poses there are.
    pub fn count(&self) -> usize {
        let directions = |rings: &[Ring]| rings.iter().map(|(_, n)| n).sum::<usize>();
        directions(&self.lights) * directions(&self.views)
    }

    /// All poses, light by light, as the paper lists them.
    pub fn listed(&self) -> Vec<Pose> {
        let views = directions(&self.views);
        directions(&self.lights)
            .into_iter()
            .flat_map(|light| views.iter().map(move |view| Pose { light, view: *view }))
            .collect()
    }
}

/// A list of rings as people write it: `0:1,15:6,30:12` (polar angle in degrees, number of
/// azimuths).
#[derive(Clone, Debug, PartialEq)]
pub struct RingList(pub Vec<Ring>);

impl FromStr for RingList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split(',')
            .map(|item| {
                let bad = || format!("'{item}' is not POLAR:COUNT, as in 15:6");
                let (theta, n) = item.split_once(':').ok_or_else(bad)?;
                let theta: f64 = theta.trim().parse().map_err(|_| bad())?;
                let n: usize = n.trim().parse().map_err(|_| bad())?;
                if !(0.0..90.0).contains(&theta) || !(1..=3600).contains(&n) {
                    return Err(format!(
                        "'{item}': the polar angle must lie in 0..90 degrees and the count in 1..=3600"
                    ));
                }
                Ok((theta, n))
            })
            .collect::<Result<Vec<_>, _>>()
            .map(RingList)
    }
}

/// How long the arms take from one direction to another, in seconds: (from, to).
pub type MoveTime<'a> = &'a dyn Fn(Direction, Direction) -> f64;

/// Poses in travelling order, and what the order is worth.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The poses.
    pub poses: Vec<Pose>,
    /// Time spent moving, seconds, from the first pose to the last.
    pub travel_s: f64,
    /// Other orders of the same poses, where these are all pairs of some directions.
    pub others: Option<OtherOrders>,
}

/// Time spent moving in other orders, seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OtherOrders {
    /// As listed.
    pub listed_s: f64,
    /// No order can be faster: every pose has one neighbour that it is entered from and another that
    /// it is left to, and these are at best the two nearest (see `bound.rs`).
    pub bound_s: f64,
}

/// Orders any poses: nearest neighbours first, then stretches are reversed while that helps.
pub fn order(poses: &[Pose], light_time: MoveTime, view_time: MoveTime) -> Plan {
    let time = |a: &Pose, b: &Pose| light_time(a.light, b.light).max(view_time(a.view, b.view));
    let poses: Vec<Pose> = tour::long_path(poses, &time)
        .into_iter()
        .map(|k| poses[k])
        .collect();
    Plan {
        travel_s: travel_time(&poses, light_time, view_time),
        poses,
        others: None,
    }
}

/// Orders all poses of some rings. `light_time` and `view_time` are the arms' own.
pub fn plan(rings: &Rings, light_time: MoveTime, view_time: MoveTime) -> Plan {
    plan_some(rings, &|_| true, light_time, view_time)
}

/// Orders those poses of some rings that are needed.
pub fn plan_some(
    rings: &Rings,
    needed: &dyn Fn(&Pose) -> bool,
    light_time: MoveTime,
    view_time: MoveTime,
) -> Plan {
    let listed: Vec<Pose> = rings.listed().into_iter().filter(needed).collect();
    let in_some = |of: &dyn Fn(&Pose) -> Direction, direction: &Direction| {
        listed.iter().any(|pose| of(pose) == *direction)
    };
    let is_all = listed.len() == rings.count();
    let mut lights = directions(&rings.lights);
    lights.retain(|light| in_some(&|pose| pose.light, light));
    let mut views = directions(&rings.views);
    views.retain(|view| in_some(&|pose| pose.view, view));
    let light_path = tour::shortest_path(&lights, light_time);
    let view_path = tour::shortest_path(&views, view_time);
    let pairs = |lights_inside: bool| -> Vec<Pose> {
        let pair = |outer: usize, inner: usize| {
            let (l, v) = if lights_inside {
                (inner, outer)
            } else {
                (outer, inner)
            };
            Pose {
                light: lights[l],
                view: views[v],
            }
        };
        if lights_inside {
            sweep(
                &view_path,
                &views,
                view_time,
                &light_path,
                &lights,
                light_time,
                pair,
            )
        } else {
            sweep(
                &light_path,
                &lights,
                light_time,
                &view_path,
                &views,
                view_time,
                pair,
            )
        }
    };
    let snake = |lights_inside: bool| -> Vec<Pose> {
        let mut poses = pairs(lights_inside);
        poses.retain(needed);
        poses
    };
    let time = |poses: &[Pose]| travel_time(poses, light_time, view_time);
    let (a, b) = (snake(true), snake(false));
    let (time_a, time_b) = (time(&a), time(&b));
    let (poses, travel_s) = if time_a <= time_b {
        (a, time_a)
    } else {
        (b, time_b)
    };
    Plan {
        poses,
        travel_s,
        others: is_all.then(|| OtherOrders {
            listed_s: time(&listed),
            bound_s: bound::bound(&lights, &views, light_time, view_time),
        }),
    }
}

/// All pairs of an outer and an inner path, as a snake: the inner path forwards and backwards, one
/// outer step between. An inner step that is dearer than the mean outer one would be taken once for
/// every outer direction, so the inner path is cut there, and each stretch is swept by itself with
/// the outer path run through once more.
fn sweep(
    outer_path: &[usize],
    outer: &[Direction],
    outer_time: MoveTime,
    inner_path: &[usize],
    inner: &[Direction],
    inner_time: MoveTime,
    pair: impl Fn(usize, usize) -> Pose,
) -> Vec<Pose> {
    let outer_s: f64 = outer_path
        .windows(2)
        .map(|w| outer_time(outer[w[0]], outer[w[1]]))
        .sum();
    let dear_s = outer_s / outer_path.len().max(1) as f64;
    let stretches =
        inner_path.chunk_by(|a, b| inner_time(inner[*a], inner[*b]) <= dear_s.max(f64::EPSILON));
    let (mut outer_row, mut poses) = (outer_path.to_vec(), Vec::new());
    for stretch in stretches {
        let mut inner_row = stretch.to_vec();
        for o in &outer_row {
            poses.extend(inner_row.iter().map(|i| pair(*o, *i)));
            inner_row.reverse();
        }
        outer_row.reverse();
    }
    poses
}

/// Time to travel through poses in the given order, both arms moving at once; seconds.
pub fn travel_time(poses: &[Pose], light_time: MoveTime, view_time: MoveTime) -> f64 {
    poses
        .windows(2)
        .map(|w| light_time(w[0].light, w[1].light).max(view_time(w[0].view, w[1].view)))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::SymmetryKind;

    /// A degree a second, whichever axis is slower.
    fn time(a: Direction, b: Direction) -> f64 {
        (a.theta_deg() - b.theta_deg())
            .abs()
            .max((a.phi_deg() - b.phi_deg()).abs())
    }

    #[test]
    fn a_plan_visits_every_pose_once() {
        let rings = Rings::quick();
        let plan = plan(&rings, &time, &time);
        assert_eq!(plan.poses.len(), 925);
        let key = |p: &Pose| {
            [p.light, p.view].map(|d| {
                (
                    (d.theta_deg() * 1e6).round() as i64,
                    (d.phi_deg() * 1e6).round() as i64,
                )
            })
        };
        let mut keys: Vec<_> = plan.poses.iter().map(key).collect();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 925);
    }

    #[test]
    fn the_papers_plan_travels_near_its_lower_bound() {
        let plan = plan(&Rings::paper(), &time, &time);
        assert_eq!(plan.poses.len(), 8505);
        let others = plan.others.unwrap();
        assert!(others.bound_s <= plan.travel_s);
        assert!(plan.travel_s < others.listed_s);
        assert!(
            plan.travel_s < 1.1 * others.bound_s,
            "{} {}",
            plan.travel_s,
            others.bound_s
        );
    }

    #[test]
    fn some_poses_travel_no_longer_than_all_and_each_is_there_once() {
        let rings = Rings::paper();
        let needed = |pose: &Pose| symmetry::is_needed(pose, SymmetryKind::HalfTurn, 0.0);
        let (all, half) = (
            plan(&rings, &time, &time),
            plan_some(&rings, &needed, &time, &time),
        );
        assert_eq!((rings.count(), half.poses.len()), (8505, 4253));
        let mut listed = rings.listed();
        listed.retain(needed);
        assert!(listed.iter().all(|pose| half.poses.contains(pose)));
        assert!(
            half.travel_s < 0.6 * all.travel_s,
            "{}",
            half.travel_s / all.travel_s
        );
        assert_eq!(half.others, None);
    }

    #[test]
    fn a_single_pose_needs_no_travel() {
        let one = Rings {
            lights: vec![(0.0, 1)],
            views: vec![(0.0, 1)],
        };
        let plan = plan(&one, &time, &time);
        assert_eq!((plan.travel_s, plan.others.unwrap().bound_s), (0.0, 0.0));
        assert_eq!(order(&plan.poses, &time, &time).poses, plan.poses);
    }

    #[test]
    fn any_poses_are_ordered_without_loss_and_for_a_shorter_way() {
        let mut poses = Rings::quick().listed();
        poses.retain(|p| (((p.light.phi + 2.0 * p.view.phi) * 1e4) as u64).is_multiple_of(3));
        let ordered = order(&poses, &time, &time);
        assert!(poses.len() > 100 && ordered.poses.len() == poses.len());
        assert!(poses.iter().all(|pose| ordered.poses.contains(pose)));
        assert!(ordered.travel_s < 0.8 * travel_time(&poses, &time, &time));
    }

    #[test]
    fn rings_are_read_as_people_write_them() {
        let list: RingList = "0:1, 15:6".parse().unwrap();
        assert_eq!(list.0, [(0.0, 1), (15.0, 6)]);
        for bad in ["", "15", "15:0", "90:4", "-1:4", "15:x"] {
            assert!(bad.parse::<RingList>().is_err(), "{bad}");
        }
    }
}
