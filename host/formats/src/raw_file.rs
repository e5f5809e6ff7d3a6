//! What every kind of file of a raw frame has, and what is said of those that are not read.

use crate::FileError;
use gonia_rig::RawFrame;
use std::path::Path;

/// A raw frame, and what its file says of the counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawFile {
    /// The counts.
    pub raw: RawFrame,
    /// Bits of a count in the file: 8 or 16.
    pub bits: u8,
    /// Why the counts are not proportional to light, where the file says so (in words): by the chunks
    /// sRGB, gAMA, iCCP or cICP of a PNG, or the colour profile of a TIFF.
    pub encoded: Option<String>,
}

/// A file as cameras write it, which is not read.
pub(super) fn camera_raw(path: &Path, kind: &str) -> FileError {
    FileError::new(
        path,
        format_args!("is a {kind}, which is not read"),
        "make a TIFF of its counts, as the sensor gave them and not turned: dcraw -D -4 -t 0 -T",
    )
}

/// A frame of another camera.
pub(super) fn wrong_size(path: &Path, seen: [usize; 2], camera: [usize; 2]) -> FileError {
    FileError::new(
        path,
        format_args!(
            "is {} × {} pixels, but the rig's camera has {} × {}",
            seen[0], seen[1], camera[0], camera[1]
        ),
        "mend [camera] in rig.toml or use the frames of this rig",
    )
}
