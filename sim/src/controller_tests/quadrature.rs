//! Quadrature rings with an index: homing, and what is lost on the way.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    ControllerState, Message, Move, RequestOutcome, RequestRefusal, Setting,
};
use gonia_protocol::settings::{Axis, Key};

use super::TestBench;
use crate::plant::PlantConfig;

/// A ring of 20,000 lines.
const TURN: u32 = 80_000;
const PARK_DEG: [f64; 2] = [-2.0, -185.0];
/// The encoder's own error, a count and half of the gear's play.
const ACCURACY_DEG: f64 = 0.03;

/// The count of an angle by a ring that is not aligned at all.
fn counts(deg: f64) -> u32 {
    ((deg / 360.0 * f64::from(TURN)).round() as i64).rem_euclid(i64::from(TURN)) as u32
}

/// An arm with quadrature rings, standing there, their indices at these angles, and settings that say so.
fn bench(start_deg: [f64; 2], index_deg: [f64; 2]) -> TestBench {
    let axis = |i: usize, home_udeg: f64| PlantConfig {
        encoder_counts: TURN,
        encoder_index: counts(index_deg[i]),
        ..PlantConfig::worm_axis(home_udeg, start_deg[i] * 1e6)
    };
    let mut bench = TestBench::with_arm([axis(0, -5e6), axis(1, -190e6)]);
    for (axis, index_deg) in Axis::BOTH.into_iter().zip(index_deg) {
        bench.set(axis, Key::EncoderKind, 2);
        bench.set(axis, Key::EncoderCountsPerTurn, TURN as i32);
        // 0°, counted from the index.
        bench.set(axis, Key::EncoderZero, counts(-index_deg) as i32);
    }
    bench.run_us(100_000);
    bench
}

/// Homes; how that ended, and the highest angles on the way.
fn home(bench: &mut TestBench) -> (RequestOutcome, [f64; 2]) {
    assert_eq!(bench.ask(&Message::Home), Ok(Message::Accepted));
    let mut highest = [f64::MIN; 2];
    loop {
        let ended = bench.tick();
        let deg = bench.arm.true_deg(bench.now_us);
        highest = [0, 1].map(|i| deg[i].max(highest[i]));
        if let Some(outcome) = ended {
            return (outcome, highest);
        }
    }
}

fn move_to(bench: &mut TestBench, deg: [f64; 2]) -> RequestOutcome {
    let target_udeg = deg.map(|deg| (deg * 1e6) as i32);
    let answer = bench.ask(&Message::Move(Move { target_udeg }));
    assert_eq!(answer, Ok(Message::Accepted));
    bench.outcome()
}

fn assert_stands_at(bench: &TestBench, expected: [f64; 2], case: &str) {
    let is = bench.arm.true_deg(bench.now_us);
    for i in 0..2 {
        let off = is[i] - expected[i];
        assert!(off.abs() < ACCURACY_DEG, "{case}: axis {i} is {off}° off");
    }
}

#[test]
fn homing_finds_the_index_wherever_it_is_and_goes_no_further_than_to_it() {
    // To come to rest takes v²/2a, half the jerk time at full speed, and 8 ms that are queued: 1.3°. φ's index below
    // home as well, where the probe of the switch comes by or does not.
    for (start, index, highest) in [
        ([3.0, -170.0], [0.0, -180.0], [3.0, -170.0]),
        ([40.0, 100.0], [60.0, 100.0], [61.3, 101.3]),
        ([-3.0, -192.0], [-4.9, -191.0], [-1.9, -183.0]),
        ([3.0, 540.0], [85.0, -193.0], [86.3, 540.1]),
        ([3.0, -170.0], [30.0, -195.5], [31.3, 165.8]),
    ] {
        let case = format!("from {start:?}, index {index:?}");
        let mut bench = bench(start, index);
        let (outcome, reached) = home(&mut bench);
        assert_eq!(outcome, RequestOutcome::Done, "{case}");
        assert_stands_at(&bench, PARK_DEG, &case);
        let within = (0..2).all(|i| reached[i] <= highest[i] + 0.1);
        assert!(within, "{case}: up to {reached:?}");
        // Once known, it is not looked for again.
        assert_eq!(move_to(&mut bench, [20.0, -150.0]), RequestOutcome::Done);
        assert_stands_at(&bench, [20.0, -150.0], &case);
        let (outcome, reached) = home(&mut bench);
        assert_eq!(outcome, RequestOutcome::Done, "{case}");
        assert!(reached[0] < 20.1 && reached[1] < -149.9, "{reached:?}");
        assert_stands_at(&bench, PARK_DEG, &case);
    }
}

