//! A small capture folder of the simulated fabric, for the example to have something to read.

use gonia_brdf::Pose;
use gonia_brdf::hemisphere::directions;
use gonia_formats::frame_exr::write_frame;
use gonia_formats::frames_csv::write_frames_csv;
use gonia_formats::rig_toml::write_rig;
use gonia_rig::{FrameRow, Role};
use gonia_sim::scene::Scene;
use std::error::Error;

/// Renders 7 lights × 7 views, of the material alone: values will be relative.
pub fn make() -> Result<tempfile::TempDir, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let scene = Scene::of_fabric(200);
    let around = directions(&[(0.0, 1), (40.0, 6)]);
    let mut rows = Vec::new();
    for (i, light) in around.iter().enumerate() {
        for (v, view) in around.iter().enumerate() {
            let frame = (around.len() * i + v) as u32;
            let pose = Pose {
                light: *light,
                view: *view,
            };
            let file = format!("{frame:03}.exr");
            let image = scene.frame(Role::Material, pose, u64::from(frame));
            write_frame(&folder.path().join(&file), &image)?;
            rows.push(FrameRow {
                frame,
                role: Role::Material,
                pose,
                file,
            });
        }
    }
    write_frames_csv(&folder.path().join("frames.csv"), &rows)?;
    write_rig(&folder.path().join("rig.toml"), &scene.geometry.to_rig())?;
    Ok(folder)
}
