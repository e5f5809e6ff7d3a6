//! Frames of the simulator for tests: its truth against what was made of them.

use crate::dataset::{Frame, Rig};
use gonia_brdf::model::Kurt;
use gonia_brdf::{Direction, Pose};
use gonia_sim::scene::{Scene, SceneGeometry, Surface};
use std::sync::Arc;

/// The demo's scene on the paper's rig.
pub fn scene(px: usize) -> Scene {
    Scene::new(
        SceneGeometry::paper(px),
        Arc::new(Kurt::two_thread_fabric()),
        Arc::new(Kurt::white_reference_fabric()),
        11,
    )
}

/// The host's rig for a scene's geometry.
pub fn rig(geometry: &SceneGeometry) -> Rig {
    let mut rig = Rig::paper(geometry.width_px);
    [rig.camera.k1, rig.camera.k2] = geometry.distortion;
    rig.camera.height_px = geometry.height_px;
    rig.camera.focal_px = geometry.focal_px;
    rig.camera.centre_px = geometry.centre_px;
    rig
}

/// A pose in degrees: θi, φi, θv, φv.
pub fn pose(angles: [f64; 4]) -> Pose {
    Pose {
        light: Direction::from_deg(angles[0], angles[1]),
        view: Direction::from_deg(angles[2], angles[3]),
    }
}

/// Renders into the host's frame.
pub fn render(scene: &Scene, which: Surface, pose: Pose, shot: u64) -> Frame {
    let rendered = scene.render(which, pose, shot);
    Frame {
        width: rendered.width,
        height: rendered.height,
        rgb: rendered.rgb,
    }
}
