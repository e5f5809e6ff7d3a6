//! The folder in which several processes share a fill: what they all start from, what each has solved, and the
//! table that they write.
//!
//! | file | what it holds |
//! |---|---|
//! | `plan.json` | grid, channels, settings: [`FillPlan`] |
//! | `bins-G` | bins of a group of channels |
//! | `solved-G/P` | what the pairs of patch P with itself and all later ones give |
//! | `whole.zarr` | the table, ring by ring |
//!
//! A file stands under its name once it is whole, so that what a process had not ended when it died is done again.

mod bins;
mod bytes;
mod plan;
mod solved;

pub use bins::{read_bins, write_bins};
pub use plan::FillPlan;
pub use solved::{SolvedPatch, read_solved, write_solved};

use std::path::{Path, PathBuf};

/// Names of the files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PartsFolder(PathBuf);

impl PartsFolder {
    /// Of this folder.
    pub fn new(folder: &Path) -> Self {
        Self(folder.to_owned())
    }

    /// Itself.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// What all start from.
    pub fn plan(&self) -> PathBuf {
        self.0.join("plan.json")
    }

    /// Bins of a group of channels, by its number.
    pub fn bins(&self, group: usize) -> PathBuf {
        self.0.join(format!("bins-{group}"))
    }

    /// What is solved of a group of channels.
    pub fn solved(&self, group: usize) -> PathBuf {
        self.0.join(format!("solved-{group}"))
    }

    /// The pairs of a patch.
    pub fn solved_patch(&self, group: usize, patch: usize) -> PathBuf {
        self.solved(group).join(format!("{patch:05}"))
    }

    /// The table.
    pub fn table(&self) -> PathBuf {
        self.0.join("whole.zarr")
    }
}
