//! A session's frames → samples.

use crate::session::SessionFolder;
use gonia_formats::FileError;
use gonia_pipeline::process::{Hidden, ProcessError, Processed};
use gonia_pipeline::{Error, Progress, samples_of_sampled};
use gonia_rig::FrameRow;

impl SessionFolder {
    /// Samples of the frames that the session keeps sampled.
    ///
    /// # Errors
    /// The session's folder has changed since it was opened, or its frames give no sample.
    pub fn samples(&self, progress: &Progress<'_>) -> Result<Processed, Error> {
        let rows = self.rows()?;
        let sampled = |row: &FrameRow, _: Hidden| {
            let place = self.pose_done(row.role, row.frame as usize);
            let place =
                place.ok_or_else(|| FileError::new(self.folder(), "has changed", "start again"));
            let frame = place.and_then(|place| self.frame(place));
            frame.map_err(|source| ProcessError::Load {
                frame: row.frame,
                source,
            })
        };
        samples_of_sampled(self.rig(), &rows, &sampled, progress)
    }
}
