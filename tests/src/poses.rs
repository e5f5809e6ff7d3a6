//! Lists of poses, and how far an arm truly was from one.

use gonia_brdf::direction::angle_between;
use gonia_brdf::{Direction, Pose};

/// Poses all over the hemisphere, with steps of every size and both signs.
pub fn scattered(n: usize) -> Vec<Pose> {
    let pose = |i: usize| {
        let f = i as f64;
        Pose {
            light: Direction::from_deg((f * 23.0) % 86.0, f * 47.0),
            view: Direction::from_deg((f * 11.0) % 76.0, 360.0 - f * 15.0),
        }
    };
    (0..n).map(pose).collect()
}

/// The paper's 8505 poses: for each view all lights, to and fro.
pub fn of_the_paper() -> Vec<Pose> {
    let sattler = [
        (0.0, 1),
        (15.0, 6),
        (30.0, 12),
        (45.0, 18),
        (60.0, 20),
        (75.0, 24),
    ];
    let views = rings(&sattler);
    let mut lights = rings(&[&sattler[..], &[(85.0, 24)]].concat());
    let mut poses = Vec::new();
    for view in views {
        poses.extend(lights.iter().map(|&light| Pose { light, view }));
        lights.reverse();
    }
    poses
}

/// Rings of θ with equal steps in φ, every second ring backwards.
fn rings(rings: &[(f64, usize)]) -> Vec<Direction> {
    let mut directions = Vec::new();
    for (i, &(theta, n)) in rings.iter().enumerate() {
        let mut ring: Vec<_> = (0..n)
            .map(|k| Direction::from_deg(theta, 360.0 / n as f64 * k as f64))
            .collect();
        if i % 2 == 1 {
            ring.reverse();
        }
        directions.extend(ring);
    }
    directions
}

/// The largest angle between commanded and true directions of light and view, degrees.
pub fn true_error_deg(commanded: &Pose, truth: &Pose) -> f64 {
    let angle = |a: Direction, b: Direction| angle_between(a.to_vec3(), b.to_vec3()).to_degrees();
    angle(commanded.light, truth.light).max(angle(commanded.view, truth.view))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_papers_poses_are_8505() {
        assert_eq!(super::of_the_paper().len(), 8505);
    }
}
