//! What a session recovers from automatically, and what ends it cleanly.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "common/session.rs"]
mod session;

use gonia_acquire::camera::{Camera, CameraError, Pulse, RenderingCamera};
use gonia_acquire::capture::{
    Arms, Ended, Orders, SessionEvent, UnattendedSession, Watch, free_mb,
};
use gonia_acquire::session::{SessionEnd, SessionFolder, SessionWriter, verify};
use gonia_protocol::settings::Axis;
use gonia_rig::{Calibration, Frame, FrameRow, Rig};
use gonia_sim::arm::SimulatedArm;
use gonia_sim::fault::{Arm, Fault, FaultEvent, FaultPlan};
use gonia_sim::rig::SimRig;
use session::{begin, small_rig};
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

const POSES: usize = 12;

/// What the camera does at its calls of `fetch` (counted from 0), when it has seen the first pose so
/// often before.
type Trouble = fn(u32, u32) -> Option<Act>;

#[derive(Clone, Copy, PartialEq)]
enum Act {
    /// No frame comes.
    Late,
    /// A frame that nobody asked for comes after it.
    Extra,
    /// The lamp is darker.
    Dark,
    /// Something was moved.
    Moved,
    /// The frame shows nothing, if it is of the first pose.
    Black,
    /// The camera's software fails.
    Panic,
}

struct Troubled {
    camera: RenderingCamera,
    trouble: Trouble,
    calls: u32,
    first_pose: u32,
    extra: usize,
    changes: bool,
}

impl Camera for Troubled {
    fn identity(&self) -> String {
        "troubled".into()
    }

    fn ready(&mut self, _: usize) -> Result<usize, CameraError> {
        Ok(std::mem::take(&mut self.extra))
    }

    fn fetch(&mut self, shot: &FrameRow, pulses: &[Pulse]) -> Result<Frame, CameraError> {
        let act = (self.trouble)(self.calls, self.first_pose);
        self.calls += 1;
        self.first_pose += u32::from(shot.frame == 0);
        let mut frame = self.camera.fetch(shot, pulses)?;
        match act {
            Some(Act::Late) => {
                return Err(CameraError::Late {
                    came: 0,
                    expected: 1,
                    timeout_s: 0.0,
                });
            }
            Some(Act::Extra) => self.extra = 1,
            Some(Act::Dark) => {
                for pixel in &mut frame.rgb {
                    *pixel = pixel.map(|v| 0.9 * v);
                }
            }
            Some(Act::Moved) => {
                // The light comes from elsewhere: one side darker, the other brighter.
                for (i, pixel) in frame.rgb.iter_mut().enumerate() {
                    let share = 0.5 + (i % 100) as f32 / 100.0;
                    *pixel = pixel.map(|v| share * v);
                }
            }
            Some(Act::Black) if shot.frame == 0 => frame.rgb.fill([0.0; 3]),
            Some(Act::Black) => {}
            Some(Act::Panic) => panic!("of a camera, on purpose"),
            None => {}
        }
        Ok(frame)
    }

    fn reopen(&mut self) -> Result<(), CameraError> {
        Ok(())
    }

    fn changes_the_sample(&self) -> bool {
        self.changes
    }
}

struct Nobody;

impl Watch for Nobody {
    fn on_event(&self, _: &SessionEvent) {}
}

fn run(
    folder: &Path,
    writer: SessionWriter,
    faults: FaultPlan,
    trouble: Trouble,
    orders: &Orders,
    changes: bool,
) -> Ended {
    let calm = Surroundings::calm(orders);
    run_with(folder, writer, faults, &calm, |rig, sim| {
        Box::new(Troubled {
            camera: RenderingCamera::new(rig, sim, 1, POSES, true),
            trouble,
            calls: 0,
            first_pose: 0,
            extra: 0,
            changes,
        })
    })
}

/// What a session has about it, beside its bench.
struct Surroundings<'a> {
    orders: &'a Orders,
    watch: &'a dyn Watch,
    free_mb: &'a (dyn Fn(&Path) -> Option<u64> + Sync),
    keep_frames: bool,
}

