//! Where frames come from.

use crate::dataset::Frame;
use gonia_brdf::Pose;

/// What a frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// The material under test.
    Material,
    /// The reference.
    Reference,
}

/// One frame of a session or a capture folder.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameRow {
    /// Its number, unique in the session.
    pub frame: u32,
    /// What it shows.
    pub role: Role,
    /// The arms' reading when it was taken.
    pub pose: Pose,
    /// Its name in the folder, for messages; a source without files may leave it empty.
    pub file: String,
}

/// Why a source has no frame: one line for a person.
pub type LoadError = Box<dyn std::error::Error + Send + Sync>;

/// A list of frames that can be had one by one, from several threads and in any order.
pub trait FrameSource: Sync {
    /// All frames there are.
    fn rows(&self) -> &[FrameRow];

    /// One of them. May be called more than once for the same row.
    fn load(&self, row: &FrameRow) -> Result<Frame, LoadError>;
}
