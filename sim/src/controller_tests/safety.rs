//! Brakes, drivers' alarms, and what goes wrong while an arm slows down.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, Message, RequestOutcome, RequestRefusal};
use gonia_protocol::settings::{Axis, Key};

use super::TestBench;

const BRAKE_US: u64 = 50_000;

/// An arm with brakes and alarm outputs (closed while all is well) that stands up anew.
fn with_brakes() -> TestBench {
    let mut bench = TestBench::near_home();
    bench.set(Axis::Theta, Key::BrakeTime, BRAKE_US as i32);
    for axis in Axis::BOTH {
        bench.set(axis, Key::DriverAlarm, 1);
    }
    bench
}

/// Ticks until brakes and drivers are so; returns when, µs.
fn await_outputs(bench: &mut TestBench, released: bool, drivers: bool) -> u64 {
    let until_us = bench.now_us + 1_000_000;
    while bench.arm.brakes_and_drivers() != (released, drivers) {
        assert!(bench.now_us < until_us, "neither comes nor goes");
        bench.tick();
    }
    bench.now_us
}

#[test]
fn an_emergency_stop_engages_the_brakes_and_homing_waits_until_they_have_let_go() {
    let mut bench = with_brakes();
    bench.ask(&Message::Home).unwrap();
    bench.run_us(600_000);
    bench.ask(&Message::EStop).unwrap();
    let asked_us = bench.now_us;
    let engaged_us = await_outputs(&mut bench, false, true);
    assert!(engaged_us - asked_us <= 4_000, "{engaged_us} {asked_us}");
    bench.run_us(200_000);
    assert_eq!(bench.arm.brakes_and_drivers(), (false, true));

    bench.ask(&Message::ClearFault).unwrap();
    // A step against a brake would be lost, and be seen as such.
    assert_eq!(bench.home(), RequestOutcome::Done);
    assert!((bench.phi_deg() + 185.0).abs() < 0.03);
    assert!(!bench.arm.was_let_fall());
}

#[test]
fn a_drivers_alarm_engages_the_brakes_before_the_drivers_go_off() {
    let mut bench = with_brakes();
    bench.ask(&Message::Home).unwrap();
    bench.run_us(600_000);
    let alarm_us = bench.now_us;
    bench.arm.raise_alarm_until(Axis::Phi, alarm_us + 1_000_000);
    let expected = FaultCode::DRIVER_ALARM;
    assert_eq!(bench.outcome(), RequestOutcome::Failed(expected));
    let engaged_us = await_outputs(&mut bench, false, true);
    assert!(engaged_us - alarm_us <= 10_000);
    let off_us = await_outputs(&mut bench, false, false);
    assert!(off_us - engaged_us >= BRAKE_US, "{}", off_us - engaged_us);

    let refusal = RequestRefusal::CauseRemains(expected);
    assert_eq!(bench.ask(&Message::ClearFault), Err(refusal));
    bench.run_us(1_000_000);
    assert_eq!(bench.ask(&Message::ClearFault), Ok(Message::Accepted));
    let on_us = await_outputs(&mut bench, false, true);
    let released_us = await_outputs(&mut bench, true, true);
    assert!(released_us - on_us >= BRAKE_US, "{}", released_us - on_us);
    assert_eq!(bench.home(), RequestOutcome::Done);
    assert!(!bench.arm.was_let_fall());
}

#[test]
fn an_alarm_input_the_other_way_round_is_an_alarm_at_once() {
    let mut bench = TestBench::near_home();
    bench.set(Axis::Theta, Key::DriverAlarm, 2);
    bench.run_us(100_000);
    let expected = ControllerState::Fault(FaultCode::DRIVER_ALARM);
    assert_eq!(bench.state(), expected);
}

#[test]
fn interference_on_an_alarm_input_is_no_alarm() {
    let mut bench = with_brakes();
    bench.ask(&Message::Home).unwrap();
    bench.run_us(100_000);
    // One look of the control tick.
    bench.arm.raise_alarm_until(Axis::Phi, bench.now_us + 2_500);
    bench.run_us(20_000);
    assert_eq!(bench.state(), ControllerState::Homing);
}

/// What happens while the arm slows down after its host has gone, and what is latched then.
fn while_slowing_down(strike: fn(&mut TestBench)) -> (FaultCode, bool) {
    let mut bench = TestBench::near_home();
    bench.set(Axis::Theta, Key::HostWatchdog, 500_000);
    bench.ask(&Message::Home).unwrap();
    bench.host_is_there = false;
    let until_us = bench.now_us + 1_000_000;
    while bench.state() == ControllerState::Homing && bench.now_us < until_us {
        bench.tick();
    }
    let gone = ControllerState::Fault(FaultCode::HOST_WATCHDOG);
    assert_eq!(bench.state(), gone);
    assert!(bench.controller.is_moving(), "it slows down");
    strike(&mut bench);
    bench.run_us(2_000_000);
    assert!(!bench.controller.is_moving());
    match bench.state() {
        ControllerState::Fault(code) => (code, bench.controller.status(0).homed),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_stall_while_the_arm_slows_down_for_its_watchdog_is_a_following_error() {
    let stall = |bench: &mut TestBench| {
        let until_us = bench.now_us + 10_000_000;
        bench.arm.axis(Axis::Phi).stall_until(until_us);
    };
    let (code, _) = while_slowing_down(stall);
    assert_eq!(code, FaultCode::FOLLOWING_ERROR);
}

#[test]
fn an_encoder_lost_while_the_arm_slows_down_for_its_watchdog_is_a_fault_of_its_own() {
    let lose = |bench: &mut TestBench| {
        let until_us = bench.now_us + 10_000_000;
        bench.arm.axis(Axis::Phi).lose_encoder_until(until_us);
    };
    let (code, _) = while_slowing_down(lose);
    assert_eq!(code, FaultCode::ENCODER_LOST);
}

#[test]
fn an_arm_that_slows_down_well_keeps_the_watchdogs_fault() {
    let (code, _) = while_slowing_down(|_| {});
    assert_eq!(code, FaultCode::HOST_WATCHDOG);
}
