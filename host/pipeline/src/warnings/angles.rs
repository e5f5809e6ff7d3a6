//! Warnings about the unit of angles: radians for degrees.

use super::{SAMPLES, some};
use crate::Error;
use gonia_brdf::Sample;
use gonia_rig::Remark;
use rayon::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Room for rounding in a file, radians.
const ROUNDING: f32 = 1e-3;
/// So many different angles are no few that happen to be small.
const MANY_ANGLES: usize = 6;

/// Looks for angles in radians. A remark where only the azimuths seem to be.
///
/// Polar angles all within π/2 degrees of the normal, and many of them, are nothing that anyone measures: nearly
/// all of a dense BRDF would be extrapolated from them. Azimuths that keep within 2π degrees, and come
/// near 2π or −π, may be a narrow scan: they are only remarked on.
///
/// # Errors
/// Polar angles in radians.
pub(super) fn in_radians(samples: &[Sample]) -> Result<Option<Remark>, Error> {
    let largest =
        |angle: fn(&Sample) -> f32| samples.par_iter().map(angle).reduce(|| 0.0f32, f32::max);
    let polar = largest(|s| s.theta_i_deg.max(s.theta_v_deg));
    if polar <= FRAC_PI_2 + ROUNDING {
        let count = different(samples, |s| [s.theta_i_deg, s.theta_v_deg]);
        if count < MANY_ANGLES {
            return Ok(None);
        }
        return Err(Error::Contradicted {
            what: format!(
                "no polar angle is above {polar:.4} and there are {count} different ones: they are radians, not degrees"
            ),
            remedy: "multiply the angles by 180/pi".into(),
        });
    }
    // Azimuths were wrapped as degrees.
    let azimuth = largest(|s| size(s.phi_i_deg).max(size(s.phi_v_deg)));
    let count = different(samples, |s| [s.phi_i_deg, s.phi_v_deg]);
    if !(PI - 0.2..=TAU + ROUNDING).contains(&azimuth) || count < 2 * MANY_ANGLES {
        return Ok(None);
    }
    Ok(Some(Remark::new(
        SAMPLES,
        format_args!(
            "polar angles reach {polar:.1} degrees, but of {count} different azimuths none is beyond {azimuth:.4}: they look like radians"
        ),
        "if they are, multiply the azimuths by 180/pi",
    )))
}

fn size(phi_deg: f32) -> f32 {
    phi_deg.min(360.0 - phi_deg).abs()
}

/// How many different angles some thousand samples have.
fn different(samples: &[Sample], angles: fn(&Sample) -> [f32; 2]) -> usize {
    let mut all: Vec<f32> = some(samples, 5000).into_iter().flat_map(angles).collect();
    all.sort_by(f32::total_cmp);
    all.dedup();
    all.len()
}
