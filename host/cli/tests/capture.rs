//! `gonia capture` as a person starts it, kills it, and starts it again.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;
#[path = "common/session.rs"]
mod session;

use common::{gonia, gonia_ok, refused, text};
use gonia_acquire::session::verify;
use session::{small_rig, write_small};
use std::path::Path;
use std::process::{Child, Command, Stdio};
#[cfg(unix)]
use std::time::Duration;
use std::time::Instant;

fn start(folder: &Path, resume: bool) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gonia"));
    command.args(["capture", text(&folder.join("s"))]);
    command.args(["--rig", text(&folder.join("rig.toml"))]);
    if resume {
        command.arg("--resume");
    } else {
        command.args(["--plan", text(&folder.join("plan.csv"))]);
    }
    command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Numbers that only look random.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, below: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 33) % below
    }
}

/// Runs sessions and kills them at random moments until so many kills have hit. Returns sessions.
fn survive(kills: u32, poses: usize) -> u32 {
    let undisturbed = tempfile::tempdir().unwrap();
    write_small(undisturbed.path(), &small_rig(), poses);
    let began = Instant::now();
    let output = start(undisturbed.path(), false).wait_with_output().unwrap();
    let whole = began.elapsed();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let samples = std::fs::read(undisturbed.path().join("s/samples.npy")).unwrap();
    let mut dice = Dice(u64::from(kills));
    let (mut hit, mut sessions) = (0, 0);
    while hit < kills {
        sessions += 1;
        let folder = tempfile::tempdir().unwrap();
        write_small(folder.path(), &small_rig(), poses);
        let session = folder.path().join("s");
        let (mut done, mut resume) = (0, false);
        loop {
            let mut child = start(folder.path(), resume);
            if hit < kills {
                // Anywhere in a session; every other time while it is being taken up again.
                let share = if dice.roll(2) == 0 { 100 } else { 30 };
                std::thread::sleep(whole.mul_f64(dice.roll(1000) as f64 * share as f64 * 1e-5));
                child.kill().unwrap();
            }
            let output = child.wait_with_output().unwrap();
            let errors = String::from_utf8_lossy(&output.stderr).into_owned();
            if output.status.success() {
                break;
            }
            assert_eq!(output.status.code(), None, "{errors}");
            hit += 1;
            if session.join("provenance.toml").exists() {
                let verdict = verify(&session).unwrap();
                assert_eq!(verdict.broken().count(), 0, "{:?}", verdict.findings);
                assert!(verdict.done >= done, "a pose that was done is lost");
                (done, resume) = (verdict.done, true);
            }
        }
        let verdict = verify(&session).unwrap();
        assert_eq!((verdict.done, verdict.broken().count()), (2 * poses, 0));
        assert!(
            std::fs::read(session.join("samples.npy")).unwrap() == samples,
            "the samples are not those of an undisturbed session"
        );
    }
    sessions
}

#[test]
fn a_session_killed_a_dozen_times_has_the_samples_of_an_undisturbed_one() {
    survive(12, 20);
}

#[test]
#[ignore = "minutes: 200 kills"]
fn sessions_survive_two_hundred_kills() {
    let began = Instant::now();
    let sessions = survive(200, 30);
    println!(
        "200 kills in {sessions} sessions of 60 poses, none lost and none doubled, {:.0} s",
        began.elapsed().as_secs_f64()
    );
}

/// A rig whose frames show enough for a calibration.
fn calibrated_session(folder: &Path) -> Vec<String> {
    let mut rig = small_rig();
    (rig.camera.width_px, rig.camera.height_px) = (400, 400);
    (rig.camera.focal_px, rig.camera.centre_px) = (625.0, [200.0; 2]);
    write_small(folder, &rig, 8);
    let at = |name: &str| text(&folder.join(name)).to_owned();
    vec![
        "capture".into(),
        at("s"),
        "--rig".into(),
        at("rig.toml"),
        "--plan".into(),
        at("plan.csv"),
        "--calibrate".into(),
    ]
}