impl<'a> Surroundings<'a> {
    fn calm(orders: &'a Orders) -> Self {
        Self {
            orders,
            watch: &Nobody,
            free_mb: &free_mb,
            keep_frames: false,
        }
    }
}

fn run_with(
    folder: &Path,
    writer: SessionWriter,
    faults: FaultPlan,
    surroundings: &Surroundings,
    camera: impl FnOnce(&Rig, SimRig) -> Box<dyn Camera>,
) -> Ended {
    let session = SessionFolder::open(folder).unwrap();
    let rig = session.rig().clone();
    let arms = [(); 2].map(|()| SimulatedArm::quiet_arm_near_home());
    let sim = SimRig::with_arms(1, faults, arms);
    let mut arms = Arms::connect(
        Box::new(sim.port(Arm::Light)),
        Box::new(sim.port(Arm::Camera)),
    )
    .unwrap();
    let session_run = UnattendedSession {
        rig: &rig,
        settings: rig.session.as_ref().unwrap(),
        keep_frames: surroundings.keep_frames.then(|| folder.to_owned()),
        is_calibration: false,
        exact: true,
        orders: surroundings.orders,
        watch: surroundings.watch,
        free_mb: surroundings.free_mb,
    };
    let camera = camera(&rig, sim);
    session_run
        .run(&mut arms, camera, writer, &session)
        .unwrap()
}

/// A session of the material alone under some trouble; its folder, and how it ended.
fn under(trouble: Trouble, faults: FaultPlan) -> (tempfile::TempDir, Ended) {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = small_rig();
    rig.session.as_mut().unwrap().reference = false;
    let writer = begin(folder.path(), &rig, POSES);
    let orders = Orders::default();
    let ended = run(folder.path(), writer, faults, trouble, &orders, true);
    (folder, ended)
}

/// The frames' checksums, by pose.
fn crcs(folder: &Path) -> Vec<(usize, u32)> {
    let session = SessionFolder::open(folder).unwrap();
    session.done().map(|p| (p.index, p.crc)).collect()
}

fn quiet(_: u32, _: u32) -> Option<Act> {
    None
}

fn journal(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("journal.log")).unwrap()
}

#[test]
fn missing_and_extra_frames_are_noticed_and_their_poses_taken_again() {
    let (calm, _) = under(quiet, FaultPlan::default());
    let (folder, ended) = under(
        |call, _| match call {
            2 => Some(Act::Late),
            6 => Some(Act::Extra),
            _ => None,
        },
        FaultPlan::default(),
    );
    assert_eq!(
        (ended.end, ended.retaken),
        (SessionEnd::Finished, 2),
        "{}",
        ended.reason
    );
    assert_eq!(crcs(folder.path()), crcs(calm.path()));
    let text = journal(folder.path());
    assert!(
        text.contains("0 of 1 frames came") && text.contains("belong to no trigger"),
        "{text}"
    );
}

#[test]
fn poses_measured_under_a_darker_lamp_are_measured_again_when_it_is_back() {
    let (calm, _) = under(quiet, FaultPlan::default());
    // The lamp comes back after the second look at the control pose.
    let (folder, ended) = under(
        |call, first_pose| (call > 3 && first_pose < 3).then_some(Act::Dark),
        FaultPlan::default(),
    );
    assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);
    assert_eq!(crcs(folder.path()), crcs(calm.path()));
    let text = journal(folder.path());
    assert!(
        text.contains(" void material since=") && text.contains("the lamp has drifted"),
        "{text}"
    );
    assert_eq!(verify(folder.path()).unwrap().broken().count(), 0);
}

