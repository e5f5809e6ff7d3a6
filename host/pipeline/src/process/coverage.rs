//! Whether an unknown reference was measured where eq. (3) needs it.

use gonia_brdf::direction::angle_between;
use gonia_brdf::{Direction, Pose};

/// Fewest poses from which the reference's central values are interpolated.
const FEWEST_POSES: usize = 60;
/// Widest hole between the reference's lights, or views, degrees.
const WIDEST_HOLE_DEG: f64 = 40.0;
/// Polar angle up to which the hemisphere must be covered, degrees.
const COVERED_THETA_DEG: f64 = 60.0;
/// Largest share of the material's frames that may be without a reference.
const LARGEST_SHARE_MISSING: f64 = 0.1;

/// Why eq. (3) cannot be applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CoverageError {
    /// The material was measured at poses where the reference was not.
    #[error(
        "{missing} of {total} frames of the material have no frame of the reference at their pose (the first is frame {first}): measure the reference over the whole plan, or give its albedo as [reference] reflectance in rig.toml"
    )]
    MissingPoses {
        /// Frames without a reference.
        missing: usize,
        /// Frames of the material.
        total: usize,
        /// The first of them.
        first: u32,
    },
    /// The reference was measured at too few poses.
    #[error(
        "the reference's centre was seen at {poses} poses, and eq. (3) interpolates between at least {FEWEST_POSES}: measure the reference over the whole plan, or give its albedo as [reference] reflectance in rig.toml"
    )]
    TooFewPoses {
        /// Poses at which the reference's centre was seen.
        poses: usize,
    },
    /// The reference's poses leave a hole.
    #[error(
        "no {which} of the reference's frames is within {hole_deg:.0} degrees of theta {theta_deg:.0}, phi {phi_deg:.0}, and eq. (3) interpolates over at most {WIDEST_HOLE_DEG}: measure the reference over the whole plan, or give its albedo as [reference] reflectance in rig.toml"
    )]
    Hole {
        /// "light" or "view".
        which: &'static str,
        /// Distance of the nearest.
        hole_deg: f64,
        /// Polar angle of the hole's middle.
        theta_deg: f64,
        /// Azimuth of the hole's middle.
        phi_deg: f64,
    },
}

/// Refuses a reference that was not measured at the material's poses. `matched` tells for each
/// frame of the material its number and whether it has a reference.
pub fn check_matches(matched: &[(u32, bool)]) -> Result<(), CoverageError> {
    let mut without = matched.iter().filter(|m| !m.1);
    let Some((first, _)) = without.next() else {
        return Ok(());
    };
    let missing = 1 + without.count();
    if missing as f64 <= LARGEST_SHARE_MISSING * matched.len() as f64 {
        return Ok(());
    }
    Err(CoverageError::MissingPoses {
        missing,
        total: matched.len(),
        first: *first,
    })
}

/// Refuses central values that do not cover the hemisphere.
pub fn check_central(poses: &[Pose]) -> Result<(), CoverageError> {
    if poses.len() < FEWEST_POSES {
        return Err(CoverageError::TooFewPoses { poses: poses.len() });
    }
    check_holes("light", poses.iter().map(|p| p.light))?;
    check_holes("view", poses.iter().map(|p| p.view))
}

fn check_holes(
    which: &'static str,
    measured: impl Iterator<Item = Direction>,
) -> Result<(), CoverageError> {
    let measured: Vec<_> = measured.map(Direction::to_vec3).collect();
    let step = 15.0;
    let rings = (COVERED_THETA_DEG / step) as usize;
    for (ring, turn) in (0..=rings).flat_map(|r| (0..24).map(move |t| (r, t))) {
        let d = Direction::from_deg(ring as f64 * step, turn as f64 * step);
        let at = d.to_vec3();
        let hole_deg = measured
            .iter()
            .map(|m| angle_between(*m, at))
            .fold(f64::INFINITY, f64::min)
            .to_degrees();
        if hole_deg > WIDEST_HOLE_DEG {
            return Err(CoverageError::Hole {
                which,
                hole_deg,
                theta_deg: d.theta_deg(),
                phi_deg: d.phi_deg(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rings(phi_end: usize) -> Vec<Pose> {
        let all: Vec<_> = [0.0, 30.0, 60.0]
            .into_iter()
            .flat_map(|t| {
                (0..phi_end)
                    .step_by(45)
                    .map(move |p| Direction::from_deg(t, p as f64))
            })
            .collect();
        all.iter()
            .flat_map(|light| {
                all.iter().map(|view| Pose {
                    light: *light,
                    view: *view,
                })
            })
            .collect()
    }

    #[test]
    fn a_hole_is_named() {
        assert_eq!(check_central(&rings(360)), Ok(()));
        let error = check_central(&rings(180)).unwrap_err();
        assert!(matches!(error, CoverageError::Hole { which: "light", .. }));
        assert!(error.to_string().contains("reflectance in rig.toml"));
        assert_eq!(
            check_central(&rings(360)[..59]),
            Err(CoverageError::TooFewPoses { poses: 59 })
        );
    }

    #[test]
    fn few_missing_references_are_borne_and_many_are_not() {
        let mut matched: Vec<_> = (0..20).map(|i| (i, i != 7)).collect();
        assert_eq!(check_matches(&matched), Ok(()));
        for m in &mut matched[10..] {
            m.1 = false;
        }
        let error = check_matches(&matched).unwrap_err();
        assert_eq!(
            error,
            CoverageError::MissingPoses {
                missing: 11,
                total: 20,
                first: 7
            }
        );
    }
}
