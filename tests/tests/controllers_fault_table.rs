//! The table of faults: each is injected into a session of the real host and the real firmware core, the
//! outcome is compared with the row, and the rows stand between marks in the book's page of faults.
//!
//! `GONIA_UPDATE_DOCS=1 cargo test -p gonia-tests --test controllers_fault_table` writes them;
//! without it the test fails when the page says something else.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::fmt::Write as _;
use std::path::Path;

use gonia_acquire::capture::{Arms, POINTING_LIMIT_DEG, SessionError, ShotOutcome, run_session};
use gonia_acquire::link::{LinkError, RemoteController, calibrate_axis};
use gonia_brdf::direction::angle_between;
use gonia_brdf::{Direction, Pose};
use gonia_firmware::driver::DriverBus;
use gonia_protocol::NODE_LIGHT;
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, RequestRefusal};
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::arm::SimulatedArm;
use gonia_sim::fault::{Arm, Fault, FaultEvent, FaultPlan, WireFaults};
use gonia_sim::plant::{HomeCam, PlantConfig};
use gonia_sim::rig::SimRig;

/// The book's page of faults.
const PAGE: &str = "../docs/src/reference/faults.md";
/// In the midst of a move of the session.
const STRIKE_US: u64 = 62_345_678;
const N_POSES: usize = 30;
const THETA: Axis = Axis::Theta;
/// Counts of a quadrature ring, and the one at which its index is: 30°.
const RING: u32 = 80_000;
const RING_INDEX: u32 = RING / 12;
/// Arms whose directions are nearer than this touch, on a rig that is built so.
const KEEP_OUT_DEG: f64 = 25.0;

/// What goes wrong.
enum Cause {
    /// At [`STRIKE_US`], on the light arm.
    Event(Fault),
    /// Before homing, on the light arm.
    FromTheStart(Fault),
    /// On both wires, all the time.
    Wire(WireFaults),
    /// θ of the light arm is built like this.
    Axis(fn(&mut PlantConfig)),
    /// φ of the light arm is built like this.
    PhiAxis(fn(&mut PlantConfig)),
    /// The same, after a person has adjusted it on the test bench.
    Adjusted(fn(&mut PlantConfig), fn(&SimRig, &mut RemoteController)),
    /// The driver of θ on the light arm reports an alarm, as its setting says.
    Alarm,
    /// The drivers of the light arm are set by wire, as the setting says, and one loses its supply for a moment.
    DriverReset,
    /// At [`STRIKE_US`], on θ of the light arm, which has a quadrature ring with an index.
    Quadrature(Fault),
    /// The power goes while the host saves settings.
    TornSave,
    /// The host falls silent during a move.
    HostGone,
    /// A target in the desk.
    BeyondLimits,
    /// A pose whose light and view are too near to each other; the host knows how near that is.
    KeepOut,
    /// No pose is, but the straight way between two of them leads one arm through the other.
    KeepOutOnTheWay,
    /// The arms come too near to each other on their way, and a switch between them opens.
    Bumper,
    /// The camera gives no frame for the sixth pose.
    CameraNotReady,
}