#[test]
fn a_target_that_lies_turned_ends_a_session_at_its_first_pose_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = small_rig();
    rig.session.as_mut().unwrap().reference = false;
    (rig.target.mark_mm, rig.target.mark_radius_mm) = (Some([60.0, 372.0]), Some(30.0));
    let orders = Orders::default();
    let session = |writer, at: [f64; 2]| {
        let calm = Surroundings::calm(&orders);
        run_with(
            folder.path(),
            writer,
            FaultPlan::default(),
            &calm,
            |rig, sim| {
                let mut there = rig.clone();
                there.target.mark_mm = Some(at);
                Box::new(RenderingCamera::new(&there, sim, 1, POSES, true))
            },
        )
    };
    let writer = begin(folder.path(), &rig, POSES);
    let ended = session(writer, [-372.0, 60.0]);
    assert_eq!(ended.end, SessionEnd::Failed, "{}", ended.reason);
    assert!(
        ended.reason.contains("turned by 90 degrees anticlockwise")
            && ended.reason.contains("--resume")
            && ended.reason.lines().count() == 1,
        "{}",
        ended.reason
    );
    // Turned back, it goes on, and no pose of the turned target was kept.
    let (writer, before) = SessionWriter::resume(folder.path()).unwrap();
    assert_eq!(before.done().count(), 0);
    let ended = session(writer, [60.0, 372.0]);
    assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);
}

#[test]
fn a_calibrated_rig_that_has_moved_is_said_at_its_control_poses() {
    let run = |aim_mm: f64| {
        let folder = tempfile::tempdir().unwrap();
        let mut rig = small_rig();
        rig.session.as_mut().unwrap().reference = false;
        rig.calibration = Some(Calibration {
            names: vec!["camera.mount.aim_mm[0]".into()],
            values: vec![0.0],
            u: vec![0.05],
            covariance: vec![vec![0.0025]],
            ..Calibration::default()
        });
        let orders = Orders::default();
        let calm = Surroundings::calm(&orders);
        let writer = begin(folder.path(), &rig, POSES);
        let ended = run_with(
            folder.path(),
            writer,
            FaultPlan::default(),
            &calm,
            |rig, sim| {
                let mut there = rig.clone();
                there.camera.mount.aim_mm[0] = aim_mm;
                Box::new(RenderingCamera::new(&there, sim, 1, POSES, true))
            },
        );
        let text = journal(folder.path());
        let said = text
            .matches("the rig has moved since it was calibrated")
            .count();
        (ended, said, text)
    };
    let (ended, said, text) = run(0.0);
    assert_eq!((ended.end, said), (SessionEnd::Finished, 0), "{text}");
    // A millimetre: a tenth of a pixel. Frames are used, and each of the two controls says it.
    let (ended, said, text) = run(1.05);
    assert_eq!((ended.end, said), (SessionEnd::Finished, 2), "{text}");
    assert!(
        text.contains("0.09 pixels") || text.contains("0.08 pixels"),
        "{text}"
    );
    // Two centimetres: no frame is used, and the first one says why.
    let (_, said, text) = run(20.0);
    assert_eq!(said, 1, "{text}");
    assert!(text.contains("pixels to the right"), "{text}");
}

/// Ends the session as `kill -9` does, as far as its folder can tell: without the last line.
fn forget_the_stop(folder: &Path) {
    let text = journal(folder);
    let end = text.trim_end().rfind('\n').unwrap() + 1;
    assert!(text[end..].contains(" stop "), "{text}");
    std::fs::write(folder.join("journal.log"), &text[..end]).unwrap();
}

