//! `masks.csv`: what hid the target at each pose of the reference, for other materials.

use crate::frames_csv::Degrees;
use crate::named_table::NamedTable;
use crate::{FileError, write_whole};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gonia_brdf::Pose;
use gonia_rig::Rig;
use std::io::Write;
use std::path::Path;

/// A focal length that differs by no more than this share is one of the same camera: masks are of a frame's pixels,
/// whatever its focal length is thought to be, and a calibration finds it up to 5 % from where it was.
const SAME_CAMERA: f64 = 0.05;

/// The mask of one pose.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskRow {
    /// The arms' reading.
    pub pose: Pose,
    /// The mask's bytes; `None` when nothing hid the target.
    pub mask: Option<Vec<u8>>,
}

/// Reads masks, which must be of frames as the rig's camera takes them.
///
/// # Errors
/// One line naming the file and its line: a missing column, a number that is none, frames of another
/// size or a focal length that differs by more than 5 %, or a mask that is not base64.
pub fn read_masks_csv(path: &Path, rig: &Rig) -> Result<Vec<MaskRow>, FileError> {
    let table = NamedTable::open(path, &["theta_i_deg", "width_px", "mask"], 7)?;
    let angles = table.angles()?;
    let [width, height, focal, mask] = [
        table.column("width_px")?,
        table.column("height_px")?,
        table.column("focal_px")?,
        table.column("mask")?,
    ];
    let camera = &rig.camera;
    let mut masks = Vec::new();
    let mut rows = table.rows();
    while rows.advance()? {
        let size: [usize; 2] = [rows.number(width)?, rows.number(height)?];
        let focal_px: f64 = rows.number(focal)?;
        let is_same = (focal_px - camera.focal_px).abs() <= SAME_CAMERA * camera.focal_px;
        if size != [camera.width_px, camera.height_px] || !is_same {
            return Err(rows.wrong(
                format_args!(
                    "the mask is of a frame of {} x {} pixels and a focal length of {focal_px} pixels, but rig.toml has {} x {} and {}",
                    size[0], size[1], camera.width_px, camera.height_px, camera.focal_px
                ),
                "use masks of the same camera, or take the file away and run process on the reference's frames again",
            ));
        }
        let text = rows.text(mask);
        let bytes = match text {
            "" => None,
            _ => Some(STANDARD.decode(text).map_err(|error| {
                rows.wrong(
                    format_args!("the mask is not base64 ({error})"),
                    "make the file again",
                )
            })?),
        };
        masks.push(MaskRow {
            pose: rows.pose(angles)?,
            mask: bytes,
        });
    }
    Ok(masks)
}

/// Writes masks whole.
///
/// # Errors
/// When the file cannot be written.
pub fn write_masks_csv(path: &Path, rig: &Rig, rows: &[MaskRow]) -> Result<(), FileError> {
    let camera = &rig.camera;
    write_whole(path, |out| {
        writeln!(
            out,
            "theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg,width_px,height_px,focal_px,mask"
        )?;
        for row in rows {
            let Pose { light, view } = row.pose;
            writeln!(
                out,
                "{},{},{},{},{},{},{},{}",
                Degrees(light.theta_deg()),
                Degrees(light.phi_deg()),
                Degrees(view.theta_deg()),
                Degrees(view.phi_deg()),
                camera.width_px,
                camera.height_px,
                camera.focal_px,
                row.mask
                    .as_ref()
                    .map_or(String::new(), |m| STANDARD.encode(m)),
            )?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;

    #[test]
    fn masks_come_back_and_those_of_another_camera_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("masks.csv");
        let row = |theta: f64, mask| MaskRow {
            pose: Pose {
                light: Direction::from_deg(theta, 0.0),
                view: Direction::from_deg(30.0, 0.0),
            },
            mask,
        };
        let rows = [row(15.0, Some(vec![1, 2, 255])), row(30.0, None)];
        let rig = Rig::paper(64);
        write_masks_csv(&path, &rig, &rows).unwrap();
        let back = read_masks_csv(&path, &rig).unwrap();
        assert_eq!(back.len(), 2);
        for (a, b) in rows.iter().zip(&back) {
            assert_eq!(a.mask, b.mask);
            assert!((a.pose.light.theta - b.pose.light.theta).abs() < 1e-9);
        }
        let error = read_masks_csv(&path, &Rig::paper(65))
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("masks.csv, line 2: the mask is of a frame of 64 x 64"),
            "{error}"
        );
        // A calibration finds another focal length of the same camera; another lens has another one.
        let mut other = rig.clone();
        for by in [1.0 + 1e-9, 0.996, 1.049] {
            other.camera.focal_px = by * rig.camera.focal_px;
            assert_eq!(read_masks_csv(&path, &other).unwrap().len(), 2, "{by}");
        }
        for by in [0.9, 1.1, f64::NAN] {
            other.camera.focal_px = by * rig.camera.focal_px;
            let error = read_masks_csv(&path, &other).unwrap_err().to_string();
            assert!(error.contains("a focal length of 100 pixels"), "{error}");
        }
        let text = std::fs::read_to_string(&path)
            .unwrap()
            .replace("AQL/", "A?L/");
        std::fs::write(&path, text).unwrap();
        let error = read_masks_csv(&path, &rig).unwrap_err().to_string();
        assert!(error.contains("line 2: the mask is not base64"), "{error}");
    }
}