#[test]
fn a_session_that_calibrates_first_goes_on_after_kills_with_the_rig_that_its_frames_show() {
    let undisturbed = tempfile::tempdir().unwrap();
    let arguments = calibrated_session(undisturbed.path());
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let output = gonia_ok(&arguments, "");
    let drawn = std::fs::read(undisturbed.path().join("rig.toml")).unwrap();
    let session = undisturbed.path().join("s");
    let found = std::fs::read(session.join("calibration/calibrated.toml")).unwrap();
    // The session's rig is the one found, and it is not the drawn one.
    assert_eq!(std::fs::read(session.join("rig.toml")).unwrap(), found);
    assert_eq!(
        std::fs::read(session.join("calibration/rig.toml")).unwrap(),
        drawn
    );
    let rig = gonia_formats::rig_toml::read_rig(&session.join("rig.toml")).unwrap();
    assert_eq!(rig.calibration.as_ref().unwrap().frames, 60, "{output}");
    // The simulated rig is built as a careful lab does: rolled by 0.6°.
    let roll_deg = rig.camera.mount.roll_deg;
    assert!((roll_deg - 0.6).abs() < 0.1, "{roll_deg}");
    assert!(session.join("calibration.svg").is_file());
    assert_eq!(verify(&session).unwrap().broken().count(), 0);
    let samples = std::fs::read(session.join("samples.npy")).unwrap();

    let folder = tempfile::tempdir().unwrap();
    let arguments = calibrated_session(folder.path());
    let session = folder.path().join("s");
    let start = |resume: bool| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gonia"));
        command.args(&arguments);
        if resume {
            command.arg("--resume");
        }
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command.spawn().unwrap()
    };
    // In the calibration's frames; behind them, before the rig is found; in the session.
    let lines = |path: &str| {
        let text = std::fs::read_to_string(session.join(path)).unwrap_or_default();
        text.matches(" pose ").count()
    };
    let moments: [&dyn Fn() -> bool; 3] = [
        &|| lines("calibration/journal.log") > 20,
        &|| lines("calibration/journal.log") > 59,
        &|| lines("journal.log") > 4,
    ];
    for (k, is_reached) in moments.into_iter().enumerate() {
        let mut child = start(k > 0);
        while !is_reached() {
            assert_eq!(child.try_wait().unwrap(), None, "{k}");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let output = start(true).wait_with_output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(std::fs::read(session.join("samples.npy")).unwrap() == samples);
}

#[test]
fn a_calibration_that_was_begun_and_another_rig_are_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = calibrated_session(folder.path());
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    // A folder with a calibration is no fresh one.
    let inner = folder.path().join("s/calibration");
    std::fs::create_dir_all(&inner).unwrap();
    std::fs::write(inner.join("provenance.toml"), "").unwrap();
    let said = refused(&arguments, "");
    assert!(
        said.contains("holds frames of a calibration already"),
        "{said}"
    );
    // A session that began without one.
    let other = tempfile::tempdir().unwrap();
    write_small(other.path(), &small_rig(), 2);
    let plain = [
        "capture",
        text(&other.path().join("s")),
        "--rig",
        text(&other.path().join("rig.toml")),
        "--plan",
        text(&other.path().join("plan.csv")),
    ]
    .map(str::to_owned);
    let plain: Vec<&str> = plain.iter().map(String::as_str).collect();
    gonia_ok(&plain, "");
    let again = [&plain[..], &["--resume", "--calibrate"]].concat();
    let said = refused(&again, "");
    assert!(said.contains("began without a calibration"), "{said}");
}

