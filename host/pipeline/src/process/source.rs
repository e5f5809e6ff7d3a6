//! Where frames come from.

use crate::bracket::{Bracket, load_bracket};
use gonia_formats::frame_exr::SpareFrame;
use gonia_formats::{CaptureFolder, FileError};
use gonia_rig::{Frame, Remark};
use std::ops::Range;

pub use gonia_rig::{FrameRow, Role};

/// A list of frames that can be had one by one, from several threads and in any order.
pub trait FrameSource: Sync {
    /// All frames there are.
    fn rows(&self) -> &[FrameRow];

    /// One of them. May be called more than once for the same row.
    fn load(&self, row: &FrameRow) -> Result<Frame, FileError>;

    /// As [`FrameSource::load`], with what is to be said of a frame that is used all the same.
    ///
    /// # Errors
    /// As [`FrameSource::load`].
    fn load_with_remarks(&self, row: &FrameRow) -> Result<(Frame, Vec<Remark>), FileError> {
        Ok((self.load(row)?, Vec::new()))
    }

    /// As [`FrameSource::load`], of a frame of which only some rows are needed: the others may be NaN.
    /// None where reading some rows takes as long as reading all. The frame may be in the memory of `spare`.
    ///
    /// # Errors
    /// As [`FrameSource::load`], as far as these rows show it.
    fn load_rows(
        &self,
        _row: &FrameRow,
        _rows: Range<usize>,
        _spare: &mut SpareFrame,
    ) -> Result<Option<Frame>, FileError> {
        Ok(None)
    }
}

impl FrameSource for CaptureFolder {
    fn rows(&self) -> &[FrameRow] {
        self.rows()
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        Ok(self.load_with_remarks(row)?.0)
    }

    fn load_with_remarks(&self, row: &FrameRow) -> Result<(Frame, Vec<Remark>), FileError> {
        if self.exposures(row).is_empty() {
            return Ok((self.load(row)?, Vec::new()));
        }
        let Bracket { radiance, remarks } = load_bracket(self, row)?;
        Ok((radiance.frame, remarks))
    }

    fn load_rows(
        &self,
        row: &FrameRow,
        rows: Range<usize>,
        spare: &mut SpareFrame,
    ) -> Result<Option<Frame>, FileError> {
        if self.exposures(row).is_empty() {
            return self.load_rows(row, rows, spare).map(Some);
        }
        Ok(None)
    }
}