/// The outcome.
#[derive(Debug, PartialEq)]
enum End {
    /// Every pose kept; whether a shot was retaken, and an arm brought back.
    Complete { retaken: bool, recovered: bool },
    /// Some poses given up, each with its reason.
    Refused,
    /// The session stopped, its reason containing this.
    Stopped(&'static str),
    /// The request was refused, and nothing else happened.
    RequestRefused,
}

struct Row {
    fault: &'static str,
    cause: Cause,
    does: &'static str,
    codes: &'static [FaultCode],
    end: End,
    host: &'static str,
}

/// A table, so longer than a function should be.
// long: a table, one entry a fault.
fn rows() -> Vec<Row> {
    let event = |fault, cause, does, codes, end, host| Row {
        fault,
        cause: Cause::Event(cause),
        does,
        codes,
        end,
        host,
    };
    let over_it = || End::Complete {
        retaken: true,
        recovered: true,
    };
    let nothing = || End::Complete {
        retaken: false,
        recovered: false,
    };
    let retaken = || End::Complete {
        retaken: true,
        recovered: false,
    };
    const HOMES: &str = "clears the fault, homes, takes the pose again";
    const DISAGREE: &[FaultCode] = &[FaultCode::STEP_LOSS];
    vec![
        event(
            "missed steps: 3 magnetic cycles, 0.24°",
            Fault::LoseCycles {
                axis: THETA,
                cycles: 3,
            },
            "corrects by the encoder; at rest steps and encoder differ: latched fault",
            DISAGREE,
            over_it(),
            HOMES,
        ),
        event(
            "motor stalls for 3 s",
            Fault::Stall {
                axis: THETA,
                for_us: 3_000_000,
            },
            "stops both axes when the encoder falls behind by following_limit",
            &[FaultCode::FOLLOWING_ERROR],
            over_it(),
            HOMES,
        ),
        event(
            "gear slips by 0.15°",
            Fault::Slip {
                axis: THETA,
                udeg: -150_000.0,
            },
            "corrects by the encoder; at rest steps and encoder differ: latched fault",
            DISAGREE,
            over_it(),
            HOMES,
        ),
        Row {
            fault: "backlash of 0.15°, backlash_takeup 0.1°",
            cause: Cause::Axis(|theta| theta.backlash_udeg = 150_000.0),
            does: "corrects; latched fault where that does not suffice, or where steps and encoder differ at rest",
            codes: &[FaultCode::NOT_REACHED, FaultCode::STEP_LOSS],
            end: End::Refused,
            host: "homes and tries again, then gives the pose up with its reason",
        },
        Row {
            fault: "backlash of 0.15°, backlash_takeup raised to 0.3°",
            cause: Cause::Adjusted(
                |theta| theta.backlash_udeg = 150_000.0,
                |_, light| {
                    let set = light.set_setting(THETA, Key::BacklashTakeup, 300_000);
                    set.unwrap();
                },
            ),
            does: "comes to every target from below",
            codes: &[],
            end: nothing(),
            host: "nothing to do",
        },
        event(
            "encoder silent for 3 ms",
            Fault::EncoderLost {
                axis: THETA,
                for_us: 3_000,
            },
            "leaves out one or two readings",
            &[],
            nothing(),
            "nothing to do",
        ),
        event(
            "encoder silent for 0.5 s",
            Fault::EncoderLost {
                axis: THETA,
                for_us: 500_000,
            },
            "stops both axes after three readings",
            &[FaultCode::ENCODER_LOST],
            over_it(),
            HOMES,
        ),
        event(
            "encoder noise of 0.02° for 60 s",
            Fault::EncoderNoise {
                axis: THETA,
                udeg: 20_000.0,
                for_us: 60_000_000,
            },
            "does not settle; latched fault when its corrections are used up; home is kept",
            &[FaultCode::NOT_REACHED],
            End::Refused,
            "tries four times, gives the pose up with its reason, goes on",
        ),
        event(
            "encoder jumps by 5° and stays there",
            Fault::EncoderJump {
                axis: THETA,
                udeg: 5e6,
            },
            "stops both axes: no arm moves so fast; homing finds that switch and encoder disagree",
            &[FaultCode::ENCODER_JUMP, FaultCode::HOME_MISMATCH],
            End::Stopped("home switch and encoder disagree"),
            "tries to home, stops the session",
        ),
        event(
            "encoder shifts by 0.1° and stays there",
            Fault::EncoderJump {
                axis: THETA,
                udeg: 100_000.0,
            },
            "moves after it; at rest steps and encoder differ: latched fault; homing shows which is wrong",
            &[FaultCode::STEP_LOSS, FaultCode::HOME_MISMATCH],
            End::Stopped("home switch and encoder disagree"),
            "tries to home, stops the session",
        ),
        Row {
            fault: "eccentricity of 0.05°, never calibrated",
            cause: Cause::Axis(eccentric),
            does: "latched fault where steps and encoder differ at rest",
            codes: DISAGREE,
            end: End::Refused,
            host: "homes and tries again, then gives the pose up (`gonia device PORT identify` names the axis)",
        },
        Row {
            fault: "eccentricity of 0.05°, calibrated",
            cause: Cause::Adjusted(eccentric, calibrate_theta),
            does: "takes the error map off every reading",
            codes: &[],
            end: nothing(),
            host: "nothing to do",
        },
        Row {
            fault: "home switch stuck as at home",
            cause: Cause::FromTheStart(Fault::SwitchStuck {
                axis: THETA,
                at_home: Some(true),
            }),
            does: "gives up homing after the way that clears any switch",
            codes: &[FaultCode::HOME_SWITCH_STUCK],
            end: End::Stopped("home switch says home above it too"),
            host: "stops the session",
        },
        Row {
            fault: "home switch stuck as above home",
            cause: Cause::FromTheStart(Fault::SwitchStuck {
                axis: THETA,
                at_home: Some(false),
            }),
            does: "stops at the end of the travel",
            codes: &[FaultCode::HOME_NOT_FOUND],
            end: End::Stopped("home switch not found"),
            host: "stops the session",
        },
        Row {
            fault: "cable of the home switch cut (normally closed)",
            cause: Cause::FromTheStart(Fault::SwitchCut { axis: THETA }),
            does: "takes it for home, and gives up homing after the way that clears any switch; no step down",
            codes: &[FaultCode::HOME_SWITCH_STUCK],
            end: End::Stopped("home switch says home above it too"),
            host: "stops the session",
        },
        Row {
            fault: "φ travels two turns, and a cam works its home switch once a turn",
            cause: Cause::PhiAxis(|phi| phi.home_cam = HomeCam::EveryTurn { width_udeg: 2e6 }),
            does: "drives on below home by home_probe, and finds that the switch lets go there",
            codes: &[FaultCode::HOME_AMBIGUOUS],
            end: End::Stopped("home switch lets go below home"),
            host: "stops the session",
        },
        Row {
            fault: "home switch bounces for 40 ms",
            cause: Cause::FromTheStart(Fault::SwitchBounces {
                axis: THETA,
                bounce_us: 40_000,
            }),
            does: "waits for steady readings; the angle is the encoder's",
            codes: &[],
            end: nothing(),
            host: "nothing to do",
        },
        Row {
            fault: "driver set by wire (TMC2209) loses its supply for a moment in mid-move",
            cause: Cause::DriverReset,
            does: "stops both axes, switches the drivers' current off; cleared, it writes their settings again",
            codes: &[FaultCode::DRIVER_RESET],
            end: over_it(),
            host: HOMES,
        },
        event(
            "encoder's warning bit set for the rest of the session",
            Fault::EncoderWarns { axis: THETA },
            "reports and logs it once (code 23), and goes on",
            &[],
            nothing(),
            "notes it in the journal as a warning",
        ),
        Row {
            fault: "quadrature ring: an edge is lost in mid-move",
            cause: Cause::Quadrature(Fault::EdgesLost {
                axis: THETA,
                counts: 1,
            }),
            does: "stops both axes at once; homing looks for the index anew",
            codes: &[FaultCode::EDGE_LOST],
            end: over_it(),
            host: HOMES,
        },
        Row {
            fault: "quadrature ring: four counts are lost, which no sample shows",
            cause: Cause::Quadrature(Fault::EdgesLost {
                axis: THETA,
                counts: 3,
            }),
            does: "stops both axes when the index comes at another count; homing looks for it anew",
            codes: &[FaultCode::INDEX_WRONG],
            end: over_it(),
            host: HOMES,
        },
        Row {
            fault: "quadrature ring: the wire of its index is cut",
            cause: Cause::Quadrature(Fault::IndexCut { axis: THETA }),
            does: "stops both axes when the index is passed and does not come; homing does not find it, and ends at soft_max",
            codes: &[FaultCode::INDEX_WRONG, FaultCode::INDEX_NOT_FOUND],
            end: End::Stopped("encoder's index not found"),
            host: "tries to home, stops the session",
        },
        Row {
            fault: "driver's alarm for 20 s, driver_alarm 1",
            cause: Cause::Alarm,
            does: "stops both axes, engages the brakes, switches the drivers off; `clear` is refused while the alarm is there",
            codes: &[FaultCode::DRIVER_ALARM],
            end: End::Stopped("driver reports an alarm"),
            host: "cannot clear the fault, stops the session",
        },
        event(
            "brown-out in mid-move",
            Fault::BrownOut,
            "gives no more steps; starts unhomed",
            &[],
            over_it(),
            "notices the restart, compares the settings, homes, takes the pose again",
        ),
        Row {
            fault: "power lost while settings are saved",
            cause: Cause::TornSave,
            does: "finds the old settings whole in the other sector",
            codes: &[],
            end: nothing(),
            host: "notices the restart, saves again",
        },
        event(
            "trigger missed by the other arm",
            Fault::TriggerLost { pulses: 1 },
            "stays armed until disarmed",
            &[],
            retaken(),
            "drops the frame, takes the pose again",
        ),
        event(
            "trigger 2 s late at the other arm",
            Fault::TriggerLate { by_us: 2_000_000 },
            "ignores an edge without a trigger request",
            &[],
            retaken(),
            "drops the frame, takes the pose again",
        ),
        Row {
            fault: "camera not ready",
            cause: Cause::CameraNotReady,
            does: "rests",
            codes: &[],
            end: End::Stopped("camera not ready"),
            host: "stops the arms and the session; the pose is the first one when it is resumed",
        },
        Row {
            fault: "host gone in mid-move",
            cause: Cause::HostGone,
            does: "slows down and stops when the host watchdog (2 s) expires; home is kept",
            codes: &[FaultCode::HOST_WATCHDOG],
            end: End::RequestRefused,
            host: "–",
        },
        event(
            "cable out for 10 s",
            Fault::Unplugged { for_us: 10_000_000 },
            "ends its move; were it still under way when the host watchdog (2 s) expires, it would stop with a latched fault",
            &[],
            over_it(),
            "says hello until it is answered, takes the pose again",
        ),
        Row {
            fault: "0.3 % of the bytes flipped, lost, doubled, and delayed",
            cause: Cause::Wire(WireFaults {
                flip: 0.003,
                drop: 0.003,
                repeat: 0.003,
                delay: 0.003,
                delay_us: 80_000,
            }),
            does: "drops bent frames, answers repeats without doing them again",
            codes: &[],
            end: nothing(),
            host: "repeats its requests",
        },
        event(
            "interlock or emergency stop opens",
            Fault::InterlockOpen { for_us: 1_000_000 },
            "both controllers stop at once with a latched fault",
            &[FaultCode::INTERLOCK_OPEN],
            End::Stopped("interlock"),
            "stops the session, until a person lets it go on",
        ),
        Row {
            fault: "targets at which the arms collide, keep-out angle of 25° known to the host",
            cause: Cause::KeepOut,
            does: "gets no move",
            codes: &[],
            end: End::Stopped("arms would be"),
            host: "sends no move; stops the session and names the pose",
        },
        Row {
            fault: "targets for which the arms change places, keep-out angle of 25° known to the host",
            cause: Cause::KeepOutOnTheWay,
            does: "gets no move that could collide: a bumper switch in the chain stays closed",
            codes: &[],
            end: nothing(),
            host: "sends one arm round the other",
        },
        Row {
            fault: "arms about to touch on the way, bumper switch in the interlock chain",
            cause: Cause::Bumper,
            does: "both controllers stop at once with a latched fault; neither knows where the other's arm is",
            codes: &[FaultCode::INTERLOCK_OPEN],
            end: End::Stopped("interlock"),
            host: "stops the session: a person moves the arms apart",
        },
        Row {
            fault: "a target in the desk or beyond the limits",
            cause: Cause::BeyondLimits,
            does: "refuses the move; no step is given",
            codes: &[],
            end: End::RequestRefused,
            host: "stops the session and names the pose",
        },
    ]
}

/// 0.05° once a turn. The ring's mark for 0° is at 0°, as the person who fitted it has set it.
fn eccentric(theta: &mut PlantConfig) {
    theta.eccentricity_udeg = 50_000.0;
    theta.eccentricity_phase_udeg = 0.0;
}

/// As on a test bench: an autocollimator measures where the axis truly is.
fn calibrate_theta(rig: &SimRig, light: &mut RemoteController) {
    let stands: Vec<i32> = (0..10).map(|i| i * 9_700_000).collect();
    let mut autocollimator = |_: &mut RemoteController, _| Ok(rig.true_deg(Arm::Light)[0]);
    let fit = calibrate_axis(light, THETA, &stands, false, &mut autocollimator).unwrap();
    assert!(fit.encoder.rms_after_deg < 0.001, "{fit:?}");
}

// ---- the outcome of a row ----

struct Seen {
    codes: Vec<FaultCode>,
    end: End,
    safe_s: Option<f64>,
}

fn poses() -> Vec<Pose> {
    (0..N_POSES)
        .map(|i| Pose {
            light: Direction::from_deg((i * 13 % 80) as f64, (i * 20) as f64),
            view: Direction::from_deg((i * 7 % 70) as f64, (i * 15) as f64),
        })
        .collect()
}

/// Light and camera stand 60° of azimuth apart, now this way round and now that.
fn poses_that_change_places() -> Vec<Pose> {
    let pose = |i: usize| {
        let (theta, phi) = ((40 + i) as f64, (i * 10) as f64);
        let side = if i.is_multiple_of(2) { 30.0 } else { -30.0 };
        Pose {
            light: Direction::from_deg(theta, phi + side),
            view: Direction::from_deg(theta, phi - side),
        }
    };
    (0..N_POSES).map(pose).collect()
}

fn light_arm(change: fn(&mut PlantConfig), of: Axis) -> SimulatedArm {
    let axis = |axis: Axis, start_udeg| {
        PlantConfig::worm_axis(f64::from(Key::HomeAngle.default_of(axis)), start_udeg)
    };
    let mut axes = [axis(THETA, 21.3e6), axis(Axis::Phi, -12.8e6)];
    change(&mut axes[of.index()]);
    SimulatedArm::new(axes, 21)
}

fn quadrature(theta: &mut PlantConfig) {
    theta.encoder_counts = RING;
    theta.encoder_index = RING_INDEX;
}

fn rig_for(cause: &Cause) -> (SimRig, u64) {
    let at = |at_us, fault| FaultPlan {
        events: vec![FaultEvent {
            at_us,
            arm: Arm::Light,
            fault,
        }],
        ..FaultPlan::default()
    };
    // The camera arm gives the trigger, the light arm follows it: that one misses pulses.
    match cause {
        Cause::Event(fault) => (SimRig::new(5, at(STRIKE_US, *fault)), STRIKE_US),
        Cause::FromTheStart(fault) => (SimRig::new(5, at(0, *fault)), 0),
        Cause::Wire(wire) => {
            let plan = FaultPlan {
                wire: *wire,
                ..FaultPlan::default()
            };
            (SimRig::new(11, plan), 0)
        }
        Cause::Axis(change) | Cause::Adjusted(change, _) => {
            let arms = [light_arm(*change, THETA), SimulatedArm::default_arm(22)];
            (SimRig::with_arms(5, FaultPlan::default(), arms), 0)
        }
        Cause::PhiAxis(change) => {
            let arms = [light_arm(*change, Axis::Phi), SimulatedArm::default_arm(22)];
            (SimRig::with_arms(5, FaultPlan::default(), arms), 0)
        }
        Cause::Alarm => {
            let alarm = Fault::DriverAlarm {
                axis: THETA,
                for_us: 20_000_000,
            };
            (SimRig::new(5, at(STRIKE_US, alarm)), STRIKE_US)
        }
        Cause::Quadrature(fault) => {
            let arms = [light_arm(quadrature, THETA), SimulatedArm::default_arm(22)];
            (SimRig::with_arms(5, at(STRIKE_US, *fault), arms), STRIKE_US)
        }
        Cause::DriverReset => {
            let reset = Fault::DriverReset { axis: THETA };
            let mut light = SimulatedArm::default_arm(21);
            light.fit_drivers(DriverBus::OneWire);
            let arms = [light, SimulatedArm::default_arm(22)];
            (SimRig::with_arms(5, at(STRIKE_US, reset), arms), STRIKE_US)
        }
        Cause::Bumper => {
            let bumper = Fault::Bumper { deg: KEEP_OUT_DEG };
            (SimRig::new(5, at(STRIKE_US, bumper)), STRIKE_US)
        }
        Cause::KeepOutOnTheWay => {
            let deg = KEEP_OUT_DEG - 0.5;
            (
                SimRig::new(5, at(STRIKE_US, Fault::Bumper { deg })),
                STRIKE_US,
            )
        }
        _ => (SimRig::new(5, FaultPlan::default()), 0),
    }
}

fn run(row: &Row) -> Seen {
    let (rig, strike_us) = rig_for(&row.cause);
    let (end, strike_us) = match &row.cause {
        Cause::HostGone => fall_silent(&rig),
        Cause::BeyondLimits => (refuse_targets(&rig), strike_us),
        Cause::TornSave => (tear_a_save(), strike_us),
        cause => (session(&rig, cause), strike_us),
    };
    let stops = rig.stops();
    let mut codes: Vec<FaultCode> = Vec::new();
    for stop in &stops {
        let code = match stop.state {
            ControllerState::Fault(code) => code,
            ControllerState::EStop => FaultCode::INTERLOCK_OPEN,
            _ => continue,
        };
        if !codes.contains(&code) {
            codes.push(code);
        }
    }
    let first = stops.iter().find(|stop| stop.time_us >= strike_us);
    let safe_s = match row.cause {
        Cause::Event(_)
        | Cause::HostGone
        | Cause::Alarm
        | Cause::DriverReset
        | Cause::Quadrature(_) => first.map(|stop| (stop.time_us - strike_us) as f64 * 1e-6),
        _ => None,
    };
    Seen { codes, end, safe_s }
}

/// What a person has set on the light arm before the session.
fn adjust_light(rig: &SimRig, cause: &Cause) {
    if !matches!(
        cause,
        Cause::Alarm | Cause::DriverReset | Cause::Quadrature(_) | Cause::Adjusted(..)
    ) {
        return;
    }
    let mut light = RemoteController::connect(Box::new(rig.port(Arm::Light)), NODE_LIGHT).unwrap();
    match cause {
        Cause::Alarm => light.set_setting(THETA, Key::DriverAlarm, 1).unwrap(),
        Cause::DriverReset => {
            for axis in Axis::BOTH {
                light.set_setting(axis, Key::DriverKind, 1).unwrap();
            }
        }
        Cause::Quadrature(_) => {
            for (key, value) in [
                (Key::EncoderKind, 2),
                (Key::EncoderCountsPerTurn, RING as i32),
                // 0°, counted from the index.
                (Key::EncoderZero, (RING - RING_INDEX) as i32),
            ] {
                light.set_setting(THETA, key, value).unwrap();
            }
        }
        Cause::Adjusted(_, adjust) => {
            adjust(rig, &mut light);
            light.rest(1_000).unwrap();
        }
        _ => {}
    }
}

fn session(rig: &SimRig, cause: &Cause) -> End {
    let port = |arm| Box::new(rig.port(arm));
    adjust_light(rig, cause);
    let mut arms = Arms::connect(port(Arm::Light), port(Arm::Camera)).unwrap();
    let is_calibrated = arms.uncalibrated().unwrap().len() < 4;
    assert_eq!(is_calibrated, row_calibrates(cause));
    if matches!(cause, Cause::KeepOut | Cause::KeepOutOnTheWay) {
        arms.set_keep_out_deg(KEEP_OUT_DEG);
    }
    let poses = match cause {
        Cause::KeepOutOnTheWay => poses_that_change_places(),
        _ => poses(),
    };
    let result = run_session(&mut arms, &poses, &mut |outcome| {
        let shot = match outcome {
            ShotOutcome::Kept(shot) => shot,
            ShotOutcome::Refused { index, reason } => {
                println!("pose {index} given up: {reason}");
                return Ok(());
            }
        };
        let truth = rig.true_pose_at_last_trigger().unwrap();
        let pose = poses[shot.index];
        for (a, b) in [(pose.light, truth.light), (pose.view, truth.view)] {
            let off_deg = angle_between(a.to_vec3(), b.to_vec3()).to_degrees();
            assert!(
                off_deg <= POINTING_LIMIT_DEG,
                "{shot:?} is off by {off_deg}"
            );
        }
        if matches!(cause, Cause::CameraNotReady) && shot.index == 5 {
            let reason = "camera not ready".into();
            return Err(SessionError::Taker {
                index: shot.index,
                reason,
            });
        }
        Ok(())
    });
    // A warning is heard by the host; nothing else is one.
    let warns = matches!(cause, Cause::Event(Fault::EncoderWarns { .. }));
    let remarks = arms.take_remarks();
    assert_eq!(remarks.len(), usize::from(warns), "{remarks:?}");
    match result {
        Ok(summary) if summary.refused > 0 => End::Refused,
        Ok(summary) => {
            assert_eq!(summary.kept, N_POSES);
            End::Complete {
                retaken: summary.retakes > 0,
                recovered: summary.recoveries > 0,
            }
        }
        Err(error) => {
            let line = error.to_string();
            let reason = [
                "home switch and encoder disagree",
                "home switch says home above it too",
                "home switch not found",
                "home switch lets go below home",
                "encoder's index not found",
                "driver reports an alarm",
                "camera not ready",
                "interlock",
                "arms would be",
            ];
            let known = reason.into_iter().find(|reason| line.contains(reason));
            End::Stopped(known.unwrap_or_else(|| panic!("{line}")))
        }
    }
}

fn row_calibrates(cause: &Cause) -> bool {
    matches!(cause, Cause::Adjusted(_, adjust) if std::ptr::fn_addr_eq(*adjust, calibrate_theta as fn(&SimRig, &mut RemoteController)))
}

fn homed(rig: &SimRig) -> RemoteController {
    let mut arm = RemoteController::connect(Box::new(rig.port(Arm::Light)), NODE_LIGHT).unwrap();
    let ticket = arm.home().unwrap();
    arm.wait(ticket, 240_000_000).unwrap();
    arm
}

fn fall_silent(rig: &SimRig) -> (End, u64) {
    let mut arm = homed(rig);
    arm.move_to([0, 300_000_000]).unwrap();
    let silent_us = rig.now_us();
    arm.rest(10_000_000).unwrap();
    (refused(arm.move_to([0, 0])), silent_us)
}

fn refuse_targets(rig: &SimRig) -> End {
    let mut arm = homed(rig);
    let before = rig.true_deg(Arm::Light);
    for target in [
        [90_000_001, 0],
        [-2_000_001, 0],
        [0, 545_000_001],
        [0, i32::MIN],
    ] {
        assert_eq!(refused(arm.move_to(target)), End::RequestRefused);
    }
    arm.rest(1_000_000).unwrap();
    for (now, before) in rig.true_deg(Arm::Light).into_iter().zip(before) {
        assert!((now - before).abs() < 0.001);
    }
    End::RequestRefused
}

fn refused<T>(result: Result<T, LinkError>) -> End {
    match result {
        Err(LinkError::Refused { .. }) => End::RequestRefused,
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("accepted"),
    }
}

/// At every byte of the write.
fn tear_a_save() -> End {
    for after_bytes in (0..240).step_by(16) {
        let fault = Fault::TornSave { after_bytes };
        let event = FaultEvent {
            at_us: 1_000_000,
            arm: Arm::Light,
            fault,
        };
        let plan = FaultPlan {
            events: vec![event],
            ..FaultPlan::default()
        };
        let rig = SimRig::new(5, plan);
        let port = Box::new(rig.port(Arm::Light));
        let mut arm = RemoteController::connect(port, NODE_LIGHT).unwrap();
        arm.set_setting(Axis::Phi, Key::MaxSpeed, 12_000_000)
            .unwrap();
        arm.save_settings().unwrap();
        arm.rest(2_000_000).unwrap();
        arm.set_setting(Axis::Phi, Key::MaxSpeed, 13_000_000)
            .unwrap();
        match arm.save_settings() {
            Err(LinkError::Refused {
                refusal: RequestRefusal::NoSession,
                ..
            }) => {}
            other => panic!("{other:?}"),
        }
        assert!(arm.reconnect().unwrap());
        assert_eq!(arm.setting(Axis::Phi, Key::MaxSpeed).unwrap(), 12_000_000);
        arm.save_settings().unwrap();
    }
    End::Complete {
        retaken: false,
        recovered: false,
    }
}

// ---- the page ----

fn outcomes_of(rows: &[(Row, Seen)]) -> String {
    let mut table = String::from(
        "| fault | the controller | code | the host | the session | time to safe |\n|---|---|---|---|---|---|\n",
    );
    for (row, seen) in rows {
        let codes: Vec<String> = seen.codes.iter().map(|code| code.0.to_string()).collect();
        let codes = if codes.is_empty() {
            "–".into()
        } else {
            codes.join(", ")
        };
        let session = match &seen.end {
            End::Complete { retaken: false, .. } => "complete".to_owned(),
            End::Complete { .. } => "complete, with retakes".to_owned(),
            End::Refused => "runs to its end, poses given up with a reason".to_owned(),
            End::Stopped(reason) => format!("stopped: {reason}"),
            End::RequestRefused => "–".to_owned(),
        };
        let safe = seen.safe_s.map_or("–".to_owned(), |s| format!("{s:.2} s"));
        let (fault, does, host) = (row.fault, row.does, row.host);
        writeln!(
            table,
            "| {fault} | {does} | {codes} | {host} | {session} | {safe} |"
        )
        .unwrap();
    }
    table
}

fn codes() -> String {
    let mut table =
        String::from("| code | symptom | cause | cure | home is |\n|---|---|---|---|---|\n");
    for fault in FaultCode::PAGES {
        let home = if fault.code.loses_home() {
            "lost"
        } else {
            "kept"
        };
        let (code, symptom, cause, cure) = (fault.code.0, fault.symptom, fault.cause, fault.cure);
        writeln!(table, "| {code} | {symptom} | {cause} | {cure} | {home} |").unwrap();
    }
    table
}

/// The page with a table in place of what stands between `<!-- name -->` and `<!-- /name -->`.
fn with_table(page: &str, name: &str, table: &str) -> String {
    let (open, close) = (format!("<!-- {name} -->\n"), format!("<!-- /{name} -->"));
    let between = page
        .split_once(&open)
        .and_then(|(before, rest)| Some((before, rest.split_once(&close)?.1)));
    let (before, after) = between.unwrap_or_else(|| panic!("the page has no marks {open}"));
    format!("{before}{open}{table}{close}{after}")
}

#[test]
fn every_fault_ends_as_its_row_says_and_the_page_is_up_to_date() {
    let mut wrong = Vec::new();
    let mut seen_rows = Vec::new();
    for row in rows() {
        let seen = run(&row);
        if seen.codes != row.codes || seen.end != row.end {
            let (fault, codes, end) = (row.fault, &seen.codes, &seen.end);
            wrong.push(format!("{fault}: {codes:?} {end:?}"));
        }
        seen_rows.push((row, seen));
    }
    assert!(
        wrong.is_empty(),
        "not as the table says:\n{}",
        wrong.join("\n")
    );

    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(PAGE);
    let written = std::fs::read_to_string(&path).unwrap();
    let page = with_table(&written, "rows", &outcomes_of(&seen_rows));
    let page = with_table(&page, "codes", &codes());
    if std::env::var_os("GONIA_UPDATE_DOCS").is_some() {
        std::fs::write(&path, &page).unwrap();
        return;
    }
    assert!(
        written == page,
        "the tables in {PAGE} are out of date: run this test with GONIA_UPDATE_DOCS=1"
    );
}
