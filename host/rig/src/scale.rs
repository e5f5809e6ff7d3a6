//! What the values of a BRDF mean.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Whether values are 1/sr.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// In 1/sr: the reference's reflectance was known.
    Absolute,
    /// Up to one factor: nothing of known reflectance was measured.
    Relative,
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Scale::Absolute => "absolute",
            Scale::Relative => "relative",
        })
    }
}
