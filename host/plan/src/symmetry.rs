//! The poses that a known symmetry of the material spares.
//!
//! A material that looks the same turned by half a turn, or from the other side of a plane, need not be measured
//! twice: of each set of poses that the symmetry makes one of another, one is kept. Where the rings of a plan are not
//! symmetric themselves, those are kept whose light lies in the part of the azimuths that the symmetry maps to all.

use gonia_brdf::direction::wrap_deg;
use gonia_brdf::{Direction, Pose, SymmetryKind};

/// Azimuths nearer than this to a border lie on it, degrees.
const ON: f64 = 1e-6;

/// Whether a pose is left to measure of a material with a symmetry, whose plane has the azimuth `plane_deg` where it
/// has one. Of an isotropic material light comes from azimuth 0, and is seen from all around, so that its two sides
/// can be found to differ.
pub fn is_needed(pose: &Pose, symmetry: SymmetryKind, plane_deg: f64) -> bool {
    // Light from the normal has no azimuth: the view's decides.
    let at_pole = |d: Direction| d.theta_deg() < ON;
    let azimuth = |d: Direction, from_deg: f64| {
        let azimuth = wrap_deg(d.phi_deg() - from_deg);
        if 360.0 - azimuth < ON { 0.0 } else { azimuth }
    };
    let (first, second) = match (at_pole(pose.light), at_pole(pose.view)) {
        (true, true) => return true,
        (true, false) => (pose.view, None),
        (false, true) => (pose.light, None),
        (false, false) => (pose.light, Some(pose.view)),
    };
    // A direction on the plane is its own image: the other one decides.
    let within = |from_deg: f64, width_deg: f64| azimuth(first, from_deg) <= width_deg + ON;
    let other_within = |plane_deg: f64| {
        let off = azimuth(first, plane_deg).rem_euclid(180.0);
        let is_on = off.min(180.0 - off) < ON;
        !is_on || second.is_none_or(|second| azimuth(second, plane_deg) <= 180.0 + ON)
    };
    match symmetry {
        SymmetryKind::None => true,
        SymmetryKind::HalfTurn => azimuth(first, 0.0) < 180.0 - ON,
        SymmetryKind::Bilateral => within(plane_deg, 180.0) && other_within(plane_deg),
        SymmetryKind::HalfTurnBilateral => {
            within(plane_deg, 90.0) && other_within(plane_deg) && other_within(plane_deg + 90.0)
        }
        SymmetryKind::Isotropic => azimuth(first, 0.0) < ON,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rings;

    fn needed(poses: &[Pose], symmetry: SymmetryKind, plane_deg: f64) -> Vec<Pose> {
        let needed = |pose: &&Pose| is_needed(pose, symmetry, plane_deg);
        poses.iter().filter(needed).copied().collect()
    }

    /// Azimuths of light and view after each map of a symmetry with a plane at azimuth 0.
    fn images(symmetry: SymmetryKind, [i, v]: [f64; 2]) -> Vec<[f64; 2]> {
        let (turned, mirrored) = ([i + 180.0, v + 180.0], [-i, -v]);
        match symmetry {
            SymmetryKind::HalfTurn => vec![[i, v], turned],
            SymmetryKind::Bilateral => vec![[i, v], mirrored],
            SymmetryKind::HalfTurnBilateral => {
                vec![[i, v], turned, mirrored, [180.0 - i, 180.0 - v]]
            }
            _ => vec![[i, v]],
        }
    }

    /// A pose as whole numbers; a pole has no azimuth.
    fn key(pose: &Pose, [i, v]: [f64; 2]) -> [i64; 4] {
        let milli = |x: f64| (1000.0 * x).round() as i64;
        let of = |d: Direction, phi: f64| {
            let phi = milli(wrap_deg(phi)) % 360_000;
            [
                milli(d.theta_deg()),
                if d.theta_deg() < ON { 0 } else { phi },
            ]
        };
        let ([a, b], [c, d]) = (of(pose.light, i), of(pose.view, v));
        [a, b, c, d]
    }

    #[test]
    fn of_poses_that_a_symmetry_makes_one_of_another_one_is_kept() {
        let all = Rings::paper().listed();
        for (symmetry, expected) in [
            (SymmetryKind::None, 8505),
            (SymmetryKind::HalfTurn, 4253),
            (SymmetryKind::Bilateral, 4324),
            (SymmetryKind::HalfTurnBilateral, 2178),
        ] {
            let kept = needed(&all, symmetry, 0.0);
            let mut seen = std::collections::BTreeSet::new();
            for pose in &kept {
                let azimuths = [pose.light.phi_deg(), pose.view.phi_deg()];
                let mut orbit: Vec<_> = images(symmetry, azimuths)
                    .into_iter()
                    .map(|image| key(pose, image))
                    .collect();
                orbit.sort_unstable();
                orbit.dedup();
                for image in orbit {
                    assert!(seen.insert(image), "{symmetry:?}: twice {image:?}");
                }
            }
            assert_eq!(seen.len(), all.len(), "{symmetry:?}");
            assert_eq!(kept.len(), expected, "{symmetry:?}");
        }
    }

    #[test]
    fn of_an_isotropic_material_light_has_one_azimuth_and_is_seen_from_all_around() {
        let kept = needed(&Rings::paper().listed(), SymmetryKind::Isotropic, 0.0);
        // Six rings of light with 81 views, and light from the normal with one view a ring.
        assert_eq!(kept.len(), 6 * 81 + 6);
        assert!(kept.iter().all(|pose| pose.light.phi_deg() == 0.0));
    }

    #[test]
    fn a_plane_at_any_azimuth_and_rings_of_odd_numbers_leave_about_a_quarter() {
        for plane_deg in [23.0, 113.0, -67.0] {
            let all = Rings::quick().listed();
            let kept = needed(&all, SymmetryKind::HalfTurnBilateral, plane_deg);
            let share = kept.len() as f64 / all.len() as f64;
            assert!((0.2..0.32).contains(&share), "{plane_deg}: {share}");
            let half = needed(&all, SymmetryKind::HalfTurn, plane_deg).len() as f64;
            assert!((half / all.len() as f64 - 0.5).abs() < 0.07, "{half}");
        }
    }
}
