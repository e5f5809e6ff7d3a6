//! Frames of the simulated rig, rendered one by one when they are processed: what a capture folder would
//! hold.

use gonia_brdf::Pose;
use gonia_formats::frame_exr::write_frame;
use gonia_formats::{FileError, check_writable};
use gonia_pipeline::process::FrameSource;
use gonia_rig::{Frame, FrameRow, Role};
use gonia_sim::scene::Scene;
use std::path::{Path, PathBuf};

/// The frames that were exposed so far: their readings, and the true angles of the arms' shafts.
pub struct SimulatedFrames {
    scene: Scene,
    rows: Vec<FrameRow>,
    /// True poses, by the number of the frame.
    exposed_at: Vec<Pose>,
    keep: Option<PathBuf>,
}

impl SimulatedFrames {
    /// No frames yet, of a scene.
    pub fn new(scene: Scene) -> Self {
        Self {
            scene,
            rows: Vec::new(),
            exposed_at: Vec::new(),
            keep: None,
        }
    }

    /// Also writes each frame that is loaded into `folder/frames`, as a capture folder has them.
    ///
    /// # Errors
    /// When the folder cannot be made or written to.
    pub fn keep_frames(&mut self, folder: &Path) -> Result<(), FileError> {
        check_writable(&folder.join("frames"))?;
        self.keep = Some(folder.to_owned());
        Ok(())
    }

    /// Exposes a frame. `reading` is what the arms' encoders said, `exposed_at` where the arms
    /// were: only the scene knows that.
    pub fn expose(&mut self, role: Role, reading: Pose, exposed_at: Pose) {
        let frame = self.rows.len() as u32;
        self.rows.push(FrameRow {
            frame,
            role,
            pose: reading,
            file: format!("frames/{frame:06}.exr"),
        });
        self.exposed_at.push(exposed_at);
    }

    /// The frames, by number, each with where the arms truly were.
    pub fn exposures(&self) -> impl Iterator<Item = (&FrameRow, Pose)> {
        self.rows.iter().zip(self.exposed_at.iter().copied())
    }
}

impl FrameSource for SimulatedFrames {
    fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        let exposed_at = self.exposed_at.get(row.frame as usize).ok_or_else(|| {
            FileError::new(Path::new(&row.file), "was never exposed", "expose it")
        })?;
        let frame = self
            .scene
            .frame(row.role, *exposed_at, u64::from(row.frame));
        if let Some(folder) = &self.keep {
            write_frame(&folder.join(&row.file), &frame)?;
        }
        Ok(frame)
    }
}
