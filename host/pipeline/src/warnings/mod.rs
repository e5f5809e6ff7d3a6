//! Whether samples are what they are taken for: what in them speaks against degrees, against polar angles from
//! the normal, against values of a BRDF, against a signal above the noise, and against directions all
//! over two hemispheres.
//!
//! Every warning has its evidence in the samples themselves; of what they cannot tell there is none. Sound samples
//! draw no remark.

mod angles;
mod energy;
mod layout;
mod reciprocity;
mod surface;
mod symmetry;
mod values;

pub use energy::DirectionalAlbedo;
pub(crate) use energy::{AlbedoRows, remark as remark_on_energy, ring_weights};
pub(crate) use layout::{Isotropy, remark as remark_on_layout};
pub(crate) use symmetry::{
    remark_on_assumed as remark_on_assumed_isotropy, remarks as remarks_on_symmetry,
};

use crate::Error;
use gonia_brdf::{Bins, Sample};
use gonia_rig::{Oddities, Oddity, Remark};

/// What is to be said of samples before they are binned.
///
/// # Errors
/// Angles in radians, or values that are mostly not positive.
pub(crate) fn of_samples(samples: &[Sample]) -> Result<Vec<Remark>, Error> {
    let mut remarks: Vec<Remark> = angles::in_radians(samples)?.into_iter().collect();
    remarks.extend(values::not_positive(samples)?);
    Ok(remarks)
}

/// What is to be said of them once they are in bins.
pub(crate) fn of_bins(samples: &[Sample], bins: &Bins) -> Vec<Remark> {
    // A cosine in the values makes them less smooth in any reading of the angles.
    reciprocity::cosine_factor(samples, bins)
        .or_else(|| surface::remark(samples))
        .into_iter()
        .collect()
}

/// Where a remark on samples stands.
const SAMPLES: &str = "samples";

/// What is to be said of samples that were left out or turned: those of a file are sorted out, and remarked on, as
/// they are read.
pub(crate) fn of_oddities(odd: &Oddities) -> Vec<Remark> {
    let left_out = "leave such samples out, or give polar angles from 0 to 90 and finite values";
    let kinds: [(&Oddity, &str, &str); 4] = [
        (
            &odd.not_finite,
            "hold a number that is not finite and are left out",
            left_out,
        ),
        (
            &odd.below,
            "lie below the horizon and are left out",
            left_out,
        ),
        (
            &odd.no_angle,
            "have a polar angle beyond 180 degrees and are left out",
            left_out,
        ),
        (
            &odd.signed,
            "have a negative polar angle and are taken for the same angle at azimuth + 180 degrees",
            "give polar angles from 0 to 90",
        ),
    ];
    kinds
        .into_iter()
        .filter(|(oddity, ..)| oddity.count > 0)
        .map(|(oddity, what, remedy)| {
            let first = oddity.first.as_ref().map_or("", |(_, first)| first);
            Remark::new(
                SAMPLES,
                format_args!(
                    "{} of {} {what}, the first with {first}",
                    oddity.count, odd.samples
                ),
                remedy,
            )
        })
        .collect()
}

/// At most so many of them, evenly, for what needs no more.
fn some(samples: &[Sample], at_most: usize) -> Vec<&Sample> {
    let step = samples.len().div_ceil(at_most).max(1);
    samples.iter().step_by(step).collect()
}
