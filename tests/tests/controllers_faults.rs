//! What a controller and the host do when something goes wrong.

#![allow(clippy::unwrap_used, clippy::panic)]

use gonia_acquire::capture::{
    Arms, POINTING_LIMIT_DEG, SessionError, SessionSummary, ShotOutcome, run_session,
};
use gonia_acquire::link::{LinkError, RemoteController};
use gonia_brdf::{Direction, Pose};
use gonia_protocol::NODE_LIGHT;
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    ControllerState, RequestOutcome, RequestRefusal, TriggerRequest, TriggerRole,
};
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::fault::{Arm, Fault, FaultEvent, FaultPlan, WireFaults};
use gonia_sim::rig::SimRig;

const MINUTE_US: u64 = 60_000_000;

fn rig_with(events: &[(u64, Fault)]) -> SimRig {
    let events = events.iter().map(|&(at_us, fault)| FaultEvent {
        at_us,
        arm: Arm::Light,
        fault,
    });
    SimRig::new(
        5,
        FaultPlan {
            events: events.collect(),
            ..FaultPlan::default()
        },
    )
}

fn light(rig: &SimRig) -> RemoteController {
    RemoteController::connect(Box::new(rig.port(Arm::Light)), NODE_LIGHT).unwrap()
}

fn homed(rig: &SimRig) -> RemoteController {
    let mut arm = light(rig);
    let ticket = arm.home().unwrap();
    assert_eq!(
        arm.wait(ticket, 4 * MINUTE_US).unwrap().outcome,
        RequestOutcome::Done
    );
    arm
}

fn state(arm: &mut RemoteController) -> ControllerState {
    arm.status().unwrap().state
}

fn refusal(result: Result<impl Sized, LinkError>) -> RequestRefusal {
    match result {
        Err(LinkError::Refused { refusal, .. }) => refusal,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("accepted"),
    }
}

fn train(trigger: TriggerRole) -> TriggerRequest {
    TriggerRequest {
        trigger,
        exposures_us: [1000, 4000, 16_000].into_iter().collect(),
        gap_us: 500,
    }
}

// ---- one controller ----

#[test]
fn homing_finds_the_true_angle_to_the_encoders_accuracy() {
    let rig = rig_with(&[]);
    let mut arm = homed(&rig);
    for (truth, axis) in rig
        .true_deg(Arm::Light)
        .into_iter()
        .zip(arm.status().unwrap().axes)
    {
        assert!((truth - f64::from(axis.encoder_udeg) * 1e-6).abs() < 0.008);
    }
}

#[test]
fn nothing_moves_before_homing_and_nothing_beyond_the_limits_after_it() {
    let rig = rig_with(&[]);
    let mut arm = light(&rig);
    assert_eq!(refusal(arm.move_to([0, 0])), RequestRefusal::NotHomed);
    let mut arm = homed(&rig);
    for (target, axis) in [
        ([90_000_001, 0], Axis::Theta),
        ([-2_000_001, 0], Axis::Theta),
        ([0, 545_000_001], Axis::Phi),
        ([0, i32::MIN], Axis::Phi),
    ] {
        assert_eq!(
            refusal(arm.move_to(target)),
            RequestRefusal::TargetBeyondLimit(axis)
        );
    }
    assert_eq!(state(&mut arm), ControllerState::Idle);
}

#[test]
fn a_stop_slows_down_and_leaves_the_arm_at_home_with_its_position() {
    let rig = rig_with(&[]);
    let mut arm = homed(&rig);
    let ticket = arm.move_to([60_000_000, 0]).unwrap();
    assert_eq!(arm.poll(ticket, 2_000_000).unwrap(), None);
    arm.stop().unwrap();
    let end = arm.wait(ticket, MINUTE_US).unwrap();
    assert_eq!(end.outcome, RequestOutcome::Stopped);
    let status = arm.status().unwrap();
    assert_eq!((status.state, status.homed), (ControllerState::Idle, true));
    assert!((1_000_000..59_000_000).contains(&status.axes[0].encoder_udeg));
    let ticket = arm.move_to([10_000_000, 0]).unwrap();
    assert_eq!(
        arm.wait(ticket, MINUTE_US).unwrap().outcome,
        RequestOutcome::Done
    );
}

