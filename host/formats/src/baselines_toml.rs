//! `rivals.toml`: how the baselines, other ways to the same BRDF, compare, as `gonia rivals` found.

use crate::{FileError, toml_text, write_whole_bytes};
use gonia_rig::Figures;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// All that were compared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaselineTable {
    /// Checksum of the values of the dense BRDF that they were compared with, see
    /// [`checksum::of_brdf`](crate::checksum::of_brdf); absent in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dense: Option<String>,
    /// One a baseline, in the order of the table.
    pub rows: Vec<BaselineRow>,
}

/// One baseline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaselineRow {
    /// Its name.
    pub name: String,
    /// What it is made of, in a few words.
    pub what: String,
    /// Numbers that it takes to keep it: samples, values or parameters.
    pub numbers: u64,
    /// Seconds to make it from the samples (of the whole, where only a share of the cells was done).
    pub seconds: f64,
    /// Against the dense measurement; absent for that itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against_dense: Option<Figures>,
    /// Against the truth, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against_truth: Option<Figures>,
    /// Whether only a share of the cells was computed: then its pictures are missing.
    pub is_partial: bool,
}

impl BaselineTable {
    /// Reads a comparison.
    ///
    /// # Errors
    /// One line naming the file and the line: unreadable, not TOML, or an unknown or missing key.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        toml_text::read(path, "make it again with gonia rivals")
    }

    /// Writes it whole.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let text = toml::to_string(self)
            .map_err(|error| FileError::new(path, error, "check the comparison's values"))?;
        write_whole_bytes(path, text.as_bytes())
    }
}
