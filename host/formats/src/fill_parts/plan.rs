//! What all processes of a fill start from, as JSON. Numbers stand as text, which comes back to the bit.

use crate::export::{channels_of, scale_of};
use crate::{FileError, write_whole_bytes};
use gonia_brdf::Grid;
use gonia_brdf::interpolate::{Coordinates, FillSettings, Matern32};
use gonia_rig::{Channels, Scale};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

/// A fill that is shared.
#[derive(Clone, Debug, PartialEq)]
pub struct FillPlan {
    /// What it is a fill of, and how: text that differs where one of them does.
    pub of: String,
    /// The grid.
    pub grid: Grid,
    /// The table's channels.
    pub channels: Channels,
    /// Its scale.
    pub scale: Scale,
    /// Its provenance.
    pub provenance: BTreeMap<String, String>,
    /// Which channels are filled together, group by group: one, three or 31 each.
    pub groups: Vec<Vec<usize>>,
    /// The settings of all groups, with the kernel that all fills have.
    pub settings: FillSettings,
}

#[derive(Serialize, Deserialize)]
struct Text {
    gonia: String,
    of: String,
    step_deg: String,
    channels: Vec<String>,
    scale: String,
    provenance: BTreeMap<String, String>,
    groups: Vec<Vec<usize>>,
    settings: BTreeMap<String, String>,
}

/// The settings' names in the file.
const NAMES: [&str; 14] = [
    "block_deg",
    "tolerance",
    "target_error",
    "budget",
    "neighbours",
    "neighbours_most",
    "one_bin_in",
    "exponent",
    "weight",
    "kernel_weight",
    "range",
    "noise_variance",
    "nugget_min",
    "beyond",
];

impl FillPlan {
    /// Writes it.
    ///
    /// # Errors
    /// The disk is full.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let s = &self.settings;
        let values = [
            s.block_deg.to_string(),
            s.tolerance.to_string(),
            s.target_error.to_string(),
            s.budget.to_string(),
            s.neighbours.to_string(),
            s.neighbours_most.to_string(),
            s.one_bin_in.to_string(),
            s.coordinates.exponent.to_string(),
            s.coordinates.weight.to_string(),
            s.kernel_weight.to_string(),
            s.range.to_string(),
            s.noise_variance.to_string(),
            s.nugget_min.to_string(),
            s.beyond.to_string(),
        ];
        let names = NAMES.map(str::to_owned);
        let text = Text {
            gonia: env!("CARGO_PKG_VERSION").to_owned(),
            of: self.of.clone(),
            step_deg: self.grid.step_deg().to_string(),
            channels: self.channels.names(),
            scale: self.scale.to_string(),
            provenance: self.provenance.clone(),
            groups: self.groups.clone(),
            settings: names.into_iter().zip(values).collect(),
        };
        let text = serde_json::to_string_pretty(&text);
        let text = text.map_err(|error| FileError::new(path, error, "fill again"))?;
        write_whole_bytes(path, text.as_bytes())
    }

    /// Reads it.
    ///
    /// # Errors
    /// It cannot be read, is no plan, or one of another version of gonia.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
        let odd = |what: String| FileError::new(path, what, "fill again, in another folder");
        let text: Text =
            serde_json::from_slice(&bytes).map_err(|error| odd(format!("is no plan: {error}")))?;
        let here = env!("CARGO_PKG_VERSION");
        if text.gonia != here {
            let problem = format!(
                "is of gonia {}, and this is {here}: all of a fill must be done by one version",
                text.gonia
            );
            return Err(odd(problem));
        }
        text.plan().ok_or_else(|| {
            odd("is no plan: a number, a channel or a group in it cannot be".to_owned())
        })
    }
}

impl Text {
    fn plan(self) -> Option<FillPlan> {
        let grid = Grid::with_step_deg(self.step_deg.parse().ok()?).ok()?;
        let channels = channels_of(&self.channels)?;
        let n = channels.count();
        let width = self.groups.first()?.len();
        let is_group = |group: &Vec<usize>| group.len() == width && group.iter().all(|c| *c < n);
        if !self.groups.iter().all(is_group) {
            return None;
        }
        Some(FillPlan {
            of: self.of,
            grid,
            channels,
            scale: scale_of(&self.scale)?,
            provenance: self.provenance,
            groups: self.groups,
            settings: settings_of(&self.settings)?,
        })
    }
}

fn settings_of(text: &BTreeMap<String, String>) -> Option<FillSettings> {
    fn number<T: FromStr>(text: &BTreeMap<String, String>, name: &str) -> Option<T> {
        text.get(name)?.parse().ok()
    }
    let settings = FillSettings {
        block_deg: number(text, "block_deg")?,
        tolerance: number(text, "tolerance")?,
        target_error: number(text, "target_error")?,
        budget: number(text, "budget")?,
        neighbours: number(text, "neighbours")?,
        neighbours_most: number(text, "neighbours_most")?,
        one_bin_in: number(text, "one_bin_in")?,
        coordinates: Coordinates {
            exponent: number(text, "exponent")?,
            weight: number(text, "weight")?,
        },
        kernel: &Matern32,
        kernel_weight: number(text, "kernel_weight")?,
        range: number(text, "range")?,
        noise_variance: number(text, "noise_variance")?,
        nugget_min: number(text, "nugget_min")?,
        beyond: number(text, "beyond")?,
    };
    let is_sound = settings.block_deg > 0.0
        && settings.block_deg <= 90.0
        && (8..=1024).contains(&settings.neighbours)
        && settings.one_bin_in > 0;
    is_sound.then_some(settings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_comes_back_to_the_bit_and_one_that_cannot_be_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("plan.json");
        let plan = FillPlan {
            of: "samples".to_owned(),
            grid: Grid::with_step_deg(7.5).unwrap(),
            channels: Channels::Bands(vec![400.0, 500.5]),
            scale: Scale::Relative,
            provenance: [("symmetry".to_owned(), "none".to_owned())].into(),
            groups: vec![vec![0, 0, 1]],
            settings: FillSettings {
                tolerance: f32::INFINITY,
                noise_variance: 0.1_f32.powi(5),
                kernel_weight: 1.0 / 3.0,
                ..FillSettings::DEFAULT
            },
        };
        plan.write(&path).unwrap();
        assert_eq!(FillPlan::read(&path).unwrap(), plan);
        let text = std::fs::read_to_string(&path).unwrap();
        for (from, to, said) in [
            ("\"weight\": \"1\"", "\"weight\": \"x\"", "cannot be"),
            ("\"7.5\"", "\"7.7\"", "cannot be"),
            (env!("CARGO_PKG_VERSION"), "0.0.1", "one version"),
            ("{", "[", "is no plan"),
        ] {
            assert!(text.contains(from), "{from} in {text}");
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let error = FillPlan::read(&path).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
