//! Sessions through a GigE Vision device on loopback: the simulated rig's frames, packet by packet.
#![cfg(feature = "genicam")]
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;
#[path = "common/session.rs"]
mod session;

use common::{gonia_ok, text};
use gonia_acquire::camera::genicam::CONTROL_PORT;
use gonia_acquire::camera::simulated_gige::{GigeError, GigeTrouble, GigeTroubles};
use gonia_acquire::camera::{Camera, CameraError, GenicamCamera, RenderingCamera, SimulatedGige};
use gonia_acquire::capture::{
    Arms, Ended, Orders, SessionEvent, ShotOptions, UnattendedSession, Watch, free_mb,
};
use gonia_acquire::session::{SessionEnd, SessionFolder, SessionWriter, verify};
use gonia_brdf::Elementary;
use gonia_brdf::model::Kurt;
use gonia_brdf::{Brdf, Direction};
use gonia_formats::samples::read_samples;
use gonia_rig::{Bayer, ExposureTiming, Genicam, Reference, Rig, Role, Sensor, Source};
use gonia_sim::arm::SimulatedArm;
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::rig::SimRig;
use session::{begin, small_rig};
use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const POSES: usize = 24;
const ALBEDO: [f64; 3] = [0.9, 0.8, 0.7];

/// Two cameras cannot stand at one address.
fn alone() -> MutexGuard<'static, ()> {
    static PORT: Mutex<()> = Mutex::new(());
    PORT.lock().unwrap_or_else(PoisonError::into_inner)
}

fn rig() -> Rig {
    let mut rig = small_rig();
    rig.reference = Some(Reference::lambertian(ALBEDO));
    rig.sensor = Some(Sensor {
        black_counts: 64.0,
        saturation_counts: 3900.0,
        gain_e_per_count: 10.0,
        read_noise_e: 8.0,
        bayer: Some(Bayer::Rggb),
    });
    rig.source = Some(Source::Genicam(setup()));
    let session = rig.session.as_mut().unwrap();
    session.exposures_s = vec![0.004, 0.016, 0.064];
    session.pause_s = 0.5;
    session.max_retries = 20;
    rig
}

fn setup() -> Genicam {
    Genicam {
        address: "127.0.0.1".into(),
        pixel_format: "BayerRG12".into(),
        trigger_source: "Line1".into(),
        exposure: ExposureTiming::Pulse,
        features: vec!["Width=100".into(), "Height=100".into()],
        timeout_s: 1.0,
    }
}

fn arms() -> SimRig {
    let arms = [(); 2].map(|()| SimulatedArm::quiet_arm_near_home());
    SimRig::with_arms(1, FaultPlan::default(), arms)
}

/// Puts the camera on the rig. Another program's tests may have one at the address for a while.
fn gige(rig: &Rig, sim: &SimRig, troubles: GigeTroubles) -> SimulatedGige {
    let until = Instant::now() + Duration::from_secs(120);
    loop {
        let surfaces: (Arc<dyn Brdf>, Arc<dyn Brdf>) = (
            Arc::new(Kurt::two_thread_fabric()),
            Arc::new(Kurt::new(ALBEDO, &[])),
        );
        let started =
            SimulatedGige::start(rig, sim.clone(), surfaces, 1, Ipv4Addr::LOCALHOST, troubles);
        match started {
            Ok(camera) => return camera,
            Err(GigeError::Address(..)) if Instant::now() < until => {
                std::thread::sleep(Duration::from_millis(200));
            }
            Err(error) => panic!("{error}"),
        }
    }
}

struct Nobody;

impl Watch for Nobody {
    fn on_event(&self, _: &SessionEvent) {}
}

fn run(folder: &Path, writer: SessionWriter, sim: &SimRig, camera: Box<dyn Camera>) -> Ended {
    let session = SessionFolder::open(folder).unwrap();
    let rig = session.rig();
    let mut arms = Arms::connect(
        Box::new(sim.port(Arm::Light)),
        Box::new(sim.port(Arm::Camera)),
    )
    .unwrap();
    let settings = rig.session.as_ref().unwrap();
    arms.set_options(ShotOptions {
        exposures_us: settings
            .exposures_s
            .iter()
            .map(|s| (s * 1e6) as u32)
            .collect(),
        ..ShotOptions::default()
    })
    .unwrap();
    let orders = Orders::default();
    let run = UnattendedSession {
        rig,
        settings,
        keep_frames: None,
        is_calibration: false,
        exact: false,
        orders: &orders,
        watch: &Nobody,
        free_mb: &free_mb,
    };
    run.run(&mut arms, camera, writer, &session).unwrap()
}

