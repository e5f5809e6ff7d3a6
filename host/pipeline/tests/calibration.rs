//! Rigs that are not what their rig.toml says, found from their own frames.
#![allow(clippy::unwrap_used, clippy::panic)]

use gonia_brdf::direction::angle_between;
use gonia_brdf::model::{Kurt, Lambert};
use gonia_brdf::random::Random;
use gonia_brdf::{Direction, Pose, Vec3};
use gonia_formats::FileError;
use gonia_pipeline::calibrate::LightState;
use gonia_pipeline::process::FrameSource;
use gonia_pipeline::{CalibrateError, Calibrated, calibrate, silent};
use gonia_rig::{CameraModel, CameraShift, Frame, FrameRow, Reference, Rig, Role};
use gonia_sim::scene::{Scene, SceneGeometry};
use std::sync::Arc;

/// Frames of a rig as it is, at the poses that its arms read.
struct Rendered {
    scene: Scene,
    rows: Vec<FrameRow>,
    /// Standard deviation of the arms' true angles about their readings, degrees.
    jitter_deg: f64,
}

impl Rendered {
    fn new(truth: &Rig, rows: Vec<FrameRow>) -> Self {
        let mut scene = Scene::new(
            SceneGeometry::of_rig(truth),
            Arc::new(Kurt::two_thread_fabric()),
            Arc::new(Lambert { albedo: [0.9; 3] }),
            7,
        );
        scene.beam = None;
        Self {
            scene,
            rows,
            jitter_deg: 0.0,
        }
    }
}

impl FrameSource for Rendered {
    fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        let mut random = Random::new(u64::from(row.frame) + 77);
        let mut off = |d: Direction| {
            let mut by = || (self.jitter_deg * random.normal()).to_radians();
            Direction {
                theta: d.theta + by(),
                phi: d.phi + by(),
            }
        };
        let pose = Pose {
            light: off(row.pose.light),
            view: off(row.pose.view),
        };
        Ok(self.scene.frame(row.role, pose, u64::from(row.frame)))
    }
}

/// The directions of the paper's plan, degrees.
fn rings(with_85: bool) -> Vec<[f64; 2]> {
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

fn random_rows(role: Role, n: usize, seed: u64) -> Vec<FrameRow> {
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

fn nominal(px: usize) -> Rig {
    Rig {
        reference: Some(Reference::Reflectance([0.9; 3])),
        ..Rig::paper(px)
    }
}

/// A rig that is off by `much` of what a calibration allows for, in every number.
fn crooked(px: usize, much: f64, seed: u64) -> Rig {
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
fn errors(found: &Rig, truth: &Rig) -> [[f64; 3]; 2] {
    [0, 1].map(|i| {
        let mut all: Vec<f64> = rings(i == 0)
            .iter()
            .map(|[t, p]| {
                let pose = Pose::from_deg([*t, *p, *t, *p]);
                let (a, b) = (directions(found, pose)[i], directions(truth, pose)[i]);
                angle_between(a, b).to_degrees()
            })
            .collect();
        all.sort_by(f64::total_cmp);
        let at = |share: f64| all[(share * (all.len() - 1) as f64).round() as usize];
        [at(0.5), at(0.95), at(1.0)]
    })
}

fn run(source: &Rendered, px: usize) -> Result<Calibrated, CalibrateError> {
    calibrate(&nominal(px), source, &silent)
}

fn describe(found: &Calibrated, truth: &Rig) -> String {
    let mut text = format!(
        "frames {:?} lines {:?} light {:?} u {:?} arm {:?}\n",
        found.frames, found.lines_px, found.light, found.direction_u, found.camera_arm_deg
    );
    text += &format!("errors {:?}\n", errors(&found.rig, truth));
    for number in &found.numbers {
        text += &format!(
            "{} {} -> {} u {} {:?}\n",
            number.name, number.nominal, number.found, number.u, number.state
        );
    }
    text
}

#[test]
fn a_rig_that_is_off_in_everything_is_found_from_sixty_small_frames() {
    let truth = crooked(240, 1.0, 3);
    let source = Rendered::new(&truth, random_rows(Role::Reference, 60, 1));
    let found = run(&source, 240).unwrap();
    let said = describe(&found, &truth);
    let [light, view] = errors(&found.rig, &truth);
    assert!(matches!(found.light, LightState::Found { .. }), "{said}");
    assert!(light[1] < 0.03 && view[1] < 0.03, "{said}");
    eprintln!("{said}");
}