#[test]
// long: one session, and every command that may meet it.
fn a_session_makes_samples_and_what_does_not_fit_it_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    write_small(folder.path(), &small_rig(), 8);
    let (rig, plan, s) = (at("rig.toml"), at("plan.csv"), at("s"));
    let table = gonia_ok(
        &[
            "capture",
            &s,
            "--rig",
            &rig,
            "--plan",
            &plan,
            "--keep-frames",
        ],
        "",
    );
    assert!(
        table.contains("16 of 16") && table.contains("absolute"),
        "{table}"
    );
    let verified = gonia_ok(&["verify", &s], "");
    assert!(verified.contains("every pose is done"), "{verified}");

    // Its samples again, from the sampled frames and from the raw ones.
    let streamed = std::fs::read(at("s/samples.npy")).unwrap();
    gonia_ok(&["process", &s, "-o", &at("raw.npy")], "");
    let raw = std::fs::read(at("raw.npy")).unwrap();
    assert_eq!(raw.len(), streamed.len());
    std::fs::rename(at("s/frames.csv"), at("s/frames.csv.away")).unwrap();
    gonia_ok(&["process", &s, "-o", &at("again.npy")], "");
    assert!(std::fs::read(at("again.npy")).unwrap() == streamed);

    // A finished session has nothing left to do.
    gonia_ok(&["capture", &s, "--rig", &rig, "--resume"], "");

    let refused = |arguments: &[&str], said: &str| {
        let output = gonia(arguments, "");
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
        let lines: Vec<&str> = errors
            .lines()
            .filter(|l| l.starts_with("gonia: "))
            .collect();
        assert!(lines.len() == 1 && lines[0].contains(said), "{errors}");
    };
    refused(&["capture", &s, "--rig", &rig], "holds a session already");
    refused(&["verify", &at(".")], "holds no session");
    std::fs::create_dir(at("thesis")).unwrap();
    std::fs::write(at("thesis/a.tex"), "x").unwrap();
    refused(&["capture", &at("thesis"), "--rig", &rig], "is not empty");
    let other = at("other.csv");
    session_plan(&other, 9);
    let resume = ["capture", &s, "--rig", &rig, "--resume"];
    refused(
        &[&resume[..], &["--plan", &other]].concat(),
        "is not the plan",
    );
    let mut another = small_rig();
    another.light.distance_m = 1.2;
    gonia_formats::rig_toml::write_rig(Path::new(&at("other.toml")), &another).unwrap();
    refused(
        &["capture", &s, "--rig", &at("other.toml"), "--resume"],
        "is not the rig",
    );
    let mut bare = small_rig();
    bare.source = None;
    gonia_formats::rig_toml::write_rig(Path::new(&at("bare.toml")), &bare).unwrap();
    refused(
        &["capture", &at("u"), "--rig", &at("bare.toml")],
        "has no [source]",
    );
    bare.source = Some(gonia_rig::Source::Folder {
        path: ".".into(),
        timeout_s: 1.0,
    });
    gonia_formats::rig_toml::write_rig(Path::new(&at("bare.toml")), &bare).unwrap();
    let ports = [
        "--light",
        "/dev/null/nobody",
        "--camera-arm",
        "/dev/null/nobody",
    ];
    refused(
        &[
            &["capture", &at("v"), "--rig", &at("bare.toml")][..],
            &ports,
        ]
        .concat(),
        "/dev/null/nobody cannot be opened",
    );
    refused(
        &["capture", &at("v"), "--rig", &at("bare.toml")],
        "no port of the light arm",
    );

    // A plan that changed, and a frame that was damaged, under a session.
    let mut frames = std::fs::read(at("s/frames.bin")).unwrap();
    frames[100] ^= 1;
    std::fs::write(at("s/frames.bin"), frames).unwrap();
    refused(&["verify", &s], "frames.bin, reference pose 0: is damaged");
    std::fs::copy(&other, at("s/plan.csv")).unwrap();
    refused(
        &["verify", &s],
        "plan.csv: has changed since the session began",
    );
}