#[test]
fn a_silent_host_stops_a_moving_arm_and_only_a_moving_one() {
    let rig = rig_with(&[]);
    let mut arm = homed(&rig);
    arm.rest(10 * MINUTE_US).unwrap();
    assert_eq!(state(&mut arm), ControllerState::Idle);
    let ticket = arm.move_to([0, 300_000_000]).unwrap();
    arm.rest(10_000_000).unwrap();
    let end = arm.wait(ticket, 1).unwrap();
    assert_eq!(
        end.outcome,
        RequestOutcome::Failed(FaultCode::HOST_WATCHDOG)
    );
    // It slowed down: no step was lost, and home is still known.
    let stopped = arm.status().unwrap();
    assert!(stopped.homed && stopped.axes[1].encoder_udeg < 0);
    assert_eq!(
        stopped.state,
        ControllerState::Fault(FaultCode::HOST_WATCHDOG)
    );
    assert_eq!(
        refusal(arm.move_to([0, 0])),
        RequestRefusal::State(stopped.state)
    );
    arm.clear_fault().unwrap();
    let ticket = arm.move_to([0, 0]).unwrap();
    assert_eq!(
        arm.wait(ticket, MINUTE_US).unwrap().outcome,
        RequestOutcome::Done
    );
}

#[test]
fn each_fault_of_an_axis_ends_in_its_code() {
    let theta = Axis::Theta;
    let lost = |for_us| Fault::EncoderLost {
        axis: theta,
        for_us,
    };
    let jump = Fault::EncoderJump {
        axis: theta,
        udeg: 5e6,
    };
    let stall = Fault::Stall {
        axis: theta,
        for_us: MINUTE_US,
    };
    // Homing takes some 25 s; the move begins at 60 s and takes 5.
    for (fault, code) in [
        (stall, FaultCode::FOLLOWING_ERROR),
        (lost(1_000_000), FaultCode::ENCODER_LOST),
        (jump, FaultCode::ENCODER_JUMP),
    ] {
        let rig = rig_with(&[(62_000_000, fault)]);
        let mut arm = homed(&rig);
        let wait_us = MINUTE_US - rig.now_us();
        arm.rest(wait_us).unwrap();
        let ticket = arm.move_to([70_000_000, 0]).unwrap();
        let end = arm.wait(ticket, MINUTE_US).unwrap();
        assert_eq!(end.outcome, RequestOutcome::Failed(code), "{fault:?}");
        assert_eq!(state(&mut arm), ControllerState::Fault(code));
        assert!(!arm.status().unwrap().homed);
    }
}

#[test]
fn a_switch_that_lies_is_found_out_while_homing() {
    for (at_home, code) in [
        (true, FaultCode::HOME_SWITCH_STUCK),
        (false, FaultCode::HOME_NOT_FOUND),
    ] {
        let stuck = Fault::SwitchStuck {
            axis: Axis::Theta,
            at_home: Some(at_home),
        };
        let mut arm = light(&rig_with(&[(0, stuck)]));
        let ticket = arm.home().unwrap();
        let end = arm.wait(ticket, 4 * MINUTE_US).unwrap();
        assert_eq!(end.outcome, RequestOutcome::Failed(code));
    }
}