/// Reference and material through the camera; the person in between is this function.
fn session_under(pixel_format: &str, troubles: GigeTroubles) -> (tempfile::TempDir, [Ended; 2]) {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = rig();
    let setup = Genicam {
        pixel_format: pixel_format.into(),
        ..setup()
    };
    rig.source = Some(Source::Genicam(setup.clone()));
    let sim = arms();
    let device = gige(&rig, &sim, troubles);
    let exposures_s = &rig.session.as_ref().unwrap().exposures_s;
    let open = || {
        let camera = GenicamCamera::open(&rig, &setup, exposures_s);
        Box::new(camera.unwrap_or_else(|error| panic!("{error}")))
    };
    device.put(Role::Reference);
    let writer = begin(folder.path(), &rig, POSES);
    let first = run(folder.path(), writer, &sim, open());
    assert!(
        first.reason.contains("put the material"),
        "{}",
        first.reason
    );
    device.put(Role::Material);
    let (writer, _) = SessionWriter::resume(folder.path()).unwrap();
    let second = run(folder.path(), writer, &sim, open());
    println!("{} frames were sent", device.sent());
    (folder, [first, second])
}

/// The number of samples, and the mean and the RMS of the logarithms of value over truth.
fn judge(folder: &Path) -> (usize, f64, f64) {
    let file = folder.join("samples.npy");
    gonia_ok(&["process", text(folder), "-o", text(&file)], "");
    let samples = read_samples(&file).unwrap().samples;
    let material = Kurt::two_thread_fabric();
    let mut logs = Vec::new();
    for s in samples.iter() {
        let at = |t: f32, p: f32| Direction::from_deg(t.into(), p.into()).to_vec3();
        let f = material.eval(
            at(s.theta_i_deg, s.phi_i_deg),
            at(s.theta_v_deg, s.phi_v_deg),
        );
        logs.extend((0..3).map(|c| (f64::from(s.rgb[c]) / f[c]).natural_log()));
    }
    let n = logs.len() as f64;
    let rms = (logs.iter().map(|l| l * l).sum::<f64>() / n).sqrt();
    (samples.len(), logs.iter().sum::<f64>() / n, rms)
}

fn journal(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("journal.log")).unwrap()
}

#[test]
fn a_session_through_gige_vision_has_the_samples_of_the_simulated_camera_whatever_the_network_does()
{
    let _alone = alone();
    // The simulated camera itself.
    let direct = tempfile::tempdir().unwrap();
    let (sim, rig) = (arms(), rig());
    let camera = RenderingCamera::new(&rig, sim.clone(), 1, POSES, false);
    let writer = begin(direct.path(), &rig, POSES);
    let ended = run(direct.path(), writer, &sim, Box::new(camera));
    assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);
    let expected = judge(direct.path());

    let began = Instant::now();
    let (calm, ended) = session_under("BayerRG12", |_| None);
    println!("calm: {:.1} s", began.elapsed().as_secs_f64());
    assert_eq!(ended[1].end, SessionEnd::Finished, "{}", ended[1].reason);
    assert_eq!(ended.map(|e| e.retaken), [0, 0], "{}", journal(calm.path()));
    let calm = judge(calm.path());

    let began = Instant::now();
    // Packed: two counts in three bytes.
    let (troubled, ended) = session_under("BayerRG12p", |pulse| match pulse {
        10 => Some(GigeTrouble::PacketsLost(0.5)),
        31 | 120 => Some(GigeTrouble::PacketsLost(1.0)),
        52 => Some(GigeTrouble::Late(Duration::from_millis(1500))),
        67 | 130 => Some(GigeTrouble::Extra),
        94 => Some(GigeTrouble::Dies(Duration::from_secs(2))),
        _ => None,
    });
    println!("troubled: {:.1} s", began.elapsed().as_secs_f64());
    let text = journal(troubled.path());
    // Each is recovered by a retake or two.
    let retaken = ended[0].retaken + ended[1].retaken;
    assert!((7..=14).contains(&retaken), "{retaken}: {text}");
    assert_eq!(ended[1].end, SessionEnd::Finished, "{}", ended[1].reason);
    let verdict = verify(troubled.path()).unwrap();
    assert_eq!((verdict.done, verdict.broken().count()), (2 * POSES, 0));
    for said in [
        "arrived incomplete",
        "of 3 frames came within 1 s",
        "the frames are not those of the trigger pulses",
    ] {
        assert!(text.contains(said), "{said}: {text}");
    }
    let troubled = judge(troubled.path());

    println!("samples, bias, RMS of the logarithm: {expected:?} {calm:?} {troubled:?}");
    for (n, bias, rms) in [calm, troubled] {
        assert_eq!(n, expected.0);
        // Noise of a hundredth in ten thousand values; the sensor's is a little more than the scene's. A
        // mosaic measures a channel at a quarter to a half of the pixels: neighbours share their noise, and
        // a patch averages up to 1.8 times less of it. Measured: 1.30.
        assert!((bias - expected.1).abs() < 5e-4, "{bias}");
        assert!(rms < 1.4 * expected.2, "{rms}");
    }
}

