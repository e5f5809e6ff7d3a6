//! `summary.toml`: what a run did, in numbers; the report is drawn from it and the files it names.
//!
//! Every section may be missing: `process` fills other ones than `fill`, and the demo fills all.

use crate::{FileError, toml_text, write_whole_bytes};
use gonia_rig::{CellMask, Figures, Scale};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// What a run did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// What was measured, as the report's heading.
    pub title: String,
    /// Whether the values are 1/sr.
    pub scale: Scale,
    /// Checksum of the values of the dense BRDF that this is said of, see
    /// [`checksum::of_brdf`](crate::checksum::of_brdf); absent in summaries of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dense: Option<String>,
    /// Where the data came from: rig, plan, versions, settings, seed.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub provenance: BTreeMap<String, String>,
    /// The poses of the plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poses: Option<PoseCounts>,
    /// The frames taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<FrameCounts>,
    /// How far the arms were from where they should be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pointing: Option<Pointing>,
    /// The samples and the bins they fell into.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bins: Option<BinCounts>,
    /// The cells of the dense BRDF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cells: Option<CellCounts>,
    /// Measured against true, or against another BRDF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub figures: Option<Figures>,
    /// Time by stage, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<Stage>,
    /// Files written.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<FileNote>,
}

/// The poses of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseCounts {
    /// Poses of the plan.
    pub planned: u64,
    /// Poses reached; more than planned when several materials were measured.
    pub reached: u64,
}

/// The frames of a session.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameCounts {
    /// Frames whose samples were kept.
    pub kept: u64,
    /// Frames refused, by reason.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refused: Vec<Refused>,
}

/// Frames refused for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refused {
    /// Why.
    pub reason: String,
    /// How many.
    pub count: u64,
}

impl FrameCounts {
    /// Frames refused for any reason.
    pub fn n_refused(&self) -> u64 {
        self.refused.iter().map(|refused| refused.count).sum()
    }
}

/// The distribution of pointing errors over a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pointing {
    /// Largest error a kept frame may have, degrees.
    pub limit_deg: f64,
    /// 99 % of the errors are at most this, degrees.
    pub p99_deg: f64,
    /// The largest error, degrees.
    pub max_deg: f64,
    /// Width of a class of the histogram, degrees; the first one begins at 0.
    pub class_deg: f64,
    /// Errors in each class; the last one holds all beyond it too.
    pub counts: Vec<u64>,
}

impl Pointing {
    /// Classes of the histogram, 30 of them up to the limit and 6 beyond.
    const CLASSES_TO_LIMIT: usize = 30;
    const CLASSES_BEYOND: usize = 6;

    /// From the absolute errors of all kept frames' axes, in degrees. `None` when there are none.
    pub fn from_errors(errors_deg: &[f64], limit_deg: f64) -> Option<Self> {
        let mut sorted: Vec<f64> = errors_deg.iter().map(|e| e.abs()).collect();
        sorted.sort_by(f64::total_cmp);
        let max_deg = *sorted.last()?;
        let rank = (0.99 * sorted.len() as f64).ceil() as usize;
        let class_deg = limit_deg / Self::CLASSES_TO_LIMIT as f64;
        let mut counts = vec![0; Self::CLASSES_TO_LIMIT + Self::CLASSES_BEYOND];
        let last = counts.len() - 1;
        for error in &sorted {
            counts[((error / class_deg) as usize).min(last)] += 1;
        }
        Some(Self {
            limit_deg,
            p99_deg: sorted[rank.max(1) - 1],
            max_deg,
            class_deg,
            counts,
        })
    }
}

/// Samples and bins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BinCounts {
    /// Samples that fell into a bin.
    pub samples: u64,
    /// Bins with at least one sample.
    pub filled: u64,
    /// Share of bins filled by polar angles, `[iθi][iθv]`, each 0 ..= 1.
    #[serde(rename = "share_by_elevation")]
    pub share_by_polar_angle: Vec<Vec<f32>>,
}

