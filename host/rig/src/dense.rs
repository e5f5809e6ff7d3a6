//! A dense BRDF with what is known about it.

use crate::Scale;
use gonia_brdf::DenseBrdf;
use std::collections::BTreeMap;

/// A dense BRDF with what its file says about it.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseFile {
    /// The values.
    pub brdf: DenseBrdf,
    /// Whether they are 1/sr. A file made by others that does not say counts as relative.
    pub scale: Scale,
    /// Where the data came from, by name; in the file every name begins with `gonia.`.
    pub provenance: BTreeMap<String, String>,
}
