//! The scene of a rig, in the host's own types: `rig.toml` in, frames out.

use super::{Scene, SceneGeometry, Surface};
use gonia_brdf::Pose;
use gonia_brdf::model::Kurt;
use gonia_rig::{Frame, Rig, Role};
use std::sync::Arc;

impl SceneGeometry {
    /// The geometry of a rig.
    pub fn of_rig(rig: &Rig) -> Self {
        Self {
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
            mark: rig.target.mark(),
            light_arm: rig.light.arm,
            camera_arm: rig.camera.arm,
            camera_mount: rig.camera.mount,
            target_place: rig.target.place,
            ..Self::paper(rig.camera.width_px)
        }
    }

    /// The rig that has this geometry, with the paper's sampling.
    pub fn to_rig(&self) -> Rig {
        let mut rig = Rig::paper(self.width_px);
        rig.light.distance_m = self.light_distance_m;
        rig.camera.distance_m = self.camera_distance_m;
        [rig.camera.k1, rig.camera.k2] = self.distortion;
        rig.camera.height_px = self.height_px;
        rig.camera.focal_px = self.focal_px;
        rig.camera.centre_px = self.centre_px;
        rig.target.line_offset_mm = self.line_offset_mm;
        rig.target.line_width_mm = self.line_width_mm;
        rig.target.material_half_mm = self.material_half_mm;
        rig.target.mark_mm = self.mark.map(|mark| mark.at_mm);
        rig.target.mark_radius_mm = self.mark.map(|mark| mark.radius_mm);
        (rig.light.arm, rig.camera.arm) = (self.light_arm, self.camera_arm);
        rig.camera.mount = self.camera_mount;
        rig.target.place = self.target_place;
        rig
    }
}

impl Scene {
    /// The demo's fabric and its white reference on the paper's rig, seen by `px` × `px` pixels.
    pub fn of_fabric(px: usize) -> Self {
        Self::new(
            SceneGeometry::paper(px),
            Arc::new(Kurt::two_thread_fabric()),
            Arc::new(Kurt::white_reference_fabric()),
            11,
        )
    }

    /// What the camera sees at a pose, with the noise of shot number `shot`.
    pub fn frame(&self, role: Role, exposed_at: Pose, shot: u64) -> Frame {
        let surface = match role {
            Role::Material => Surface::Material,
            Role::Reference => Surface::Reference,
            Role::Mirror => Surface::Mirror,
        };
        let rendered = self.render(surface, exposed_at, shot);
        Frame {
            width: rendered.width,
            height: rendered.height,
            rgb: rendered.rgb,
        }
    }
}
