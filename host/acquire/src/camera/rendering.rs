//! The simulated rig's camera in a session: it renders a frame for each shot that is fetched.

use crate::camera::source::{Camera, CameraError, Pulse};
use gonia_brdf::Vec3;
use gonia_brdf::model::{Brdf, Kurt};
use gonia_rig::{Frame, FrameRow, Reflectance, Rig, Role};
use gonia_sim::rig::SimRig;
use gonia_sim::scene::{Scene, SceneGeometry};
use std::sync::Arc;

/// A camera on the simulated rig.
pub struct RenderingCamera {
    arms: SimRig,
    scene: Scene,
    planned: usize,
    exact: bool,
}

impl RenderingCamera {
    /// A camera that looks at the demo's fabric. `planned`, the poses of the plan, keeps the noise of
    /// reference and material apart. An exact camera renders the pose of the arms' reading, not that of
    /// the true shafts.
    pub fn new(rig: &Rig, arms: SimRig, seed: u64, planned: usize, exact: bool) -> Self {
        let reference: Arc<dyn Brdf> = match rig.reference.as_ref().map(|of| &of.reflectance) {
            Some(Reflectance::Lambertian(albedo)) => Arc::new(Lambertian(*albedo)),
            _ => Arc::new(Kurt::white_reference_fabric()),
        };
        let material = Arc::new(Kurt::two_thread_fabric());
        Self {
            arms,
            scene: Scene::new(SceneGeometry::of_rig(rig), material, reference, seed),
            planned,
            exact,
        }
    }
}

impl Camera for RenderingCamera {
    fn identity(&self) -> String {
        format!(
            "simulated, {} x {} px",
            self.scene.geometry.width_px, self.scene.geometry.height_px
        )
    }

    fn ready(&mut self, _: usize) -> Result<usize, CameraError> {
        Ok(0)
    }

    fn fetch(&mut self, shot: &FrameRow, _: &[Pulse]) -> Result<Frame, CameraError> {
        // The next trigger comes only after this: the last one is this shot's.
        let pose = if self.exact {
            shot.pose
        } else {
            let last = self.arms.true_pose_at_last_trigger();
            last.ok_or(CameraError::NoTrigger)?
        };
        let first = match shot.role {
            Role::Reference => 0,
            Role::Material => self.planned,
            Role::Mirror => 2 * self.planned,
        };
        let noise = (first + shot.frame as usize) as u64;
        Ok(self.scene.frame(shot.role, pose, noise))
    }

    fn reopen(&mut self) -> Result<(), CameraError> {
        Ok(())
    }

    fn changes_the_sample(&self) -> bool {
        true
    }
}

/// The ideal diffuse reference of an albedo.
struct Lambertian([f64; 3]);

impl Brdf for Lambertian {
    fn eval(&self, _: Vec3, _: Vec3) -> [f64; 3] {
        self.0.map(|rho| rho * std::f64::consts::FRAC_1_PI)
    }
}
