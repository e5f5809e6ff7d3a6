//! A rig as a careful lab builds one: close to its drawing, and nowhere quite on it.

use super::{Beam, Scene, SceneGeometry};
use gonia_brdf::Brdf;
use gonia_rig::{ArmGeometry, CameraMount, Rig, TargetPlace};
use std::sync::Arc;

/// The beam of its lamp: about 10 % darker at the far edge of the disc than at the centre.
const BEAM: Beam = Beam {
    width_deg: 30.0,
    axis_deg: [1.0, -0.8],
};

/// What stands in the lab when `nominal` is on the drawing: some millimetres, tenths of a degree and pixels
/// off in everything that a rig has.
#[must_use]
pub fn as_built(nominal: &Rig) -> Rig {
    let mut rig = nominal.clone();
    let camera = &mut rig.camera;
    camera.mount = CameraMount {
        roll_deg: 0.6,
        aim_mm: [4.0, 3.0],
    };
    camera.focal_px *= 0.996;
    camera.centre_px = [camera.centre_px[0] + 4.0, camera.centre_px[1] - 3.0];
    camera.k1 = -0.03;
    camera.arm = ArmGeometry {
        theta_zero_deg: 0.15,
        phi_zero_deg: -0.15,
        axis_miss_mm: 1.5,
        axis_square_deg: 0.05,
        right_mm: 0.0,
    };
    rig.light.distance_m *= 1.007;
    rig.light.arm = ArmGeometry {
        theta_zero_deg: -0.15,
        phi_zero_deg: 0.15,
        axis_miss_mm: -1.5,
        axis_square_deg: -0.05,
        right_mm: 6.0,
    };
    rig.target.place = TargetPlace {
        height_mm: 1.0,
        tilt_deg: [0.08, -0.06],
        ..TargetPlace::default()
    };
    rig
}

impl Scene {
    /// The scene of [`as_built`]`(nominal)`.
    pub fn as_built(
        nominal: &Rig,
        material: Arc<dyn Brdf>,
        reference: Arc<dyn Brdf>,
        seed: u64,
    ) -> Self {
        let geometry = SceneGeometry::of_rig(&as_built(nominal));
        let mut scene = Self::new(geometry, material, reference, seed);
        scene.beam = Some(BEAM);
        scene
    }
}
