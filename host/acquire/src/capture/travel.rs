//! A plan in the arms' own times, and kept clear of the other arm.

use crate::capture::keep_out::{ArmAngles, apart_deg, way};
use crate::capture::timing::{SETTLE_TIME_S, move_time_s, nearest_turn_deg};
use gonia_brdf::{Direction, Pose};
use gonia_plan::{Plan, Rings};
use gonia_protocol::settings::{Axis, Key};

/// The plan of some rings in the arms' own travelling times.
pub fn travelling(rings: &Rings) -> Plan {
    gonia_plan::plan(rings, &arm_time_s, &arm_time_s)
}

/// The same of those poses that are needed.
pub fn travelling_some(rings: &Rings, needed: &dyn Fn(&Pose) -> bool) -> Plan {
    gonia_plan::plan_some(rings, needed, &arm_time_s, &arm_time_s)
}

/// Poses in the order in which the arms get through them fastest.
pub fn travelling_order(poses: &[Pose]) -> Plan {
    gonia_plan::order(poses, &arm_time_s, &arm_time_s)
}

/// What keeping the arms apart did to a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptApart {
    /// Poses left out because light and view are too near to each other.
    pub too_near: usize,
    /// Poses left out because no way to them is clear.
    pub out_of_reach: usize,
    /// Moves that go round the other arm.
    pub rounds: usize,
}

/// Leaves out the poses of a plan at which the arms would touch (light and view nearer to each other
/// than `keep_out_deg`) or to which they cannot come, and goes round where the straight way is not
/// clear.
pub fn keep_apart(plan: &mut Plan, keep_out_deg: f64) -> KeptApart {
    let axes = |pose: &Pose| [pose.light, pose.view].map(|d| [d.theta_deg(), d.phi_deg()]);
    let before = plan.poses.len();
    plan.poses
        .retain(|pose| apart_deg(&axes(pose)) >= keep_out_deg);
    let too_near = before - plan.poses.len();
    let (mut travel_s, mut rounds, mut out_of_reach) = (0.0, 0, 0);
    let limit_deg = |key: Key| f64::from(key.default_of(Axis::Phi)) * 1e-6;
    let limits_deg = [limit_deg(Key::SoftMin), limit_deg(Key::SoftMax)];
    let mut at: Option<ArmAngles> = None;
    plan.poses.retain(|pose| {
        let Some(from) = at else {
            at = Some(axes(pose));
            return true;
        };
        let mut to = axes(pose);
        for (to, from) in to.iter_mut().zip(from) {
            to[1] = nearest_turn_deg(from[1], to[1], limits_deg).unwrap_or(to[1]);
        }
        let Some(legs) = way(&from, &to, keep_out_deg) else {
            out_of_reach += 1;
            return false;
        };
        rounds += usize::from(legs.len() > 1);
        travel_s += SETTLE_TIME_S * (legs.len() - 1) as f64;
        travel_s += [from]
            .iter()
            .chain(&legs)
            .zip(&legs)
            .map(|(a, b)| leg_time_s(a, b))
            .sum::<f64>();
        at = Some(to);
        true
    });
    plan.travel_s = travel_s;
    // They are of all the poses.
    plan.others = None;
    KeptApart {
        too_near,
        out_of_reach,
        rounds,
    }
}

/// The slowest of four axes.
fn leg_time_s(from: &ArmAngles, to: &ArmAngles) -> f64 {
    from.iter()
        .zip(to)
        .flat_map(|(from, to)| {
            [(Axis::Theta, 0), (Axis::Phi, 1)].map(|(axis, i)| move_time_s(axis, from[i], to[i]))
        })
        .fold(0.0, f64::max)
}

/// How long an arm takes from one direction to another: its slower axis, φ the shorter way round.
fn arm_time_s(from: Direction, to: Direction) -> f64 {
    let turn = (to.phi_deg() - from.phi_deg() + 180.0).rem_euclid(360.0) - 180.0;
    let theta = move_time_s(Axis::Theta, from.theta_deg(), to.theta_deg());
    theta.max(move_time_s(Axis::Phi, 0.0, turn))
}