#[test]
fn poses_over_two_turns_pass_the_index_at_its_count() {
    let mut bench = bench([3.0, -170.0], [40.0, -180.0]);
    assert_eq!(home(&mut bench).0, RequestOutcome::Done);
    for deg in [[80.0, 500.0], [10.0, -100.0], [41.0, 181.0], [39.0, 179.0]] {
        assert_eq!(move_to(&mut bench, deg), RequestOutcome::Done);
        assert_stands_at(&bench, deg, "move");
    }
}

#[test]
fn an_index_that_does_not_come_ends_homing_within_the_travel() {
    let expected = FaultCode::INDEX_NOT_FOUND;
    // θ's ring is fitted with its index beyond the travel.
    let mut beyond = bench([3.0, -170.0], [200.0, -180.0]);
    let (outcome, reached) = home(&mut beyond);
    assert_eq!(outcome, RequestOutcome::Failed(expected));
    assert!((89.0..90.1).contains(&reached[0]), "{reached:?}");
    // φ's wire is cut: a turn, and no more.
    let mut cut = bench([3.0, -170.0], [0.0, -180.0]);
    cut.arm.ring(Axis::Phi).cut_index();
    let (outcome, reached) = home(&mut cut);
    assert_eq!(outcome, RequestOutcome::Failed(expected));
    assert!((170.0..176.0).contains(&reached[1]), "{reached:?}");
}

#[test]
fn a_lost_edge_stops_both_axes_and_homing_looks_for_the_index_anew() {
    let mut bench = bench([3.0, -170.0], [0.0, -180.0]);
    assert_eq!(home(&mut bench).0, RequestOutcome::Done);
    let target_udeg = [40_000_000, -100_000_000];
    let answer = bench.ask(&Message::Move(Move { target_udeg }));
    assert_eq!(answer, Ok(Message::Accepted));
    bench.run_us(1_000_000);
    bench.arm.ring(Axis::Phi).lose_edges(1);
    let expected = FaultCode::EDGE_LOST;
    assert_eq!(bench.outcome(), RequestOutcome::Failed(expected));
    assert_eq!(bench.state(), ControllerState::Fault(expected));
    assert_eq!(bench.ask(&Message::ClearFault), Ok(Message::Accepted));
    assert_eq!(bench.state(), ControllerState::Unhomed);
    bench.run_us(100_000);
    assert_eq!(home(&mut bench).0, RequestOutcome::Done);
    assert_stands_at(&bench, PARK_DEG, "after a lost edge");
}

#[test]
fn counts_that_nobody_missed_are_found_when_the_index_comes() {
    let mut bench = bench([3.0, -170.0], [0.0, -180.0]);
    assert_eq!(home(&mut bench).0, RequestOutcome::Done);
    let target_udeg = [40_000_000, 200_000_000];
    let answer = bench.ask(&Message::Move(Move { target_udeg }));
    assert_eq!(answer, Ok(Message::Accepted));
    bench.run_us(3_000_000);
    bench.arm.ring(Axis::Phi).lose_edges(3);
    let expected = FaultCode::INDEX_WRONG;
    assert_eq!(bench.outcome(), RequestOutcome::Failed(expected));
    let phi_deg = bench.phi_deg();
    assert!((179.9..180.3).contains(&phi_deg), "{phi_deg}°");
}

#[test]
fn an_edge_lost_while_a_fault_that_keeps_home_is_cleared_is_still_a_fault() {
    let mut bench = bench([3.0, -170.0], [0.0, -180.0]);
    assert_eq!(home(&mut bench).0, RequestOutcome::Done);
    let target_udeg = [40_000_000, -100_000_000];
    let answer = bench.ask(&Message::Move(Move { target_udeg }));
    assert_eq!(answer, Ok(Message::Accepted));
    bench.host_is_there = false;
    bench.run_us(5_000_000);
    bench.host_is_there = true;
    let kept = FaultCode::HOST_WATCHDOG;
    assert_eq!(bench.state(), ControllerState::Fault(kept));
    // Knocked, between two looks of the controller.
    bench.arm.axis(Axis::Phi).slip(90_000.0);
    bench.arm.ring(Axis::Phi).lose_edges(1);
    let refused = Err(RequestRefusal::CauseRemains(kept));
    assert_eq!(bench.ask(&Message::ClearFault), refused);
    assert_eq!(bench.ask(&Message::ClearFault), Ok(Message::Accepted));
    bench.run_us(100_000);
    let expected = ControllerState::Fault(FaultCode::INDEX_WRONG);
    assert_eq!(bench.state(), expected);
}

