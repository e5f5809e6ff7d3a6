//! `provenance.toml`: what a session was measured with.

use gonia_formats::{FileError, toml_text, write_whole_bytes};
use gonia_protocol::message::Identity;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What a session was measured with, from its beginning to its end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SessionProvenance {
    /// The program that began it, with its version.
    pub program: String,
    /// When it began, UTC.
    pub began: String,
    /// Checksum of `rig.toml`, CRC-32C in hexadecimal.
    pub rig_crc: String,
    /// Checksum of `plan.csv`.
    pub plan_crc: String,
    /// Checksum of the reference's table, if `rig.toml` names one; a session of an older program has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_crc: Option<String>,
    /// Whether the reference is measured over the whole plan before the material.
    pub reference: bool,
    /// The camera, or whatever else the frames come from.
    pub camera: String,
    /// Seed of a simulated rig.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The light arm's controller.
    pub light_arm: ControllerIdentity,
    /// The camera arm's controller.
    pub camera_arm: ControllerIdentity,
}

/// A controller as it was when the session began.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerIdentity {
    /// Its board.
    pub board: String,
    /// Its firmware's version and state of the sources.
    pub firmware: String,
    /// Checksum of its settings in use, in hexadecimal.
    pub config_crc: String,
}

impl From<&Identity> for ControllerIdentity {
    fn from(identity: &Identity) -> Self {
        let [major, minor, patch] = identity.firmware;
        Self {
            board: identity.board.as_str().to_owned(),
            firmware: format!("{major}.{minor}.{patch} ({})", identity.git),
            config_crc: format!("{:08x}", identity.config_crc),
        }
    }
}

impl SessionProvenance {
    /// Reads it.
    ///
    /// # Errors
    /// One line naming the file and its line.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        toml_text::read(
            path,
            "restore the file; a session's provenance is never edited",
        )
    }

    /// Writes it whole.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let text = toml::to_string(self)
            .map_err(|error| FileError::new(path, error, "check the session's settings"))?;
        write_whole_bytes(path, text.as_bytes())
    }
}
