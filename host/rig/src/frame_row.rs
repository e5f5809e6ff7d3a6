//! What `frames.csv` says of a frame: what it is of, and where the arms were.

use gonia_brdf::Pose;

/// What lay on the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// The material that is being measured.
    Material,
    /// The reference that frames are calibrated against.
    Reference,
    /// A plane mirror, or black glass: its frames show where the light is, and are no samples.
    Mirror,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Material, Self::Reference, Self::Mirror];

    /// Its word in `frames.csv`.
    pub fn name(self) -> &'static str {
        match self {
            Role::Material => "material",
            Role::Reference => "reference",
            Role::Mirror => "mirror",
        }
    }
}

/// One frame of a capture folder.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameRow {
    /// Number of the frame; unique among those of its role.
    pub frame: u32,
    /// What lay on the target.
    pub role: Role,
    /// The arms' reading.
    pub pose: Pose,
    /// Path of the EXR, or of a bracket's first exposure, relative to the capture folder.
    pub file: String,
}

/// A raw exposure of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Exposure {
    /// Path of its PNG, relative to the capture folder.
    pub file: String,
    /// How long it took, seconds.
    pub exposure_s: f64,
}
