//! `gonia verify`: whether a session is whole.

use crate::table;
use anyhow::{Result, bail};
use gonia_acquire::session::{Finding, verify};
use std::path::PathBuf;

/// Checks every checksum of a session, that each pose is done once, and that its samples are there.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia verify silk\n\nIt changes nothing. What is broken is named, with where it is and what to do; an unfinished session\nis not broken."
)]
pub struct Verify {
    /// Folder of the session
    folder: PathBuf,
}

impl Verify {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let verdict = verify(&self.folder)?;
        let end = match &verdict.end {
            Some((_, reason)) => reason.clone(),
            None => "killed, or still running: go on with gonia capture --resume".into(),
        };
        let mut rows = vec![
            (
                "poses".to_owned(),
                format!("{} of {}", verdict.done, verdict.planned),
            ),
            (
                "programs".into(),
                format!(
                    "{} began it or went on with it, {} were killed",
                    verdict.starts, verdict.kills
                ),
            ),
            ("ended".into(), end),
            ("samples".into(), table::bytes(verdict.frame_bytes)),
            (
                "pointing error".into(),
                format!("at most {:.4} degrees by encoder", verdict.max_pointing_deg),
            ),
        ];
        for finding in &verdict.findings {
            rows.push(match finding {
                Finding::Note(text) => ("note".into(), text.clone()),
                Finding::Broken(error) => ("broken".into(), error.to_string()),
            });
        }
        table::print(&rows);
        let broken = verdict.broken().count();
        if let Some(first) = verdict.broken().next() {
            bail!("{broken} things are broken; the first: {first}");
        }
        Ok(())
    }
}
