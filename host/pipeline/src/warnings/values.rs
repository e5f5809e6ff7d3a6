//! Warnings about values: at or below zero.

use super::SAMPLES;
use crate::Error;
use gonia_brdf::Sample;
use gonia_rig::Remark;
use rayon::prelude::*;

/// However large the noise, more than half of the samples are above zero; this leaves room for chance.
const MOST: f64 = 0.6;
/// A few values below zero are the noise of dark directions; above this share they are remarked on.
const SOME: f64 = 0.01;

/// Counts values at or below zero, by channel.
///
/// # Errors
/// Most values of every channel: no noise does that.
pub(super) fn not_positive(samples: &[Sample]) -> Result<Option<Remark>, Error> {
    let n = samples.len();
    let counts = samples
        .par_iter()
        .map(|s| s.rgb.map(|v| usize::from(v <= 0.0)))
        .reduce(|| [0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
    let share = |count: usize| count as f64 / n.max(1) as f64;
    let (least, most) = (counts.map(share), counts.into_iter().max().unwrap_or(0));
    if n > 0 && least.iter().all(|share| *share > MOST) {
        return Err(Error::Contradicted {
            what: format!("{most} of {n} samples are not above zero, which no BRDF is"),
            remedy: "check the sign of the values and the dark level that was subtracted".into(),
        });
    }
    if share(most) <= SOME {
        return Ok(None);
    }
    let [r, g, b] = counts;
    let counted = if r == g && g == b {
        format!("{r} of {n} samples are not above zero")
    } else {
        format!("of {n} samples {r} (R), {g} (G), {b} (B) are not above zero")
    };
    Ok(Some(Remark::new(
        SAMPLES,
        format_args!("{counted}: noise as large as the signal, a dark level too high, or a sign"),
        "check the sign and the dark level, or average more exposures",
    )))
}
