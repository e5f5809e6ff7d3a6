//! Which frames a calibration looks at: a measurement has thousands, and a few hundred say all.

use gonia_brdf::Pose;
use gonia_brdf::direction::dot;
use gonia_rig::{FrameRow, Role};

/// Frames of the reference, of the material and of a mirror at most.
const MOST: [(Role, usize); 3] = [
    (Role::Reference, 130),
    (Role::Material, 70),
    (Role::Mirror, 60),
];

/// The frames to look at, in their order: those of the reference first, poses far from each other.
pub fn chosen(rows: &[FrameRow]) -> Vec<FrameRow> {
    let of = |(role, most): (Role, usize)| {
        let some: Vec<FrameRow> = rows.iter().filter(|r| r.role == role).cloned().collect();
        (some, most)
    };
    let [(reference, r), (material, m), (mirror, most)] = MOST.map(of);
    // Without a reference the material's frames are all there is.
    let m = if reference.is_empty() { r } else { m };
    let mut all = spread(&reference, r);
    all.extend(spread(&material, m));
    all.extend(spread(&mirror, most));
    all
}

/// At most so many frames, each as far as can be from those before it (by light and view together).
pub fn spread(rows: &[FrameRow], most: usize) -> Vec<FrameRow> {
    let poses: Vec<Pose> = rows.iter().map(|row| row.pose).collect();
    let picked = spread_poses(&poses, most);
    picked.into_iter().map(|i| rows[i].clone()).collect()
}

/// The places of at most so many poses, in their order, each as far as can be from those chosen before it (by
/// light and view together): those that a calibration takes.
pub fn spread_poses(poses: &[Pose], most: usize) -> Vec<usize> {
    if poses.len() <= most {
        return (0..poses.len()).collect();
    }
    let places: Vec<[[f64; 3]; 2]> = poses
        .iter()
        .map(|pose| [pose.light.to_vec3(), pose.view.to_vec3()])
        .collect();
    let mut distance = vec![f64::INFINITY; poses.len()];
    let mut next = 0;
    let mut picked = Vec::with_capacity(most);
    while picked.len() < most {
        picked.push(next);
        for (place, least) in places.iter().zip(&mut distance) {
            let apart = [0, 1].map(|i| 1.0 - dot(place[i], places[next][i]));
            *least = least.min(apart[0] + apart[1]);
        }
        // A pose that is there twice: the first of those that are as far.
        let mut furthest = (0, f64::NEG_INFINITY);
        for (i, d) in distance.iter().enumerate() {
            if *d > furthest.1 && !picked.contains(&i) {
                furthest = (i, *d);
            }
        }
        next = furthest.0;
    }
    picked.sort_unstable();
    picked
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_spread_over_poses_and_both_roles_have_their_share() {
        let rows: Vec<FrameRow> = (0..1000)
            .flat_map(|i| {
                let k = f64::from(i);
                let pose = Pose::from_deg([k % 7.0 * 12.0, k, k % 11.0 * 6.0, 3.0 * k]);
                [Role::Reference, Role::Material].map(|role| FrameRow {
                    frame: i as u32,
                    role,
                    pose,
                    file: String::new(),
                })
            })
            .collect();
        let some = chosen(&rows);
        assert_eq!(some.len(), 200);
        let thetas: Vec<i64> = some
            .iter()
            .map(|r| r.pose.view.theta_deg().round() as i64)
            .collect();
        for theta in [0, 30, 60] {
            assert!(
                thetas.iter().filter(|t| **t == theta).count() >= 4,
                "{theta}"
            );
        }
        assert_eq!(chosen(&rows[..10]).len(), 10);
        let alone: Vec<FrameRow> = rows
            .into_iter()
            .filter(|r| r.role == Role::Material)
            .collect();
        assert_eq!(chosen(&alone).len(), 130);
    }
}