#[test]
fn poses_measured_under_a_darker_lamp_before_a_kill_are_measured_again_after_it() {
    let (calm, _) = under(quiet, FaultPlan::default());
    let folder = tempfile::tempdir().unwrap();
    let mut rig = small_rig();
    rig.session.as_mut().unwrap().reference = false;
    let writer = begin(folder.path(), &rig, POSES);
    let orders = Orders::default();
    // The lamp is a tenth darker from pose 3 on; the program dies after pose 5, before any control.
    struct EndAfter(Orders);
    impl Watch for EndAfter {
        fn on_event(&self, event: &SessionEvent) {
            if matches!(event, SessionEvent::Pose { done, .. } if done.index == 5) {
                self.0.interrupt();
            }
        }
    }
    let dark: Trouble = |call, _| (call >= 3).then_some(Act::Dark);
    let watch = EndAfter(orders.clone());
    let surroundings = Surroundings {
        watch: &watch,
        ..Surroundings::calm(&orders)
    };
    let camera = |trouble: Trouble| {
        move |rig: &Rig, sim: SimRig| -> Box<dyn Camera> {
            Box::new(Troubled {
                camera: RenderingCamera::new(rig, sim, 1, POSES, true),
                trouble,
                calls: 0,
                first_pose: 1,
                extra: 0,
                changes: true,
            })
        }
    };
    let none = FaultPlan::default;
    run_with(folder.path(), writer, none(), &surroundings, camera(dark));
    forget_the_stop(folder.path());
    assert!(crcs(folder.path()).len() >= 6);
    // It is still dark at the first control after the kill, and bright again after it.
    let later: Trouble = |call, _| (call == 0).then_some(Act::Dark);
    let (writer, _) = SessionWriter::resume(folder.path()).unwrap();
    let orders = Orders::default();
    let calm_again = Surroundings::calm(&orders);
    let ended = run_with(folder.path(), writer, none(), &calm_again, camera(later));
    assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);
    assert_eq!(crcs(folder.path()), crcs(calm.path()));
    assert!(journal(folder.path()).contains("judgement=drifted"));
}

#[test]
fn a_control_frame_that_shows_nothing_is_taken_once_more_and_ends_no_session() {
    let (calm, _) = under(quiet, FaultPlan::default());
    // The first control pose: the second frame of pose 0.
    let (folder, ended) = under(
        |_, first_pose| (first_pose == 1).then_some(Act::Black),
        FaultPlan::default(),
    );
    assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);
    assert_eq!(crcs(folder.path()), crcs(calm.path()));
    let text = journal(folder.path());
    assert!(text.contains("judgement=unconfirmed unseen"), "{text}");
    // Nothing speaks against the poses before it.
    assert!(!text.contains(" void "), "{text}");
}

