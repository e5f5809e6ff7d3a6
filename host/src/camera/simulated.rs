//! The camera of the simulated rig: it exposes when it is triggered, at the true angles of the
//! arms' shafts, and renders the frame when it is read out.

use crate::dataset::frame_exr::write_frame;
use crate::dataset::{FileError, Frame, FrameRow, Rig, Role, check_writable};
use crate::process::FrameSource;
use gonia_brdf::Pose;
use gonia_sim::scene::{Scene, SceneGeometry, Surface};
use std::path::{Path, PathBuf};

/// What was exposed so far.
pub struct SimulatedCamera {
    scene: Scene,
    rows: Vec<FrameRow>,
    /// True poses, by the number of the frame.
    exposed_at: Vec<Pose>,
    keep: Option<PathBuf>,
}

impl SimulatedCamera {
    /// A camera that looks at a scene.
    pub fn new(scene: Scene) -> Self {
        Self {
            scene,
            rows: Vec::new(),
            exposed_at: Vec::new(),
            keep: None,
        }
    }

    /// Also writes each frame that is read out into `folder/frames`, as a capture folder has them.
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
}

impl FrameSource for SimulatedCamera {
    fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        let exposed_at = self.exposed_at.get(row.frame as usize).ok_or_else(|| {
            FileError::new(Path::new(&row.file), "was never exposed", "expose it")
        })?;
        let frame = render(&self.scene, row.role, *exposed_at, u64::from(row.frame));
        if let Some(folder) = &self.keep {
            write_frame(&folder.join(&row.file), &frame)?;
        }
        Ok(frame)
    }
}

/// What the camera sees of a scene at a pose, with the noise of shot number `shot`.
pub fn render(scene: &Scene, role: Role, exposed_at: Pose, shot: u64) -> Frame {
    let surface = match role {
        Role::Material => Surface::Material,
        Role::Reference => Surface::Reference,
    };
    let rendered = scene.render(surface, exposed_at, shot);
    Frame {
        width: rendered.width,
        height: rendered.height,
        rgb: rendered.rgb,
    }
}

/// The scene's geometry of a rig.
pub fn geometry_of(rig: &Rig) -> SceneGeometry {
    SceneGeometry {
        light_distance_m: rig.light.distance_m,
        camera_distance_m: rig.camera.distance_m,
        width_px: rig.camera.width_px,
        height_px: rig.camera.height_px,
        focal_px: rig.camera.focal_px,
        centre_px: rig.camera.centre_px,
        distortion: [rig.camera.k1, rig.camera.k2],
        line_offset_mm: rig.target.line_offset_mm,
        line_width_mm: rig.target.line_width_mm,
        material_half_mm: rig.target.material_half_mm,
        ..SceneGeometry::paper(rig.camera.width_px)
    }
}
