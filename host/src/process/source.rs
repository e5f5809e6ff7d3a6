//! Where frames come from.

use crate::dataset::{CaptureFolder, FileError, Frame};
use crate::hdr::load_bracket;

pub use crate::dataset::{FrameRow, Role};

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