impl BinCounts {
    /// From the bins that hold a sample.
    pub fn new(samples: u64, filled: &CellMask) -> Self {
        Self {
            samples,
            filled: filled.count() as u64,
            share_by_polar_angle: filled.share_by_polar_angle(),
        }
    }
}

/// The cells of a dense BRDF by where their values come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellCounts {
    /// Cells with a measurement, or with that of their mirror.
    pub measured: u64,
    /// Cells interpolated between measurements.
    pub interpolated: u64,
    /// Cells beyond the reach of the measurements.
    pub extrapolated: u64,
}

/// A stage of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    /// Its name.
    pub name: String,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// A file a run wrote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileNote {
    /// Its path, relative to the summary.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// What it holds.
    pub what: String,
}

impl Summary {
    /// An empty summary, to be filled by the stages of a run.
    pub fn new(title: impl Into<String>, scale: Scale) -> Self {
        Self {
            title: title.into(),
            scale,
            dense: None,
            provenance: BTreeMap::new(),
            poses: None,
            frames: None,
            pointing: None,
            bins: None,
            cells: None,
            figures: None,
            stages: Vec::new(),
            files: Vec::new(),
        }
    }

    /// Reads a summary.
    ///
    /// # Errors
    /// One line naming the file and the line: unreadable, not TOML, or an unknown or missing key.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        toml_text::read(path, "make it again with gonia fill or gonia demo")
    }

    /// Writes the summary whole.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let text = toml::to_string(self)
            .map_err(|error| FileError::new(path, error, "check the summary's values"))?;
        write_whole_bytes(path, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Grid;

    #[test]
    fn a_summary_comes_back_as_it_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("summary.toml");
        let grid = Grid::with_step_deg(30.0).unwrap();
        let mut summary = Summary::new("fabric \"112\"", Scale::Absolute);
        summary.write(&path).unwrap();
        assert_eq!(Summary::read(&path).unwrap(), summary);

        summary.provenance.insert("seed".into(), "7".into());
        summary.poses = Some(PoseCounts {
            planned: 8505,
            reached: 17_010,
        });
        let refused = vec![Refused {
            reason: "no fiducial lines".into(),
            count: 3,
        }];
        summary.frames = Some(FrameCounts {
            kept: 17_007,
            refused,
        });
        summary.pointing = Pointing::from_errors(&[0.001, -0.02], 0.03);
        summary.bins = Some(BinCounts::new(12, &CellMask::from_cells(grid, [5, 100])));
        summary.cells = Some(CellCounts {
            measured: 2,
            interpolated: 1290,
            extrapolated: 4,
        });
        summary.stages.push(Stage {
            name: "capture".into(),
            seconds: 12.5,
        });
        summary.files.push(FileNote {
            path: "dense.exr".into(),
            bytes: 9,
            what: "BRDF".into(),
        });
        summary.write(&path).unwrap();
        assert_eq!(Summary::read(&path).unwrap(), summary);
    }

    #[test]
    fn the_histogram_counts_every_error_once() {
        let errors: Vec<f64> = (0..1000).map(|k| k as f64 * 4e-5).collect();
        let pointing = Pointing::from_errors(&errors, 0.03).unwrap();
        assert_eq!(pointing.counts.iter().sum::<u64>(), 1000);
        assert!((pointing.max_deg - 0.03996).abs() < 1e-9);
        assert!((pointing.p99_deg - 0.03956).abs() < 1e-9);
        assert_eq!(pointing.counts[0], 25);
        // Everything beyond 0.035° is in the last class.
        assert_eq!(*pointing.counts.last().unwrap(), 125);
        assert_eq!(Pointing::from_errors(&[], 0.03), None);
    }

    #[test]
    fn a_misspelt_key_is_named_with_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("summary.toml");
        std::fs::write(&path, "title = \"x\"\nscale = \"absolute\"\npose = 3\n").unwrap();
        let error = Summary::read(&path).unwrap_err().to_string();
        assert!(
            error.contains("line 3") && error.contains("pose"),
            "{error}"
        );
        assert_eq!(error.lines().count(), 1);
    }
}
