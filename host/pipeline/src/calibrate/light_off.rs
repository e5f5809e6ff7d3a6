//! How far a rig's light is from where the shading on a known reference puts it.

use crate::calibrate::camera::covariance_of;
use crate::calibrate::light::{nominal, solve_light, unlike, with_target};
use crate::calibrate::median;
use crate::calibrate::numbers::{Spread, changes, direction_u};
use crate::calibrate::shading::{
    ReferenceShape, ShadedFrame, Shading, ln_intensity, target_unknowns, thin,
};
use crate::calibrate::unknowns::{LIGHT, TARGET, with_values};
use gonia_brdf::Pose;
use gonia_rig::{Rig, Role};

/// By how much directions of the light are off, degrees, over the frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightOff {
    /// Between the rig's light and the one that shading shows.
    pub off: Spread,
    /// The standard uncertainty of that.
    pub u: Spread,
}

/// Where shading on a known reference shows the light, against where the rig has it. The target's height and
/// tilts are free too, within what is known of them: what shading shows is the light over the reference.
/// `poses` are the frames'. `None` where the frames do not determine it, or the reference does not scatter as
/// the rig says.
pub fn light_off(rig: &Rig, poses: &[Pose], mut frames: Vec<ShadedFrame>) -> Option<LightOff> {
    thin(&mut frames, ReferenceShape::Known);
    let shading = Shading {
        rig,
        frames: &frames,
        shape: ReferenceShape::Known,
        mirror: None,
    };
    let nominal = nominal(rig, ln_intensity(rig, &frames), ReferenceShape::Known);
    let mut prior = with_target(rig, ReferenceShape::Known);
    for (prior, unknown) in prior[LIGHT.len()..].iter_mut().zip(target_unknowns()) {
        if let Some(u) = calibrated_u(rig, unknown.name) {
            *prior = u;
        }
    }
    let free = vec![true; prior.len()];
    let first = solve_light(&shading, &nominal, &prior, &free, (None, None)).ok()?;
    let typical = median(frames.iter().map(ShadedFrame::noise).collect());
    if unlike(&first, typical, Role::Reference).is_some() {
        return None;
    }
    let (moved, all) = (LIGHT.len() + TARGET, first.shared);
    let covariance = covariance_of(&first.information, &prior).ok()?;
    let covariance = covariance.view((0, 0), (moved, moved)).into_owned();
    let unknowns = [&LIGHT[..], target_unknowns()];
    let found = with_values(&LIGHT, rig, &all[..LIGHT.len()]);
    let found = with_values(target_unknowns(), &found, &all[LIGHT.len()..moved]);
    Some(LightOff {
        off: changes(rig, &found, poses)[0],
        u: direction_u(rig, &unknowns, &all[..moved], &covariance, poses)[0],
    })
}

/// The standard uncertainty of a number of a calibrated rig.
fn calibrated_u(rig: &Rig, name: &str) -> Option<f64> {
    let calibration = rig.calibration.as_ref()?;
    let at = calibration.names.iter().position(|n| n == name)?;
    calibration.u.get(at).copied().filter(|u| *u > 0.0)
}