#[test]
fn after_lost_steps_or_a_slip_the_home_switch_says_that_the_encoder_is_right() {
    for fault in [
        Fault::LoseCycles {
            axis: Axis::Theta,
            cycles: 3,
        },
        Fault::Slip {
            axis: Axis::Theta,
            udeg: -150_000.0,
        },
    ] {
        let rig = rig_with(&[(61_000_000, fault)]);
        let mut arm = homed(&rig);
        let wait_us = MINUTE_US - rig.now_us();
        arm.rest(wait_us).unwrap();
        let ticket = arm.move_to([30_000_000, 0]).unwrap();
        let end = arm.wait(ticket, MINUTE_US).unwrap();
        let disagree = FaultCode::STEP_LOSS;
        assert_eq!(end.outcome, RequestOutcome::Failed(disagree), "{fault:?}");
        arm.clear_fault().unwrap();
        let ticket = arm.home().unwrap();
        assert_eq!(
            arm.wait(ticket, 4 * MINUTE_US).unwrap().outcome,
            RequestOutcome::Done
        );
        let ticket = arm.move_to([30_000_000, 0]).unwrap();
        let end = arm.wait(ticket, MINUTE_US).unwrap();
        assert_eq!(end.outcome, RequestOutcome::Done, "{fault:?}");
        assert!((rig.true_deg(Arm::Light)[0] - 30.0).abs() < 0.012);
    }
}

#[test]
fn an_encoder_that_shifts_is_found_out_at_the_home_switch() {
    for udeg in [60_000.0, -100_000.0, 170_000.0] {
        let shift = Fault::EncoderJump {
            axis: Axis::Phi,
            udeg,
        };
        let rig = rig_with(&[(61_000_000, shift)]);
        let mut arm = homed(&rig);
        let wait_us = MINUTE_US - rig.now_us();
        arm.rest(wait_us).unwrap();
        let ticket = arm.move_to([0, 30_000_000]).unwrap();
        let end = arm.wait(ticket, MINUTE_US).unwrap();
        assert_eq!(end.outcome, RequestOutcome::Failed(FaultCode::STEP_LOSS));
        arm.clear_fault().unwrap();
        let ticket = arm.home().unwrap();
        let end = arm.wait(ticket, 4 * MINUTE_US).unwrap();
        assert_eq!(
            end.outcome,
            RequestOutcome::Failed(FaultCode::HOME_MISMATCH)
        );
    }
}

#[test]
fn power_lost_while_saving_leaves_the_old_settings() {
    let torn = Fault::TornSave { after_bytes: 100 };
    let rig = rig_with(&[(1_000_000, torn)]);
    let mut arm = light(&rig);
    let set = |arm: &mut RemoteController, value| arm.set_setting(Axis::Phi, Key::MaxSpeed, value);
    set(&mut arm, 12_000_000).unwrap();
    arm.save_settings().unwrap();
    arm.rest(2_000_000).unwrap();
    set(&mut arm, 13_000_000).unwrap();
    assert_eq!(refusal(arm.save_settings()), RequestRefusal::NoSession);
    assert!(arm.reconnect().unwrap(), "the restart is noticed");
    assert_eq!(arm.setting(Axis::Phi, Key::MaxSpeed).unwrap(), 12_000_000);
    assert_eq!(state(&mut arm), ControllerState::Unhomed);
}

#[test]
fn settings_are_refused_while_moving_and_survive_a_brown_out_once_saved() {
    let rig = rig_with(&[(3 * MINUTE_US, Fault::BrownOut)]);
    let mut arm = homed(&rig);
    let crc = arm.identity().config_crc;
    let ticket = arm.move_to([5_000_000, 0]).unwrap();
    let refused = refusal(arm.set_setting(Axis::Phi, Key::MaxSpeed, 12_000_000));
    assert_eq!(refused, RequestRefusal::State(ControllerState::Moving));
    arm.wait(ticket, MINUTE_US).unwrap();
    assert_eq!(
        refusal(arm.set_setting(Axis::Phi, Key::MaxSpeed, -1)),
        RequestRefusal::Value
    );
    arm.set_setting(Axis::Phi, Key::MaxSpeed, 12_000_000)
        .unwrap();
    arm.save_settings().unwrap();

    let wait_us = 3 * MINUTE_US + 1_000_000 - rig.now_us();
    arm.rest(wait_us).unwrap();
    assert_eq!(refusal(arm.move_to([0, 0])), RequestRefusal::NoSession);
    assert!(arm.reconnect().unwrap(), "the restart is noticed");
    assert_ne!(arm.identity().config_crc, crc);
    assert_eq!(arm.setting(Axis::Phi, Key::MaxSpeed).unwrap(), 12_000_000);
    assert_eq!(refusal(arm.move_to([0, 0])), RequestRefusal::NotHomed);
}

