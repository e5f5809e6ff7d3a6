//! A camera of one's own, in a whole session: a few poses on simulated arms into a session's folder.
//!
//! ```text
//! cargo run --release -p gonia-acquire --example own_camera
//! ```
//! The camera here computes its frames by a closure; a real one would wait for the frame of the last
//! trigger pulse in [`Camera::fetch`], and count frames that nobody triggered in [`Camera::ready`].

use gonia_acquire::camera::{Camera, CameraError, Pulse};
use gonia_acquire::capture::{
    Arms, Orders, SessionEvent, UnattendedSession, Watch, free_mb, simulated_arms,
};
use gonia_acquire::session::{
    Beginning, Claim, ControllerIdentity, Entry, SessionFolder, SessionProvenance, verify,
};
use gonia_brdf::model::Kurt;
use gonia_brdf::{Direction, Pose};
use gonia_formats::rig_toml::write_rig;
use gonia_rig::{Frame, FrameRow, Rig, SessionSettings};
use gonia_sim::fault::Arm;
use gonia_sim::scene::{Scene, SceneGeometry};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// The camera: a name, and a frame for each shot.
struct OwnCamera<F> {
    name: String,
    expose: F,
}

impl<F: FnMut(&FrameRow, &[Pulse]) -> Frame + Send> Camera for OwnCamera<F> {
    fn identity(&self) -> String {
        self.name.clone()
    }

    fn ready(&mut self, _strays: usize) -> Result<usize, CameraError> {
        // No frame is ever under way here.
        Ok(0)
    }

    fn fetch(&mut self, shot: &FrameRow, pulses: &[Pulse]) -> Result<Frame, CameraError> {
        Ok((self.expose)(shot, pulses))
    }

    fn reopen(&mut self) -> Result<(), CameraError> {
        Ok(())
    }
}

/// Prints what a person should know.
struct Printer;

impl Watch for Printer {
    fn on_event(&self, event: &SessionEvent) {
        match event {
            SessionEvent::Pose { done, .. } => {
                println!(
                    "pose {}: within {:.4} degrees",
                    done.index, done.pointing_deg
                );
            }
            SessionEvent::Note(text) => println!("{text}"),
            _ => {}
        }
    }
}

/// Measures six poses into a folder; the radiance of a point in the first frame.
// long: a whole session from the arms to its folder, to be read from top to bottom.
fn measure(folder: &Path) -> Result<[f32; 3], Box<dyn Error>> {
    // A rig with small frames, and a plan. Both usually come from files.
    let mut rig = Rig::paper(100);
    rig.sampling.grid_mm = 40.0;
    let settings = SessionSettings {
        reference: false,
        disk_reserve_mb: 1,
        ..SessionSettings::default()
    };
    rig.session = Some(settings.clone());
    let plan: Vec<Pose> = (0..6)
        .map(|k| Pose {
            light: Direction::from_deg(25.0 + f64::from(k), 170.0),
            view: Direction::from_deg(10.0, 175.0),
        })
        .collect();

    // The arms.
    let sim = simulated_arms(1, true);
    let (light, camera_arm) = (sim.port(Arm::Light), sim.port(Arm::Camera));
    let mut arms = Arms::connect(Box::new(light), Box::new(camera_arm))?;

    // The camera: whatever gives a frame for a shot.
    let fabric = Arc::new(Kurt::two_thread_fabric());
    let geometry = SceneGeometry::of_rig(&rig);
    let scene = Scene::new(geometry, fabric.clone(), fabric, 1);
    let camera = OwnCamera {
        name: "own camera, 100 x 100 px".to_owned(),
        expose: move |shot: &FrameRow, _: &[Pulse]| {
            scene.frame(shot.role, shot.pose, u64::from(shot.frame))
        },
    };

    // The session's folder.
    let given = tempfile::tempdir()?;
    let path = given.path().join("rig.toml");
    write_rig(&path, &rig)?;
    let provenance = SessionProvenance {
        program: "own_camera".to_owned(),
        began: String::new(),
        rig_crc: String::new(),
        plan_crc: String::new(),
        reference_crc: None,
        reference: settings.reference,
        camera: camera.identity(),
        seed: Some(1),
        light_arm: ControllerIdentity::from(arms.light().identity()),
        camera_arm: ControllerIdentity::from(arms.camera().identity()),
    };
    let mut writer = Claim::new(folder, None)?.begin(Beginning {
        rig: &std::fs::read(&path)?,
        beside: None,
        plan: &plan,
        provenance: &provenance,
    })?;
    writer.note(&Entry::Start("own_camera".to_owned()))?;
    let session = SessionFolder::open(folder)?;

    // All poses that are missing.
    let run = UnattendedSession {
        rig: session.rig(),
        settings: &settings,
        keep_frames: None,
        is_calibration: false,
        exact: false,
        orders: &Orders::default(),
        watch: &Printer,
        free_mb: &free_mb,
    };
    let ended = run.run(&mut arms, Box::new(camera), writer, &session)?;
    println!("{}, after {:.1} s", ended.reason, ended.took.as_secs_f64());

    // What is in the folder now.
    let verdict = verify(folder)?;
    let broken = verdict.broken().count();
    println!(
        "{} of {} poses, {broken} broken",
        verdict.done, verdict.planned
    );
    let session = SessionFolder::open(folder)?;
    let first = session.done().next().ok_or("no pose is done")?;
    let frame = session.frame(first)?;
    let point = frame.points.iter().flatten().next();
    Ok(point.ok_or("the first frame shows no point")?.rgb)
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let rgb = measure(&folder.path().join("session"))?;
    println!("radiance of the first point: {rgb:?}");
    Ok(())
}

#[test]
fn a_session_with_a_camera_of_ones_own_measures_every_pose() -> Result<(), Box<dyn Error>> {
    main()?;
    let folder = tempfile::tempdir()?;
    let rgb = measure(folder.path())?;
    assert!(rgb.iter().all(|value| *value > 0.0), "{rgb:?}");
    let verdict = verify(folder.path())?;
    assert_eq!((verdict.done, verdict.broken().count()), (6, 0));
    Ok(())
}
