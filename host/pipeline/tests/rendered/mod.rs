//! Rigs that are off, and frames of them: for the tests of calibration and for its bench.

use gonia_brdf::direction::angle_between;
use gonia_brdf::model::{Kurt, KurtLobe};
use gonia_brdf::random::Random;
use gonia_brdf::{Brdf, Direction, Pose, Vec3};
use gonia_formats::FileError;
use gonia_pipeline::process::FrameSource;
use gonia_rig::{CameraModel, CameraShift, Frame, FrameRow, Reference, Rig, Role};
use gonia_sim::scene::{Beam, MirrorPlate, Noise, Scene, SceneGeometry};
use rayon::prelude::*;
use std::sync::Arc;

/// Frames of a rig as it is, at the poses that its arms read.
pub struct Rendered {
    pub rows: Vec<FrameRow>,
    pub frames: Vec<Frame>,
}

/// What frames have beside the rig's geometry.
pub struct Scatter {
    /// Standard deviation of the arms about their readings, degrees.
    pub jitter_deg: f64,
    /// Shot noise of a typical pixel, relative; 0: no noise at all.
    pub noise: f64,
    /// Whether the light has a beam.
    pub beam: bool,
    /// Weight of the reference's glossy lobe; it is Lambertian otherwise.
    pub gloss: f64,
    pub seed: u64,
}

impl Rendered {
    /// Renders frames of a rig whose arms stand at their readings within `jitter_deg` (standard deviation).
    pub fn new(truth: &Rig, rows: Vec<FrameRow>, jitter_deg: f64) -> Self {
        let scatter = Scatter {
            jitter_deg,
            noise: 0.01,
            beam: false,
            gloss: 0.0,
            seed: 7,
        };
        Self::scattered(truth, rows, &scatter)
    }

    pub fn scattered(truth: &Rig, rows: Vec<FrameRow>, scatter: &Scatter) -> Self {
        let fabric = Arc::new(Kurt::two_thread_fabric());
        Self::of_material(truth, rows, scatter, fabric)
    }

    /// Frames of role material show this one.
    pub fn of_material(
        truth: &Rig,
        rows: Vec<FrameRow>,
        scatter: &Scatter,
        material: Arc<dyn Brdf>,
    ) -> Self {
        let gloss = KurtLobe {
            specular: [scatter.gloss; 3],
            f0: 0.05,
            mx: 0.3,
            my: 0.3,
            alpha: 0.3,
            azimuth_deg: 0.0,
        };
        let mut scene = Scene::new(
            SceneGeometry::of_rig(truth),
            material,
            Arc::new(Kurt::new([0.9; 3], &[gloss])),
            scatter.seed,
        );
        scene.beam = scatter.beam.then(Beam::default);
        scene.noise = (scatter.noise > 0.0).then(|| Noise {
            shot: scatter.noise,
            ..Noise::default()
        });
        // No mirror lies quite in the target's plane.
        scene.mirror = MirrorPlate {
            height_mm: 3.0,
            tilt_deg: [0.12, -0.08],
            ..MirrorPlate::default()
        };
        let mut random = Random::new(70 + scatter.seed);
        let mut off = |d: Direction| {
            let mut by = || (scatter.jitter_deg * random.normal()).to_radians();
            Direction {
                theta: d.theta + by(),
                phi: d.phi + by(),
            }
        };
        let stands = |row: &FrameRow| Pose {
            light: off(row.pose.light),
            view: off(row.pose.view),
        };
        let poses: Vec<Pose> = rows.iter().map(stands).collect();
        let frames = rows
            .par_iter()
            .zip(poses)
            .map(|(row, pose)| scene.frame(row.role, pose, u64::from(row.frame)))
            .collect();
        Self { frames, rows }
    }
}

impl FrameSource for Rendered {
    fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        let at = self.rows.iter().position(|r| r == row).unwrap();
        Ok(self.frames[at].clone())
    }
}

