//! What hid the target at each pose of a session's reference, kept for other materials: the light's
//! head stands where it stood.

use crate::process::reference::distance_of_same;
use gonia_brdf::Pose;
use gonia_formats::FileError;
use gonia_formats::masks_csv::{MaskRow, read_masks_csv, write_masks_csv};
use gonia_imaging::Mask;
use gonia_rig::Rig;
use std::path::Path;

/// Name of the file beside the samples that says what hid the target in the reference's frames.
pub const MASKS: &str = "masks.csv";

/// Masks by the arms' reading; no mask at a pose at which nothing hid the target.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Masks {
    masks: Vec<(Pose, Option<Mask>)>,
}

impl Masks {
    /// In the order of the reference's frames.
    pub fn new(masks: Vec<(Pose, Option<Mask>)>) -> Self {
        Self { masks }
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.masks.len()
    }

    /// Whether there is no pose.
    pub fn is_empty(&self) -> bool {
        self.masks.is_empty()
    }

    /// The mask at a pose; `None` when no reference was seen within 0.1° of it.
    pub fn at(&self, pose: Pose) -> Option<Option<&Mask>> {
        self.masks
            .iter()
            .filter_map(|(at, mask)| Some((mask.as_ref(), distance_of_same(*at, pose)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(mask, _)| mask)
    }

    /// Writes them whole, for frames of a rig.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path, rig: &Rig) -> Result<(), FileError> {
        let row = |(pose, mask): &(Pose, Option<Mask>)| MaskRow {
            pose: *pose,
            mask: mask.as_ref().map(Mask::to_bytes),
        };
        let rows: Vec<MaskRow> = self.masks.iter().map(row).collect();
        write_masks_csv(path, rig, &rows)
    }

    /// Reads masks for frames of a rig.
    ///
    /// # Errors
    /// One line naming the file and its line: unreadable, of frames of another camera, or with a
    /// mask that is none.
    pub fn read(path: &Path, rig: &Rig) -> Result<Self, FileError> {
        let mut masks = Vec::new();
        for (i, row) in read_masks_csv(path, rig)?.into_iter().enumerate() {
            let mask = match row.mask {
                None => None,
                Some(bytes) => Some(Mask::from_bytes(&bytes).ok_or_else(|| {
                    FileError::new(path, "holds a mask that is none", "make the file again")
                        .at(format_args!("row {}", i + 1))
                })?),
            };
            masks.push((row.pose, mask));
        }
        Ok(Self { masks })
    }
}
