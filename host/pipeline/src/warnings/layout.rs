//! Which part of the two hemispheres samples cover: three-angle data and scans in one plane look like a
//! BRDF of four angles, of which they hold a slice.

use super::SAMPLES;
use gonia_brdf::Elementary;
use gonia_brdf::Sample;
use gonia_brdf::interpolate::OriginCounts;
use gonia_rig::Remark;
use rayon::prelude::*;

/// What a fill takes of a material's isotropy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Isotropy {
    /// It depends on the azimuth, or no one has looked.
    No,
    /// Isotropic, though samples of one azimuth cannot show it.
    Assumed,
    /// Isotropic, because it was asked for.
    Asked,
    /// Isotropic, as samples of several azimuths agree.
    Shown,
}

/// Directions within this are the same, degrees: arms do not stop exactly.
const SAME_DEG: f32 = 1.0;
/// Where more cells than this are extrapolated, it is said, whatever the samples look like.
const MOSTLY: f64 = 0.5;

/// Which slice of the four angles the samples are, and how much of the grid it leaves to guess.
pub(crate) fn remark(
    samples: &[Sample],
    origins: &OriginCounts,
    isotropy: Isotropy,
) -> Option<Remark> {
    let guessed = 100.0 * origins.extrapolated_share();
    let follows = format!("{guessed:.1} % of the cells are extrapolated");
    let say = |what: String, remedy: &str| Some(Remark::new(SAMPLES, what, remedy));
    if samples.is_empty() {
        return None;
    }
    if one_direction(samples, |s| (s.theta_i_deg, s.phi_i_deg)) {
        return say(
            format!(
                "all have one direction of light: {follows}, and how values depend on the light was not measured"
            ),
            "measure more directions of light",
        );
    }
    if one_direction(samples, |s| (s.theta_v_deg, s.phi_v_deg)) {
        return say(
            format!(
                "all have one direction of view: {follows}, and how values depend on the view was not measured"
            ),
            "measure more directions of view",
        );
    }
    if samples.par_iter().all(in_plane) {
        let assumed = match isotropy {
            Isotropy::Assumed => "the material is assumed to be isotropic, ",
            _ => "",
        };
        return say(
            format!(
                "all lie in the plane of incidence: {assumed}{follows}, and values out of this plane were not measured"
            ),
            "measure views out of the plane of incidence; use the result within it only",
        );
    }
    let three_angles = [
        ("light", one_azimuth(samples)),
        (
            "view",
            one_azimuth_of(samples, |s| (s.theta_v_deg, s.phi_v_deg)),
        ),
    ];
    for (arm, azimuth) in three_angles {
        if let Some(azimuth) = azimuth {
            if isotropy == Isotropy::Assumed {
                return say(
                    format!(
                        "all have one azimuth of {arm}, {azimuth:.0} degrees, as three-angle data of isotropic materials have: the material is assumed to be isotropic, which nothing in them can show or contradict; {follows}"
                    ),
                    "if it is not isotropic, measure other azimuths; with --symmetry none these are extrapolated",
                );
            }
            if isotropy == Isotropy::Asked {
                return None;
            }
            return say(
                format!(
                    "all have one azimuth of {arm}, {azimuth:.0} degrees, as three-angle data of isotropic materials have: {follows}, and how values depend on the azimuth was not measured"
                ),
                "if the material is isotropic, add the samples turned about the normal to other azimuths; if not, measure these",
            );
        }
    }
    if origins.extrapolated_share() <= MOSTLY {
        return None;
    }
    say(
        format!("{follows}: they lie in gaps of the measured directions or beyond them"),
        "measure more directions; a cell's origin stands in the file of --error",
    )
}

/// The azimuth of all lights, degrees, where they have the same one; lights at the normal have any.
pub(super) fn one_azimuth(samples: &[Sample]) -> Option<f32> {
    one_azimuth_of(samples, |s| (s.theta_i_deg, s.phi_i_deg))
}

type Angles = fn(&Sample) -> (f32, f32);

fn one_azimuth_of(samples: &[Sample], angles: Angles) -> Option<f32> {
    let inclined = |(theta, _): &(f32, f32)| *theta > SAME_DEG;
    let (_, azimuth) = samples.iter().map(angles).find(inclined)?;
    let same = |(_, phi): (f32, f32)| apart(phi, azimuth) <= SAME_DEG;
    let all = samples
        .par_iter()
        .map(angles)
        .all(|direction| !inclined(&direction) || same(direction));
    all.then_some(azimuth)
}

fn one_direction(samples: &[Sample], angles: Angles) -> bool {
    let Some((theta, phi)) = samples.first().map(angles) else {
        return false;
    };
    samples.par_iter().map(angles).all(|(t, p)| {
        (t - theta).abs() <= SAME_DEG && apart(p, phi) * theta.to_radians().sine() <= SAME_DEG
    })
}

/// Whether light, normal and view lie in one plane.
fn in_plane(s: &Sample) -> bool {
    let smaller = s.theta_i_deg.min(s.theta_v_deg).to_radians().sine();
    let across = (s.phi_v_deg - s.phi_i_deg).to_radians().sine().abs();
    smaller * across <= SAME_DEG.to_radians()
}

fn apart(a: f32, b: f32) -> f32 {
    let difference = (a - b).rem_euclid(360.0);
    difference.min(360.0 - difference)
}