/// The directions of the paper's plan, degrees.
pub fn rings(with_85: bool) -> Vec<[f64; 2]> {
    let mut all = Vec::new();
    for (theta, n) in [
        (0, 1),
        (15, 6),
        (30, 12),
        (45, 18),
        (60, 20),
        (75, 24),
        (85, 24),
    ] {
        if theta < 85 || with_85 {
            all.extend((0..n).map(|j| [f64::from(theta), 360.0 * f64::from(j) / f64::from(n)]));
        }
    }
    all
}

pub fn random_rows(role: Role, n: usize, seed: u64) -> Vec<FrameRow> {
    let mut random = Random::new(seed);
    let (views, lights) = (rings(false), rings(true));
    let mut pick = |of: &[[f64; 2]]| of[(random.share() * of.len() as f64) as usize];
    (0..n)
        .map(|i| {
            let ([tv, pv], [ti, pi]) = (pick(&views), pick(&lights));
            FrameRow {
                frame: i as u32,
                role,
                pose: Pose::from_deg([ti, pi, tv, pv]),
                file: format!("frames/{i}.exr"),
            }
        })
        .collect()
}

pub fn nominal(px: usize) -> Rig {
    let mut rig = Rig::paper(px);
    rig.reference = Some(Reference::lambertian([0.9; 3]));
    rig.target.mirror_height_mm = Some(2.9);
    rig
}

/// A rig that is off by `much` of what a calibration allows for, in every number.
pub fn crooked(px: usize, much: f64, seed: u64) -> Rig {
    let mut random = Random::new(seed);
    let mut by = |most: f64| much * most * random.between(-1.0, 1.0);
    let mut rig = nominal(px);
    let camera = &mut rig.camera;
    camera.focal_px *= 1.0 + by(0.05);
    camera.distance_m *= 1.0 + by(0.05);
    camera.centre_px = camera.centre_px.map(|c| c + by(0.03) * px as f64);
    camera.k1 = by(0.1);
    camera.mount.roll_deg = by(5.0);
    camera.mount.aim_mm = [by(40.0), by(40.0)];
    for arm in [&mut camera.arm, &mut rig.light.arm] {
        arm.theta_zero_deg = by(2.0);
        arm.phi_zero_deg = by(2.0);
        arm.axis_miss_mm = by(4.0);
        arm.axis_square_deg = by(0.3);
        arm.right_mm = by(8.0);
    }
    rig.light.distance_m *= 1.0 + by(0.05);
    let place = &mut rig.target.place;
    place.height_mm = by(4.0);
    place.tilt_deg = [by(0.4), by(0.4)];
    place.offset_mm = [by(5.0), by(5.0)];
    rig
}

fn directions(rig: &Rig, pose: Pose) -> [Vec3; 2] {
    let camera = CameraModel::new(rig).placement(pose.view, CameraShift::default());
    [
        rig.light_at(pose.light).direction_from([0.0; 2]),
        camera.direction_from([0.0; 2]),
    ]
}

/// Angles between a rig's directions of light and view and the truth, degrees: median, 95th percentile and
/// maximum, over the paper's poses.
pub fn errors(found: &Rig, truth: &Rig) -> [[f64; 3]; 2] {
    [0, 1].map(|i| {
        let poses = rings(i == 0);
        let poses = poses.iter().map(|[t, p]| Pose::from_deg([*t, *p, *t, *p]));
        errors_at(poses, [found, truth])[i]
    })
}

/// The same over some poses.
pub fn errors_at(poses: impl Iterator<Item = Pose>, [found, truth]: [&Rig; 2]) -> [[f64; 3]; 2] {
    let apart = |pose: Pose| {
        let (a, b) = (directions(found, pose), directions(truth, pose));
        [0, 1].map(|i| angle_between(a[i], b[i]).to_degrees())
    };
    let all: Vec<[f64; 2]> = poses.map(apart).collect();
    [0, 1].map(|i| {
        let mut all: Vec<f64> = all.iter().map(|apart| apart[i]).collect();
        all.sort_by(f64::total_cmp);
        let at = |share: f64| all[(share * (all.len() - 1) as f64).round() as usize];
        [at(0.5), at(0.95), at(1.0)]
    })
}
