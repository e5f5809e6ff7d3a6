//! Where frames come from.

use crate::bracket::load_bracket;
use gonia_formats::{CaptureFolder, FileError};
use gonia_rig::Frame;

pub use gonia_rig::{FrameRow, Role};

/// A list of frames that can be had one by one, from several threads and in any order.
pub trait FrameSource: Sync {
    /// All frames there are.
    fn rows(&self) -> &[FrameRow];

    /// One of them. May be called more than once for the same row.
    fn load(&self, row: &FrameRow) -> Result<Frame, FileError>;
}

impl FrameSource for CaptureFolder {
    fn rows(&self) -> &[FrameRow] {
        self.rows()
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        if self.exposures(row).is_empty() {
            self.load(row)
        } else {
            load_bracket(self, row).map(|radiance| radiance.frame)
        }
    }
}