fn session_plan(path: &str, n: usize) {
    gonia_formats::plan_csv::write_plan_csv(Path::new(path), &session::small_plan(n)).unwrap();
}

#[test]
#[cfg(target_os = "linux")]
fn ctrl_c_ends_a_session_at_the_next_pose_and_a_second_capture_is_kept_out() {
    let folder = tempfile::tempdir().unwrap();
    write_small(folder.path(), &small_rig(), 400);
    let child = start(folder.path(), false);
    let s = folder.path().join("s");
    let began = Instant::now();
    while !s.join("frames.bin").exists() && began.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = start(folder.path(), true).wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(errors.contains("in use by another capture"), "{errors}");
    let signalled = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(signalled.success());
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("by Ctrl-C"), "{errors}");
    let verdict = verify(&s).unwrap();
    assert_eq!((verdict.kills, verdict.broken().count()), (0, 0));
    assert!(verdict.done < 800);
}

#[test]
#[cfg(target_os = "linux")]
fn a_terminal_that_closes_and_a_shutdown_end_a_session_as_ctrl_c_does() {
    for signal in ["-HUP", "-TERM"] {
        let folder = tempfile::tempdir().unwrap();
        write_small(folder.path(), &small_rig(), 400);
        let mut child = start(folder.path(), false);
        let s = folder.path().join("s");
        let began = Instant::now();
        let has_pose = || {
            let journal = std::fs::read_to_string(s.join("journal.log"));
            journal.is_ok_and(|text| text.contains(" pose "))
        };
        while !has_pose() && began.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(5));
        }
        // Nobody reads what it says any more, as when a connection drops.
        drop(child.stderr.take());
        let signalled = Command::new("kill")
            .args([signal, &child.id().to_string()])
            .status()
            .unwrap();
        assert!(signalled.success());
        assert_eq!(child.wait().unwrap().code(), Some(1), "{signal}");
        let text = std::fs::read_to_string(s.join("journal.log")).unwrap();
        assert!(
            text.lines().last().unwrap().contains("stop paused"),
            "{text}"
        );
        let verdict = verify(&s).unwrap();
        assert_eq!((verdict.kills, verdict.broken().count()), (0, 0));
    }
}

#[test]
#[cfg(unix)]
fn a_session_whose_terminal_is_closed_goes_on_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    write_small(folder.path(), &small_rig(), 8);
    let mut child = start(folder.path(), false);
    drop(child.stderr.take());
    assert!(child.wait().unwrap().success());
    let verdict = verify(&folder.path().join("s")).unwrap();
    assert_eq!((verdict.done, verdict.broken().count()), (16, 0));
}

#[test]
fn a_pose_is_left_out_without_another_plan() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    write_small(folder.path(), &small_rig(), 8);
    let (rig, plan, s) = (at("rig.toml"), at("plan.csv"), at("s"));
    let args = ["capture", &s, "--rig", &rig, "--plan", &plan, "--resume"];
    let with = |more: &str| {
        let mut all = args.to_vec();
        all.extend(["--leave-out", more]);
        gonia(&all, "")
    };
    let refused = with("8");
    assert_eq!(refused.status.code(), Some(1));
    let errors = String::from_utf8(refused.stderr).unwrap();
    assert!(
        errors.contains("the plan has 8 poses, counted from 0"),
        "{errors}"
    );
    let output = with("3");
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{errors}");
    let verdict = verify(Path::new(&s)).unwrap();
    assert_eq!((verdict.done, verdict.broken().count()), (14, 0));
    let text = std::fs::read_to_string(at("s/journal.log")).unwrap();
    assert!(
        text.contains("left-out material pose 3: left out by hand"),
        "{text}"
    );
}