#[test]
fn a_camera_that_is_not_there_or_not_as_the_rig_says_is_refused_in_one_line_until_it_is_back() {
    let _alone = alone();
    let refused = |rig: &Rig, setup: &Genicam, exposures: &[f64]| match GenicamCamera::open(
        rig, setup, exposures,
    ) {
        Err(error @ (CameraError::Device { .. } | CameraError::NoSensor)) => {
            let text = error.to_string();
            assert!(!text.contains('\n'), "{text}");
            text
        }
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("it was opened"),
    };
    let rig = rig();
    let nobody = Genicam {
        address: "127.9.8.7".into(),
        ..setup()
    };
    let text = refused(&rig, &nobody, &[0.01]);
    assert!(
        text.contains("the camera at 127.9.8.7: cannot be opened"),
        "{text}"
    );
    let device = gige(&rig, &arms(), |_| None);
    let plain = Genicam {
        features: Vec::new(),
        ..setup()
    };
    let text = refused(&rig, &plain, &[0.01]);
    assert!(
        text.contains("gives 512 x 512 pixels, and rig.toml says 100 x 100"),
        "{text}"
    );
    let odd = Genicam {
        features: vec!["Sharpness=3".into()],
        ..setup()
    };
    let text = refused(&rig, &odd, &[0.01]);
    assert!(
        text.contains("refuses a setting") && text.contains("Sharpness"),
        "{text}"
    );
    let other = Genicam {
        trigger_source: "Line7".into(),
        ..setup()
    };
    let text = refused(&rig, &other, &[0.01]);
    assert!(
        text.contains("refuses a setting") && text.contains("Line7"),
        "{text}"
    );
    // After all of these it is free, and says who it is.
    let mut camera = GenicamCamera::open(&rig, &setup(), &[0.01]).unwrap();
    let identity = camera.identity();
    assert!(
        identity.contains("serial sim-1") && identity.contains("BayerRG12 of 100 x 100 px"),
        "{identity}"
    );
    // One camera has one master.
    let text = refused(&rig, &setup(), &[0.01]);
    assert!(
        text.contains("the camera at 127.0.0.1: is used by another program; end that one"),
        "{text}"
    );
    drop(device);
    let gone = camera.reopen().unwrap_err().to_string();
    assert!(gone.contains("cannot be opened"), "{gone}");
    assert!(camera.ready(0).is_err());
    let _device = gige(&rig, &arms(), |_| None);
    camera.reopen().unwrap();
    assert_eq!(camera.ready(0).unwrap(), 0);
}

#[test]
fn a_camera_that_a_killed_program_held_is_waited_for() {
    let _alone = alone();
    let rig = rig();
    let _device = gige(&rig, &arms(), |_| None);
    // What takes control (GigE Vision's register 0xA00), and is never heard of again.
    let killed = UdpSocket::bind("127.0.0.1:0").unwrap();
    let timeout = Some(Duration::from_secs(5));
    killed.set_read_timeout(timeout).unwrap();
    let mut answer = [0; 64];
    killed
        .send_to(
            &[0x42, 1, 0, 0x82, 0, 8, 0, 1, 0, 0, 0x0a, 0, 0, 0, 0, 2],
            (Ipv4Addr::LOCALHOST, CONTROL_PORT),
        )
        .unwrap();
    // Acknowledged, without an error.
    assert_eq!(killed.recv(&mut answer).unwrap(), 12);
    assert_eq!(answer[..4], [0, 0, 0, 0x83]);
    let start = Instant::now();
    let camera = GenicamCamera::open(&rig, &setup(), &[0.01]).unwrap();
    assert!(camera.identity().contains("serial sim-1"));
    assert!(start.elapsed() > Duration::from_secs(1), "it was not held");
}