#[test]
fn a_direction_that_the_settings_have_wrong_is_a_following_error() {
    let mut bench = bench([3.0, -170.0], [0.0, -180.0]);
    bench.set(Axis::Theta, Key::EncoderReversed, 1);
    let expected = FaultCode::FOLLOWING_ERROR;
    assert_eq!(home(&mut bench).0, RequestOutcome::Failed(expected));
}

#[test]
fn counts_a_turn_that_the_settings_have_wrong_are_found_while_homing() {
    let mut bench = bench([3.0, -170.0], [0.0, -180.0]);
    bench.set(Axis::Phi, Key::EncoderZero, 0);
    bench.set(Axis::Phi, Key::EncoderCountsPerTurn, 40_000);
    let outcome = home(&mut bench).0;
    assert!(matches!(outcome, RequestOutcome::Failed(_)), "{outcome:?}");
}

#[test]
fn a_zero_that_is_wrong_is_found_by_the_switch() {
    let mut bench = bench([3.0, -170.0], [0.0, -180.0]);
    bench.set(Axis::Phi, Key::EncoderZero, counts(180.5) as i32);
    let expected = FaultCode::HOME_MISMATCH;
    assert_eq!(home(&mut bench).0, RequestOutcome::Failed(expected));
}

#[test]
fn turned_by_hand_over_its_index_it_shows_angles_from_there() {
    let mut bench = bench([3.0, -170.0], [10.0, -180.0]);
    let shown = |bench: &TestBench| {
        let status = bench.controller.status(bench.now_us);
        f64::from(status.axes[0].encoder_udeg) * 1e-6
    };
    let before = shown(&bench);
    assert!((before - 3.0).abs() > 1.0, "{before}° before the index");
    for _ in 0..80 {
        bench.arm.axis(Axis::Theta).slip(100_000.0);
        bench.run_us(20_000);
    }
    assert!((shown(&bench) - 11.0).abs() < 0.03, "{}°", shown(&bench));
    assert_eq!(bench.state(), ControllerState::Unhomed);
}

#[test]
fn a_restart_in_mid_turn_lets_homing_look_for_the_index() {
    let mut bench = bench([3.0, -170.0], [0.0, -180.0]);
    assert_eq!(home(&mut bench).0, RequestOutcome::Done);
    assert_eq!(move_to(&mut bench, [20.0, -150.0]), RequestOutcome::Done);
    bench.arm.reset_outputs();
    let stored = bench.controller.settings().to_bytes();
    bench.controller = gonia_firmware::controller::ArmController::new(bench.now_us, Some(&stored));
    bench.run_us(100_000);
    assert_eq!(bench.state(), ControllerState::Unhomed);
    assert_eq!(home(&mut bench).0, RequestOutcome::Done);
    assert_stands_at(&bench, PARK_DEG, "after a restart");
}

#[test]
fn a_board_without_pins_and_a_ring_that_is_too_fast_are_refused_with_a_reason() {
    let set = |bench: &mut TestBench, key: Key, value| {
        let (axis, key) = (Axis::Theta, key.number());
        let answer = bench.ask(&Message::SetSetting(Setting { axis, key, value }));
        answer.err().map(|refusal| refusal.to_string())
    };
    let mut with = bench([3.0, -170.0], [0.0, -180.0]);
    let refusal = set(&mut with, Key::EncoderCountsPerTurn, 500_000);
    let expected = "max_speed times encoder_counts_per_turn would be 20834 counts/s, and a quadrature ring is \
                    followed up to 20000; lower max_speed, or fit a ring of fewer lines";
    assert_eq!(refusal.as_deref(), Some(expected));
    let mut without = TestBench::near_home();
    without.arm.take_quadrature_pins();
    let refusal = set(&mut without, Key::EncoderKind, 2);
    let expected = "the board has no pins for such an encoder or driver; see its wiring page, or use another board";
    assert_eq!(refusal.as_deref(), Some(expected));
    assert_eq!(set(&mut without, Key::EncoderKind, 1), None);
}