#[test]
fn a_plan_keeps_the_arms_of_its_rig_apart() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let mut rig = small_rig();
    rig.arms = Some(gonia_rig::ArmPorts {
        light: "none".into(),
        camera: "none".into(),
        baud: gonia_rig::DEFAULT_BAUD,
        keep_out_deg: 20.0,
    });
    write_small(folder.path(), &rig, 8);
    let (rig, plan, s) = (at("rig.toml"), at("plan.csv"), at("s"));
    let rings = ["--views", "0:1,30:4", "--lights", "0:1,40:4"];
    let mut args = vec!["plan", &rig];
    args.extend(rings);
    // The zenith twice, and each of four pairs of one azimuth.
    let table = gonia_ok(&args, "");
    assert!(table.contains("5 poses nearer than 20 deg"), "{table}");
    args.extend(["--keep-out", "5"]);
    let output = gonia(&args, "");
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(errors.contains("touch below 20 degrees"), "{errors}");
    // Poses of the small plan are nearer than that.
    let output = gonia(&["capture", &s, "--rig", &rig, "--plan", &plan], "");
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        errors.contains("plan, pose 0: the arms would be"),
        "{errors}"
    );
    assert!(!Path::new(&s).join("provenance.toml").exists());
}

#[test]
#[cfg(target_os = "linux")]
fn a_disk_that_takes_nothing_for_a_while_costs_no_pose() {
    use std::io::{BufRead, BufReader};
    let alone = tempfile::tempdir().unwrap();
    write_small(alone.path(), &small_rig(), 20);
    let output = start(alone.path(), false).wait_with_output().unwrap();
    assert!(output.status.success());

    let folder = tempfile::tempdir().unwrap();
    let mut rig = small_rig();
    rig.session.as_mut().unwrap().max_retries = 30;
    write_small(folder.path(), &rig, 20);
    // Files may grow to 32 kB: what is beyond it the system refuses, in the middle of a frame.
    let script = "trap '' XFSZ; ulimit -S -f 64; exec \"$0\" \"$@\"";
    let mut child = Command::new("sh")
        .current_dir(folder.path())
        .args(["-c", script, env!("CARGO_BIN_EXE_gonia")])
        .args(["capture", "s", "--rig", "rig.toml", "--plan", "plan.csv"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let refused = lines
        .by_ref()
        .map(Result::unwrap)
        .find(|line| line.contains("frames.bin"));
    assert!(refused.unwrap().contains("pose "));
    let raised = Command::new("prlimit")
        .args(["--fsize=unlimited", "--pid", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(raised.success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert!(child.wait().unwrap().success(), "{rest:?}");
    let s = folder.path().join("s");
    let verdict = verify(&s).unwrap();
    assert_eq!((verdict.done, verdict.broken().count()), (40, 0));
    let samples = |folder: &Path| std::fs::read(folder.join("s/samples.npy")).unwrap();
    assert!(samples(folder.path()) == samples(alone.path()));
}

/// The simulated controllers and the camera, in real time, in a process of their own; they end with
/// this value.
#[cfg(unix)]
struct Bench(Child);

#[cfg(unix)]
impl Drop for Bench {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A bench in real time beside a session over so many poses in a folder: what `capture` is started with.
#[cfg(unix)]
fn real_bench(folder: &Path, poses: usize) -> (Bench, Vec<String>) {
    use std::io::{BufRead, BufReader};
    let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    std::fs::create_dir(at("incoming")).unwrap();
    let mut rig = small_rig();
    rig.source = Some(gonia_rig::Source::Folder {
        path: "incoming".into(),
        timeout_s: 10.0,
    });
    rig.session.as_mut().unwrap().reference = false;
    write_small(folder, &rig, poses);
    let (incoming, rig) = (at("incoming"), at("rig.toml"));
    let mut bench = Command::new(env!("CARGO_BIN_EXE_gonia"))
        .args(["sim-device", "--frames", &incoming, "--rig", &rig])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(bench.stdout.take().unwrap()).lines();
    let bench = Bench(bench);
    let [light, camera] = ["light arm", "camera arm"].map(|name| {
        let line = lines.next().unwrap().unwrap();
        line.strip_prefix(name).unwrap().trim().to_owned()
    });
    let (s, plan) = (at("s"), at("plan.csv"));
    let mut command = vec!["capture".into(), s, "--rig".into(), rig];
    command.extend(["--plan".into(), plan, "--resume".into()]);
    command.extend(["--light".into(), light, "--camera-arm".into(), camera]);
    (bench, command)
}

#[test]
#[cfg(unix)]
// long: one session, interrupted twice and resumed.
fn a_second_ctrl_c_stops_moving_arms_now_and_other_settings_are_refused_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let (_bench, command) = real_bench(folder.path(), 4);
    let mut child = Command::new(env!("CARGO_BIN_EXE_gonia"))
        .args(&command)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let light = command[command.len() - 3].as_str();
    let journal = folder.path().join("s/journal.log");
    let began = Instant::now();
    while !journal.exists() {
        assert!(began.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(20));
    }
    // Homing takes far longer than this test.
    std::thread::sleep(Duration::from_secs(2));
    let interrupt = |child: &Child| {
        let id = child.id().to_string();
        assert!(
            Command::new("kill")
                .args(["-INT", &id])
                .status()
                .unwrap()
                .success()
        );
    };
    interrupt(&child);
    std::thread::sleep(Duration::from_secs(1));
    assert!(
        child.try_wait().unwrap().is_none(),
        "one Ctrl-C stopped the arms"
    );
    interrupt(&child);
    let told = Instant::now();
    let output = child.wait_with_output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(told.elapsed() < Duration::from_secs(3), "{errors}");
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("by Ctrl-C, while homing"), "{errors}");
    let last = std::fs::read_to_string(&journal).unwrap();
    assert!(
        last.lines().last().unwrap().contains("stop paused"),
        "{last}"
    );
    // They slow down, and do not go on homing; a lease that ran out would be a fault.
    std::thread::sleep(Duration::from_secs(1));
    let status = gonia_ok(&["device", light, "status"], "");
    assert!(status.contains("state  unhomed"), "{status}");

    // Somebody turns a screw in between.
    gonia_ok(
        &["device", light, "set", "theta", "max_speed", "14000000"],
        "",
    );
    let output = gonia(&command.iter().map(String::as_str).collect::<Vec<_>>(), "");
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{errors}");
    let said: Vec<&str> = errors
        .lines()
        .filter(|l| l.starts_with("gonia: "))
        .collect();
    let [line] = said[..] else {
        panic!("{errors}");
    };
    assert!(
        line.contains("light arm: its settings (") && line.contains("restore them"),
        "{line}"
    );
    // With the settings it began with it is not refused; it homes again, and that is enough here.
    gonia_ok(
        &["device", light, "set", "theta", "max_speed", "15000000"],
        "",
    );
    let mut child = Command::new(env!("CARGO_BIN_EXE_gonia"))
        .args(&command)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_secs(2));
    assert!(child.try_wait().unwrap().is_none(), "it was refused");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
#[cfg(unix)]
#[ignore = "minutes: arms in real time"]
fn controllers_that_outlive_a_killed_host_are_taken_up_again() {
    let folder = tempfile::tempdir().unwrap();
    let (_bench, command) = real_bench(folder.path(), 24);
    // While homing, and then in the middle of moves and exposures.
    for seconds in [8.0, 45.0, 7.3, 9.1] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_gonia"))
            .args(&command)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_secs_f64(seconds));
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let table = gonia_ok(&command.iter().map(String::as_str).collect::<Vec<_>>(), "");
    println!("{table}");
    let verdict = verify(&folder.path().join("s")).unwrap();
    assert_eq!((verdict.done, verdict.kills), (24, 4));
    assert_eq!(verdict.broken().count(), 0);
    assert!(verdict.max_pointing_deg <= 0.03);
}