#[test]
fn a_session_whose_watcher_or_camera_panics_goes_on() {
    let (calm, _) = under(quiet, FaultPlan::default());
    struct Panicking(AtomicU32);
    impl Watch for Panicking {
        fn on_event(&self, event: &SessionEvent) {
            let is_frame = matches!(
                event,
                SessionEvent::Frame { .. } | SessionEvent::Pose { .. }
            );
            if is_frame && self.0.fetch_add(1, Ordering::SeqCst) % 3 == 1 {
                panic!("of a watcher, on purpose");
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let mut rig = small_rig();
    rig.session.as_mut().unwrap().reference = false;
    let writer = begin(folder.path(), &rig, POSES);
    let orders = Orders::default();
    let watch = Panicking(AtomicU32::new(0));
    let surroundings = Surroundings {
        watch: &watch,
        ..Surroundings::calm(&orders)
    };
    let none = FaultPlan::default();
    let ended = run_with(folder.path(), writer, none, &surroundings, |rig, sim| {
        Box::new(Troubled {
            camera: RenderingCamera::new(rig, sim, 1, POSES, true),
            trouble: |call, _| (call == 4).then_some(Act::Panic),
            calls: 0,
            first_pose: 0,
            extra: 0,
            changes: true,
        })
    });
    assert_eq!(
        (ended.end, ended.retaken),
        (SessionEnd::Finished, 1),
        "{}",
        ended.reason
    );
    assert_eq!(crcs(folder.path()), crcs(calm.path()));
    assert!(journal(folder.path()).contains("a fault of this program (of a camera, on purpose)"));
}

#[test]
fn a_lamp_that_stays_dark_a_moved_sample_and_a_dead_camera_end_the_session_with_their_reason() {
    for (trouble, said) in [
        (
            (|call, _| (call > 3).then_some(Act::Dark)) as Trouble,
            "the lamp stays other",
        ),
        (
            |call, _| (call > 3).then_some(Act::Moved),
            "the control pose is not what it was",
        ),
        (
            |call, _| (call > 3).then_some(Act::Late),
            "tried 4 times in vain",
        ),
    ] {
        let (folder, ended) = under(trouble, FaultPlan::default());
        assert_eq!(ended.end, SessionEnd::Failed, "{said}: {}", ended.reason);
        assert!(ended.reason.contains(said), "{}", ended.reason);
        let text = journal(folder.path());
        assert!(
            text.lines().last().unwrap().contains("stop failed"),
            "{text}"
        );
        // Nothing measured after the change was kept: what is there is what a calm session has.
        let (calm, _) = under(quiet, FaultPlan::default());
        let expected = crcs(calm.path());
        assert!(
            crcs(folder.path())
                .iter()
                .all(|pose| expected.contains(pose))
        );
    }
}

#[test]
fn a_fault_and_a_cable_that_was_out_are_recovered_automatically() {
    let (calm, clear) = under(quiet, FaultPlan::default());
    let middle_us = clear.arms.duration_us / 2;
    let at = |us, fault| FaultEvent {
        at_us: us,
        arm: Arm::Camera,
        fault,
    };
    let lost = Fault::EncoderLost {
        axis: Axis::Theta,
        for_us: 300_000,
    };
    let plan = FaultPlan {
        events: vec![
            at(middle_us / 2, Fault::EncoderWarns { axis: Axis::Phi }),
            at(middle_us, lost),
            at(
                middle_us + 20_000_000,
                Fault::Unplugged { for_us: 5_000_000 },
            ),
        ],
        ..FaultPlan::default()
    };
    let (folder, ended) = under(quiet, plan);
    assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);
    assert!(ended.arms.recoveries > 0);
    assert_eq!(crcs(folder.path()), crcs(calm.path()));
    let journal = std::fs::read_to_string(folder.path().join("journal.log")).unwrap();
    let warned = "warning: camera arm, φ: encoder warns that it is near its limits (code 23); clean the ring";
    assert!(journal.contains(warned), "{journal}");
    let journal = std::fs::read_to_string(calm.path().join("journal.log")).unwrap();
    assert!(!journal.contains("warning"), "{journal}");
}

#[test]
fn a_full_disk_ends_the_session_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = small_rig();
    rig.session.as_mut().unwrap().disk_reserve_mb = u64::MAX / 2;
    let writer = begin(folder.path(), &rig, POSES);
    let orders = Orders::default();
    let ended = run(
        folder.path(),
        writer,
        FaultPlan::default(),
        quiet,
        &orders,
        true,
    );
    assert_eq!(ended.end, SessionEnd::Failed);
    assert!(ended.reason.contains("MB are reserved"), "{}", ended.reason);
    assert_eq!(crcs(folder.path()), []);
}

#[test]
fn on_a_bench_a_person_changes_the_sample_between_reference_and_material() {
    let folder = tempfile::tempdir().unwrap();
    let writer = begin(folder.path(), &small_rig(), POSES);
    let orders = Orders::default();
    let first = run(
        folder.path(),
        writer,
        FaultPlan::default(),
        quiet,
        &orders,
        false,
    );
    assert_eq!(first.end, SessionEnd::AwaitsMaterial);
    assert!(first.reason.contains("put the material on the target"));
    assert_eq!(verify(folder.path()).unwrap().done, POSES);
    let (writer, _) = SessionWriter::resume(folder.path()).unwrap();
    let second = run(
        folder.path(),
        writer,
        FaultPlan::default(),
        quiet,
        &orders,
        false,
    );
    assert_eq!(second.end, SessionEnd::Finished, "{}", second.reason);
    assert_eq!(verify(folder.path()).unwrap().done, 2 * POSES);
}

#[test]
fn orders_end_a_session_and_it_goes_on_from_there() {
    let folder = tempfile::tempdir().unwrap();
    let writer = begin(folder.path(), &small_rig(), POSES);
    let orders = Orders::default();
    orders.interrupt();
    let ended = run(
        folder.path(),
        writer,
        FaultPlan::default(),
        quiet,
        &orders,
        true,
    );
    assert_eq!(
        (ended.end, ended.reason.as_str()),
        (SessionEnd::Paused, "by Ctrl-C")
    );
    let (writer, _) = SessionWriter::resume(folder.path()).unwrap();
    let orders = Orders::default();
    let ended = run(
        folder.path(),
        writer,
        FaultPlan::default(),
        quiet,
        &orders,
        true,
    );
    assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);
}

