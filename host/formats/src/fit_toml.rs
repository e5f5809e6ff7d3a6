//! A fitted model as a file beside its dense EXR: `kurt2.exr` has `kurt2.fit.toml`.

use crate::{FileError, toml_text, write_whole_bytes};
use gonia_brdf::fit::{FittedModel, ModelFamily};
use gonia_rig::Figures;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What the name of every such file ends with.
const ENDING: &str = ".fit.toml";

/// A fit, its numbers and how far it is from what it was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitNote {
    /// The model's name.
    pub model: String,
    /// Whether the search came to its end. If not, this is the best so far.
    pub converged: bool,
    /// Root mean square of the residuals.
    pub residual_rms: f64,
    /// Cells it was fitted to.
    pub cells: u64,
    /// Seconds the search took.
    pub seconds: f64,
    /// Checksum of the values of the dense BRDF that it was fitted to, see
    /// [`checksum::of_brdf`](crate::checksum::of_brdf); absent in notes of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dense: Option<String>,
    /// The model's numbers.
    pub parameters: Vec<FittedNumber>,
    /// The model against what it was fitted to.
    pub figures: Figures,
}

/// One number of a fitted model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedNumber {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard uncertainty; absent where the data do not determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<f64>,
    /// Its unit, empty for a pure number.
    pub unit: String,
    /// Whether it lies on a bound of its range.
    pub at_bound: bool,
}

impl FitNote {
    /// The note of a fit.
    pub fn new<F: ModelFamily + std::fmt::Display>(
        fit: &FittedModel<F>,
        seconds: f64,
        figures: Figures,
    ) -> Self {
        let numbers = fit.family.parameters().into_iter().enumerate();
        Self {
            model: fit.family.to_string(),
            converged: fit.converged,
            residual_rms: fit.residual_rms,
            cells: fit.cells as u64,
            seconds,
            dense: None,
            parameters: numbers
                .map(|(k, p)| FittedNumber {
                    value: fit.values[k],
                    uncertainty: fit.uncertainties[k],
                    unit: p.unit.to_owned(),
                    at_bound: !p.is_amplitude && p.range.is_at_bound(fit.values[k]),
                    name: p.name,
                })
                .collect(),
            figures,
        }
    }

    /// The note's place beside a dense EXR.
    pub fn path_beside(dense: &Path) -> PathBuf {
        let name = dense.file_stem().unwrap_or_default().to_string_lossy();
        dense.with_file_name(format!("{name}{ENDING}"))
    }

    /// Reads a note.
    ///
    /// # Errors
    /// One line naming the file and the line: unreadable, not TOML, or an unknown or missing key.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        toml_text::read(path, "make it again with gonia fit")
    }

    /// All notes of a folder with their files, by name; none where the folder cannot be listed.
    ///
    /// # Errors
    /// As [`FitNote::read`].
    pub fn read_all(folder: &Path) -> Result<Vec<(PathBuf, Self)>, FileError> {
        let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
            .into_iter()
            .flatten()
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.to_string_lossy().ends_with(ENDING))
            .collect();
        paths.sort();
        let read = |path: PathBuf| Self::read(&path).map(|note| (path, note));
        paths.into_iter().map(read).collect()
    }

    /// Writes the note whole.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let text = toml::to_string(self)
            .map_err(|error| FileError::new(path, error, "check the fit's values"))?;
        write_whole_bytes(path, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note() -> FitNote {
        FitNote {
            model: "kurt2".into(),
            converged: true,
            residual_rms: 0.1,
            cells: 12_000,
            seconds: 2.5,
            dense: Some("e3069283".into()),
            parameters: vec![FittedNumber {
                name: "mx1".into(),
                value: 0.14,
                uncertainty: None,
                unit: String::new(),
                at_bound: false,
            }],
            figures: Figures {
                a: "kurt2".into(),
                b: "dense".into(),
                cells_total: 1,
                cells_compared: 1,
                cells_colour: 0,
                floored_a: 0,
                floored_b: 0,
                factor: None,
                sphere_delta_e: 1.0,
                cylinder_delta_e: 2.0,
                strata: Vec::new(),
            },
        }
    }

    #[test]
    fn a_note_is_found_beside_its_exr_and_read_as_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = FitNote::path_beside(&dir.path().join("kurt2.exr"));
        assert!(path.ends_with("kurt2.fit.toml"));
        note().write(&path).unwrap();
        assert_eq!(
            FitNote::read_all(dir.path()),
            Ok(vec![(path.clone(), note())])
        );
        std::fs::write(&path, "model = 3").unwrap();
        let error = FitNote::read_all(dir.path()).unwrap_err().to_string();
        assert!(error.contains("kurt2.fit.toml, line 1"), "{error}");
    }
}