#[test]
fn a_train_latches_every_pulse_and_refuses_to_fire_outside_the_window() {
    let slip = Fault::Slip {
        axis: Axis::Phi,
        udeg: 100_000.0,
    };
    let rig = rig_with(&[(2 * MINUTE_US, slip)]);
    let mut arm = homed(&rig);
    let ticket = arm.move_to([20_000_000, 40_000_000]).unwrap();
    arm.wait(ticket, MINUTE_US).unwrap();
    arm.request_trigger(train(TriggerRole::Source)).unwrap();
    let ticket = arm.fire().unwrap();
    assert_eq!(
        arm.wait(ticket, MINUTE_US).unwrap().outcome,
        RequestOutcome::Done
    );
    let times: Vec<u64> = (0..3).map(|i| arm.latch(i).unwrap().time_us).collect();
    assert_eq!([times[1] - times[0], times[2] - times[1]], [1500, 4500]);
    let given: Vec<u64> = rig.triggers().iter().map(|t| t.time_us).collect();
    assert_eq!(given, times);

    arm.request_trigger(train(TriggerRole::Source)).unwrap();
    while rig.now_us() < 2 * MINUTE_US + 1000 {
        arm.keep_alive().unwrap();
        arm.rest(100_000).unwrap();
    }
    match refusal(arm.fire()) {
        RequestRefusal::OutsideWindow(Axis::Phi, error) => {
            assert!((90_000..110_000).contains(&error))
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(rig.triggers().len(), 3);
}

#[test]
fn one_arms_emergency_stop_stops_the_other_and_is_cleared_from_its_source() {
    let rig = rig_with(&[]);
    let mut light = homed(&rig);
    let mut camera =
        RemoteController::connect(Box::new(rig.port(Arm::Camera)), gonia_protocol::NODE_CAMERA)
            .unwrap();
    let homing = camera.home().unwrap();
    camera.poll(homing, 1_000_000).unwrap();
    light.emergency_stop().unwrap();
    let end = camera.wait(homing, MINUTE_US).unwrap();
    assert_eq!(
        end.outcome,
        RequestOutcome::Failed(FaultCode::INTERLOCK_OPEN)
    );
    let remains = RequestRefusal::CauseRemains(FaultCode::INTERLOCK_OPEN);
    assert_eq!(refusal(camera.clear_fault()), remains);
    light.clear_fault().unwrap();
    camera.rest(100_000).unwrap();
    camera.clear_fault().unwrap();
    assert_eq!(state(&mut camera), ControllerState::Unhomed);
}

#[test]
fn firmware_of_another_schema_is_named_and_not_moved() {
    /// A transport whose controller answers hello with another schema key.
    struct Elsewhere(Vec<u8>);
    impl gonia_acquire::link::Transport for Elsewhere {
        fn send(&mut self, _: &[u8]) -> std::io::Result<()> {
            let identity = gonia_protocol::message::Identity {
                protocol_min: 1,
                protocol_max: 1,
                schema_key: 1,
                firmware: [9, 8, 7],
                git: Default::default(),
                board: Default::default(),
                config_crc: 0,
                boot_id: 0,
                reset: gonia_protocol::message::ResetReason::PowerOn,
                last_panic: Default::default(),
            };
            let answer = gonia_protocol::message::Message::Identity(identity);
            self.0 = gonia_protocol::packet::encode(NODE_LIGHT, 1, &answer)
                .unwrap()
                .to_vec();
            Ok(())
        }
        fn receive(&mut self, out: &mut Vec<u8>, _: u64) -> std::io::Result<()> {
            out.append(&mut self.0);
            Ok(())
        }
        fn now_us(&self) -> u64 {
            0
        }
    }
    let error = RemoteController::connect(Box::new(Elsewhere(Vec::new())), NODE_LIGHT)
        .err()
        .unwrap();
    let line = error.to_string();
    assert!(
        line.contains("light arm") && line.contains("9.8.7") && !line.contains('\n'),
        "{line}"
    );
}

// ---- whole sessions ----

fn poses(n: usize) -> Vec<Pose> {
    (0..n)
        .map(|i| Pose {
            light: Direction::from_deg((i * 13 % 80) as f64, (i * 20) as f64),
            view: Direction::from_deg((i * 7 % 70) as f64, (i * 15) as f64),
        })
        .collect()
}

/// Runs a session; no shot may be kept whose arms were truly elsewhere.
fn session(rig: &SimRig, poses: &[Pose]) -> (Result<SessionSummary, SessionError>, usize) {
    let connect = |arm| Box::new(rig.port(arm));
    let mut arms = Arms::connect(connect(Arm::Light), connect(Arm::Camera)).unwrap();
    let mut kept = 0;
    let result = run_session(&mut arms, poses, &mut |outcome| {
        if let ShotOutcome::Kept(shot) = outcome {
            let truth = rig.true_pose_at_last_trigger().unwrap();
            let pose = poses[shot.index];
            for (a, b) in [(pose.light, truth.light), (pose.view, truth.view)] {
                let off = gonia_brdf::direction::angle_between(a.to_vec3(), b.to_vec3());
                assert!(off.to_degrees() <= POINTING_LIMIT_DEG, "{shot:?}");
            }
            kept += 1;
        }
        Ok(())
    });
    (result, kept)
}

#[test]
fn a_session_gets_over_a_stall_a_restart_a_pulled_cable_and_a_missed_trigger() {
    let stall = Fault::Stall {
        axis: Axis::Theta,
        // Longer than a pose takes, so that a move falls into it.
        for_us: 6_000_000,
    };
    for (fault, recoveries) in [
        (stall, 1),
        (Fault::BrownOut, 1),
        (Fault::Unplugged { for_us: 10_000_000 }, 1),
        (
            Fault::EncoderLost {
                axis: Axis::Phi,
                for_us: 500_000,
            },
            1,
        ),
        (Fault::TriggerLost { pulses: 1 }, 0),
    ] {
        let rig = rig_with(&[(62_345_678, fault)]);
        let (result, kept) = session(&rig, &poses(30));
        let summary = result.unwrap();
        assert_eq!((kept, summary.refused), (30, 0), "{fault:?}");
        assert!(summary.retakes > 0, "{fault:?} had no effect");
        assert!(summary.recoveries >= recoveries, "{fault:?}: {summary:?}");
    }
}

#[test]
fn an_open_interlock_ends_a_session_with_its_reason() {
    let rig = rig_with(&[(62_000_000, Fault::InterlockOpen { for_us: 1_000_000 })]);
    let (result, kept) = session(&rig, &poses(30));
    assert!((1..30).contains(&kept));
    let line = result.unwrap_err().to_string();
    assert!(line.contains("interlock") && !line.contains('\n'), "{line}");
}

#[test]
fn a_bad_wire_loses_no_pose_and_takes_none_twice() {
    let wire = WireFaults {
        flip: 0.003,
        drop: 0.003,
        repeat: 0.003,
        delay: 0.003,
        delay_us: 80_000,
    };
    let rig = SimRig::new(
        11,
        FaultPlan {
            wire,
            events: Vec::new(),
        },
    );
    let (result, kept) = session(&rig, &poses(60));
    let summary = result.unwrap();
    assert_eq!(kept, 60);
    assert!(summary.requests_repeated > 20, "{summary:?}");
    // A pulse for each kept shot, and one for each that was retaken after its pulse.
    let pulses = rig.triggers().len() as u32;
    assert!(
        (60..=60 + summary.retakes).contains(&pulses),
        "{pulses} {summary:?}"
    );
}

#[test]
fn a_pose_out_of_reach_is_named() {
    let rig = rig_with(&[]);
    let mut list = poses(3);
    list[2].light = Direction::from_deg(91.0, 0.0);
    let (result, kept) = session(&rig, &list);
    assert_eq!(kept, 2);
    let line = result.unwrap_err().to_string();
    assert!(line.contains("pose 2") && line.contains("Theta"), "{line}");
}