fn calm_camera(rig: &Rig, sim: SimRig) -> Box<dyn Camera> {
    Box::new(RenderingCamera::new(rig, sim, 1, POSES, true))
}

#[test]
fn a_session_goes_on_by_itself_when_a_full_disk_has_room_again() {
    let (calm, _) = under(quiet, FaultPlan::default());
    let folder = tempfile::tempdir().unwrap();
    let mut rig = small_rig();
    let settings = rig.session.as_mut().unwrap();
    (settings.reference, settings.disk_reserve_mb) = (false, 500);
    let writer = begin(folder.path(), &rig, POSES);
    // Full from the fourth look on, for as long as one may wait.
    let looks = AtomicU32::new(0);
    let free_mb = |_: &Path| match looks.fetch_add(1, Ordering::SeqCst) {
        3..6 => Some(499),
        _ => Some(500),
    };
    let orders = Orders::default();
    let surroundings = Surroundings {
        free_mb: &free_mb,
        ..Surroundings::calm(&orders)
    };
    let none = FaultPlan::default();
    let ended = run_with(folder.path(), writer, none, &surroundings, calm_camera);
    assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);
    assert_eq!(crcs(folder.path()), crcs(calm.path()));
    let text = journal(folder.path());
    assert_eq!(
        text.matches("the disk has 499 MB left").count(),
        3,
        "{text}"
    );
}

/// With programs that stand in for a thermometer and a camera: shell scripts.
#[cfg(unix)]
mod programs {
    use super::*;
    use gonia_acquire::camera::CommandCamera;
    use gonia_rig::Thermometer;
    use std::sync::Mutex;

