//! A capture folder: `rig.toml`, `frames.csv` and the frames they speak of.

use crate::FileError;
use crate::frame_exr::{SpareFrame, read_frame_rows};
use crate::frames_csv::{FrameList, read_frames_csv};
use crate::rig_toml::read_rig;
use gonia_rig::{Exposure, Frame, FrameRow, Rig, Role};
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The frames of a session of any rig, to be loaded one by one.
#[derive(Clone, Debug)]
pub struct CaptureFolder {
    folder: PathBuf,
    rig: Rig,
    rows: Vec<FrameRow>,
    /// The raw exposures of frames that have any.
    exposures: HashMap<(u32, Role), Vec<Exposure>>,
}

impl CaptureFolder {
    /// Reads the rig and the list of frames, and checks that every frame's file is there.
    ///
    /// # Errors
    /// One line naming the file and the place, when the folder, its rig or its list cannot be
    /// used, or a frame's file is missing.
    pub fn open(folder: &Path) -> Result<Self, FileError> {
        if !folder.is_dir() {
            return Err(FileError::new(
                folder,
                "is not a folder",
                "give a capture folder, with rig.toml, frames.csv and the frames",
            ));
        }
        let rig = read_rig(&folder.join("rig.toml"))?;
        let list = folder.join("frames.csv");
        let FrameList { rows, exposures } = read_frames_csv(&list)?;
        if rows.is_empty() {
            return Err(FileError::new(
                &list,
                "names no frame",
                "capture some frames first",
            ));
        }
        for (row, bracket) in rows.iter().zip(&exposures) {
            let files = bracket.iter().map(|e| &e.file).chain([&row.file]);
            if let Some(missing) = files.into_iter().find(|f| !folder.join(f).is_file()) {
                return Err(FileError::new(
                    &list,
                    format_args!("there is no file \"{missing}\""),
                    "restore it, or remove its row",
                )
                .at(format_args!("{} frame {}", row.role.name(), row.frame)));
            }
        }
        let exposures = rows
            .iter()
            .zip(exposures)
            .filter(|(_, bracket)| !bracket.is_empty())
            .map(|(row, bracket)| ((row.frame, row.role), bracket))
            .collect();
        Ok(Self {
            folder: folder.to_owned(),
            rig,
            rows,
            exposures,
        })
    }

    /// The geometry the frames were taken with.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The frames, in the order of `frames.csv`.
    pub fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    /// The raw exposures of a frame; none when its file is one of linear radiance.
    pub fn exposures(&self, row: &FrameRow) -> &[Exposure] {
        self.exposures
            .get(&(row.frame, row.role))
            .map_or(&[], Vec::as_slice)
    }

    /// Where a frame's file is, or the first of its bracket.
    pub fn path_of(&self, row: &FrameRow) -> PathBuf {
        self.path_of_file(&row.file)
    }

    /// Where a file of the folder is.
    pub fn path_of_file(&self, file: &str) -> PathBuf {
        self.folder.join(file)
    }

    /// Loads one frame of linear radiance (raw exposures are merged by
    /// `gonia_pipeline::bracket`). Frames may be loaded from many threads at once.
    ///
    /// # Errors
    /// One line naming the file: see [`read_frame_of_size`](crate::frame_exr::read_frame_of_size).
    pub fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        let rows = 0..self.rig.camera.height_px;
        self.load_rows(row, rows, &mut SpareFrame::default())
    }

    /// As [`CaptureFolder::load`], of a frame of which only some rows are needed: the others may be NaN.
    /// Its memory is that of `spare`, where it fits.
    ///
    /// # Errors
    /// As [`CaptureFolder::load`].
    pub fn load_rows(
        &self,
        row: &FrameRow,
        rows: Range<usize>,
        spare: &mut SpareFrame,
    ) -> Result<Frame, FileError> {
        let camera = &self.rig.camera;
        let size = [camera.width_px, camera.height_px];
        read_frame_rows(&self.path_of(row), size, rows, spare)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame_exr::write_frame;
    use crate::frames_csv::write_frames_csv;
    use crate::rig_toml::write_rig;
    use gonia_brdf::{Direction, Pose};
    use gonia_rig::Role;

    fn make(folder: &Path, frame_px: usize) {
        write_rig(&folder.join("rig.toml"), &Rig::paper(32)).unwrap();
        let frame = Frame {
            width: frame_px,
            height: frame_px,
            rgb: vec![[0.5, 0.25, 0.125]; frame_px * frame_px],
        };
        write_frame(&folder.join("0.exr"), &frame).unwrap();
        let up = Direction::from_deg(0.0, 0.0);
        let row = FrameRow {
            frame: 0,
            role: Role::Material,
            pose: Pose {
                light: up,
                view: up,
            },
            file: "0.exr".into(),
        };
        write_frames_csv(&folder.join("frames.csv"), &[row]).unwrap();
    }

    #[test]
    fn a_folder_gives_its_rig_and_its_frames() {
        let dir = tempfile::tempdir().unwrap();
        make(dir.path(), 32);
        let folder = CaptureFolder::open(dir.path()).unwrap();
        assert_eq!(folder.rig(), &Rig::paper(32));
        assert_eq!(
            folder.load(&folder.rows()[0]).unwrap().rgb[5],
            [0.5, 0.25, 0.125]
        );
    }

    #[test]
    fn a_missing_or_wrongly_sized_frame_is_named() {
        let dir = tempfile::tempdir().unwrap();
        make(dir.path(), 33);
        let folder = CaptureFolder::open(dir.path()).unwrap();
        let error = folder.load(&folder.rows()[0]).unwrap_err().to_string();
        assert!(error.contains("0.exr: is 33 × 33 pixels"), "{error}");

        std::fs::remove_file(dir.path().join("0.exr")).unwrap();
        let error = CaptureFolder::open(dir.path()).unwrap_err().to_string();
        assert!(
            error.contains("frames.csv, material frame 0: there is no file \"0.exr\""),
            "{error}"
        );
        let error = CaptureFolder::open(&dir.path().join("none"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("is not a folder"), "{error}");
    }
}
