//! Samples with their scale.

use crate::Scale;
use gonia_brdf::Sample;

/// Samples of one material, in the order of their frames, with the scale that they share.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleSet {
    /// The samples.
    pub samples: Vec<Sample>,
    /// Whether their values are 1/sr.
    pub scale: Scale,
}