    /// Somebody who opens the window when it is too warm.
    struct Airing<'a> {
        reading: &'a Path,
        heard: Mutex<Vec<String>>,
        degrees: &'a str,
    }

    impl Airing<'_> {
        /// In one step: the thermometer may be read at any time.
        fn reads(&self, degrees: &str) {
            let next = self.reading.with_extension("next");
            std::fs::write(&next, degrees).unwrap();
            std::fs::rename(&next, self.reading).unwrap();
        }
    }

    impl Watch for Airing<'_> {
        fn on_event(&self, event: &SessionEvent) {
            match event {
                // Warm after the third pose.
                SessionEvent::Pose { done, .. } if done.index == 2 => {
                    self.reads("31.5");
                }
                SessionEvent::Note(text) => {
                    self.heard.lock().unwrap().push((*text).to_owned());
                    self.reads(self.degrees);
                }
                _ => {}
            }
        }
    }

    #[test]
    fn a_session_waits_while_it_is_too_warm_and_looks_at_the_control_pose_after_it() {
        for (degrees, end, looks) in [
            ("22", SessionEnd::Finished, 1),
            ("31.4", SessionEnd::Failed, 3),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let place = tempfile::tempdir().unwrap();
            let reading = place.path().join("degrees");
            std::fs::write(&reading, "21.5").unwrap();
            let mut rig = small_rig();
            let settings = rig.session.as_mut().unwrap();
            (settings.reference, settings.control_every) = (false, 1000);
            settings.thermometer = Some(Thermometer {
                run: vec!["cat".into(), reading.to_str().unwrap().into()],
                limits_c: [18.0, 26.0],
                every_s: 0.0,
            });
            let writer = begin(folder.path(), &rig, POSES);
            let airing = Airing {
                reading: &reading,
                heard: Mutex::default(),
                degrees,
            };
            let orders = Orders::default();
            let surroundings = Surroundings {
                watch: &airing,
                ..Surroundings::calm(&orders)
            };
            let none = FaultPlan::default();
            let ended = run_with(folder.path(), writer, none, &surroundings, calm_camera);
            assert_eq!(ended.end, end, "{}", ended.reason);
            let heard = airing.heard.into_inner().unwrap();
            assert_eq!(heard.len(), looks, "{heard:?}");
            assert!(
                heard[0].contains("31.5 degrees C, and 18 to 26"),
                "{heard:?}"
            );
            let text = journal(folder.path());
            if end == SessionEnd::Finished {
                // Once after the warmth, once at the end.
                assert_eq!(text.matches(" control ").count(), 2, "{text}");
                assert_eq!(crcs(folder.path()).len(), POSES);
            } else {
                assert!(ended.reason.contains("31.4 degrees C"), "{}", ended.reason);
            }
        }
    }

    /// The samples of every pose, in order.
    fn values(folder: &Path) -> Vec<Vec<Option<[f32; 3]>>> {
        let session = SessionFolder::open(folder).unwrap();
        let frames = session.done().map(|pose| session.frame(pose).unwrap());
        frames
            .map(|frame| {
                frame
                    .points
                    .iter()
                    .map(|p| p.as_ref().ok().map(|p| p.rgb))
                    .collect()
            })
            .collect()
    }

    #[test]
    fn a_whole_session_whose_frames_a_program_takes() {
        // What the program hands out: the frames of a session before.
        let before = tempfile::tempdir().unwrap();
        let writer = begin(before.path(), &small_rig(), POSES);
        std::fs::create_dir(before.path().join("frames")).unwrap();
        let orders = Orders::default();
        let surroundings = Surroundings {
            keep_frames: true,
            ..Surroundings::calm(&orders)
        };
        let none = FaultPlan::default();
        let ended = run_with(before.path(), writer, none, &surroundings, |rig, sim| {
            Box::new(Troubled {
                camera: RenderingCamera::new(rig, sim, 1, POSES, true),
                trouble: quiet,
                calls: 0,
                first_pose: 0,
                extra: 0,
                changes: true,
            })
        });
        assert_eq!(ended.end, SessionEnd::Finished, "{}", ended.reason);

        let folder = tempfile::tempdir().unwrap();
        let mut writer = Some(begin(folder.path(), &small_rig(), POSES));
        let frames = before.path().join("frames");
        // It fails once in the middle of the material, and leaves nothing once.
        let script = "n=$(printf %06d $2); cd \"$0\"; \
            if [ $1$2 = material5 ] && mkdir failed; then exit 3; fi; \
            if [ $1$2 = material6 ] && mkdir empty; then exit 0; fi; \
            cp $1_$n.exr \"$3.exr\"";
        let program = [
            "sh",
            "-c",
            script,
            frames.to_str().unwrap(),
            "{role}",
            "{index}",
            "{file}",
        ];
        let mut retaken = 0;
        for end in [SessionEnd::AwaitsMaterial, SessionEnd::Finished] {
            let writer = match writer.take() {
                Some(writer) => writer,
                // The material lies there now.
                None => SessionWriter::resume(folder.path()).unwrap().0,
            };
            let ended = run_with(
                folder.path(),
                writer,
                FaultPlan::default(),
                &Surroundings::calm(&orders),
                |rig, _| {
                    let program = program.map(str::to_owned).to_vec();
                    Box::new(CommandCamera::new(rig, program, 20.0))
                },
            );
            assert_eq!(ended.end, end, "{}", ended.reason);
            retaken += ended.retaken;
        }
        assert_eq!(retaken, 2);
        let text = journal(folder.path());
        assert!(
            text.contains("the program sh ended with exit status: 3"),
            "{text}"
        );
        assert!(text.contains("left 0 files where 1 are due"), "{text}");
        let (taken, given) = (values(folder.path()), values(before.path()));
        assert_eq!((taken.len(), given.len()), (2 * POSES, 2 * POSES));
        for (a, b) in taken.iter().flatten().zip(given.iter().flatten()) {
            // Frames in files are half floats.
            let near = match (a, b) {
                (Some(a), Some(b)) => (0..3).all(|c| (a[c] / b[c] - 1.0).abs() < 1e-3),
                (a, b) => a.is_none() && b.is_none(),
            };
            assert!(near, "{a:?} {b:?}");
        }
    }
}
