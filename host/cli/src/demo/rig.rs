//! The simulated rig: its drawing, how it was built, and how far directions are off by either.

use gonia_acquire::camera::SimulatedFrames;
use gonia_brdf::direction::angle_between;
use gonia_brdf::model::Kurt;
use gonia_brdf::quantile::quantile;
use gonia_brdf::{Brdf, Pose};
use gonia_imaging::SamplingGrid;
use gonia_pipeline::process::{FrameReport, Outcome};
use gonia_rig::{CameraModel, CameraShift, FrameRow, Placement, Reference, Rig};
use gonia_sim::scene::{Scene, SceneGeometry, as_built};
use std::sync::Arc;

/// Poses at which the rig is calibrated: more add less than the arms' own error.
const CALIBRATION_POSES: usize = 150;
/// Reflectance of the matt tile that lies on the target then.
const TILE: [f64; 3] = [0.97, 0.97, 0.96];
/// Every so manieth point of the grid is a place where directions are compared.
const POINT_STEP: usize = 40;

/// The rig as it is drawn and as it stands in the simulated lab.
pub struct DemoRig {
    /// What a drawing says.
    pub nominal: Rig,
    /// What is there.
    built: Rig,
    is_ideal: bool,
}

/// 95 % of directions are no further from the true ones than this, degrees.
pub struct DirectionErrors {
    /// Of the light.
    pub light_deg: f64,
    /// Of the camera.
    pub view_deg: f64,
}

impl DemoRig {
    /// The paper's rig with frames of so many pixels, built as a careful lab does, or ideally.
    pub fn new(frame_px: usize, is_ideal: bool) -> Self {
        let nominal = Rig::paper(frame_px);
        Self {
            built: match is_ideal {
                true => nominal.clone(),
                false => as_built(&nominal),
            },
            nominal,
            is_ideal,
        }
    }

    /// Whether nothing is to be found out about it.
    pub fn is_ideal(&self) -> bool {
        self.is_ideal
    }

    /// What its camera sees of a material.
    pub fn scene(&self, material: Arc<dyn Brdf>, seed: u64) -> Scene {
        let reference = Arc::new(Kurt::white_reference_fabric());
        match self.is_ideal {
            true => {
                let geometry = SceneGeometry::of_rig(&self.nominal);
                Scene::new(geometry, material, reference, seed)
            }
            false => Scene::as_built(&self.nominal, material, reference, seed),
        }
    }

    /// What a lab knows when it calibrates: the drawing, and its tile.
    pub fn with_tile(&self) -> Rig {
        Rig {
            reference: Some(Reference::lambertian(TILE)),
            ..self.nominal.clone()
        }
    }

    /// What the camera sees of the tile.
    pub fn scene_of_tile(&self, seed: u64) -> Scene {
        let tile = Arc::new(Kurt::new(TILE, &[]));
        // Another seed: its noise is not that of the session's frames.
        Scene::as_built(&self.nominal, tile.clone(), tile, seed.wrapping_add(1))
    }

    /// Poses for the calibration, spread evenly over the plan.
    pub fn calibration_poses(poses: &[Pose]) -> Vec<Pose> {
        let step = poses.len().div_ceil(CALIBRATION_POSES).max(1);
        poses.iter().step_by(step).copied().collect()
    }

    /// How far directions are off that the drawing puts to the arms' readings.
    pub fn errors_by_drawing(&self, frames: &SimulatedFrames) -> Option<DirectionErrors> {
        let camera = CameraModel::new(&self.nominal);
        let rows = frames.exposures().map(|(row, truth)| {
            let light = self.nominal.light_at(row.pose.light);
            let view = camera.placement(row.pose.view, CameraShift::default());
            (truth, light, view)
        });
        self.errors(rows)
    }

    /// How far the directions of samples are off that were made of frames by `rig`.
    pub fn errors_of(
        &self,
        rig: &Rig,
        frames: &SimulatedFrames,
        reports: &[FrameReport],
    ) -> Option<DirectionErrors> {
        let camera = CameraModel::new(rig);
        let rows: Vec<(&FrameRow, Pose)> = frames.exposures().collect();
        let used = reports
            .iter()
            .filter(|report| !matches!(report.outcome, Outcome::Refused(_)));
        let rows = used.filter_map(|report| {
            let (row, truth) = rows.get(report.frame as usize)?;
            let by = CameraShift {
                theta: report.pose_offset.theta_deg.to_radians(),
                phi: report.pose_offset.phi_deg.to_radians(),
                ..CameraShift::default()
            };
            let view = camera.placement(row.pose.view, by);
            Some((*truth, rig.light_at(row.pose.light), view))
        });
        self.errors(rows)
    }

    /// Of light and camera at some true poses, over the sample.
    fn errors(
        &self,
        rows: impl Iterator<Item = (Pose, Placement, Placement)>,
    ) -> Option<DirectionErrors> {
        let camera = CameraModel::new(&self.built);
        let grid = SamplingGrid::new(&self.nominal);
        let (mut of_light, mut of_view) = (Vec::new(), Vec::new());
        for (truth, light, view) in rows {
            let true_light = self.built.light_at(truth.light);
            let true_view = camera.placement(truth.view, CameraShift::default());
            for point in grid.points_mm().iter().step_by(POINT_STEP) {
                let off = |a: &Placement, b: &Placement| {
                    angle_between(a.direction_from(*point), b.direction_from(*point)).to_degrees()
                };
                of_light.push(off(&light, &true_light) as f32);
                of_view.push(off(&view, &true_view) as f32);
            }
        }
        Some(DirectionErrors {
            light_deg: quantile(&mut of_light, 0.95)?.into(),
            view_deg: quantile(&mut of_view, 0.95)?.into(),
        })
    }
}
