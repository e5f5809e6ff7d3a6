//! Homing from wherever an axis may stand, with every kind of home switch.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, RequestOutcome};
use gonia_protocol::settings::{Axis, Key};

use super::TestBench;
use crate::plant::{HomeCam, PlantConfig};

/// φ as it is by default: 735° from home to its highest target.
const HOME_DEG: f64 = -190.0;
const PARK_DEG: f64 = -185.0;
/// Where a sure switch leaves φ: the encoder's own error and half of the gear's play.
const ACCURACY_DEG: f64 = 0.03;

/// A φ with such a home switch, standing there.
fn phi(change: impl Fn(&mut PlantConfig), start_deg: f64) -> TestBench {
    let mut phi = PlantConfig::worm_axis(HOME_DEG * 1e6, start_deg * 1e6);
    change(&mut phi);
    TestBench::new(phi)
}

fn every_turn(width_deg: f64) -> impl Fn(&mut PlantConfig) {
    let width_udeg = width_deg * 1e6;
    move |phi| phi.home_cam = HomeCam::EveryTurn { width_udeg }
}

/// The contact nearest below a place.
fn contact_below(start_deg: f64) -> f64 {
    HOME_DEG + 360.0 * ((start_deg - HOME_DEG) / 360.0).floor()
}

fn assert_is_home(bench: &TestBench, case: &str) {
    let off_deg = bench.phi_deg() - PARK_DEG;
    assert!(off_deg.abs() < ACCURACY_DEG, "{case}: {off_deg}°");
}

#[test]
fn a_switch_that_works_from_home_down_is_sure_of_the_turn_from_everywhere() {
    for start_deg in [
        -194.0, -190.1, -189.9, -100.0, 167.0, 169.9, 171.0, 400.0, 528.0, 544.0,
    ] {
        let case = format!("from {start_deg}°");
        let mut bench = phi(|_| {}, start_deg);
        assert_eq!(bench.home(), RequestOutcome::Done, "{case}");
        assert_is_home(&bench, &case);
        let probed_deg = HOME_DEG - bench.lowest_phi_deg;
        assert!((4.9..5.2).contains(&probed_deg), "{case}: {probed_deg}°");
    }
}

#[test]
fn a_cam_that_works_every_turn_is_found_out_on_an_axis_of_two() {
    for width_deg in [0.3, 3.0, 4.5] {
        for start_deg in [
            -190.1, -189.9, -100.0, 169.9, 170.1, 300.0, 529.9, 530.1, 544.0,
        ] {
            let case = format!("cam of {width_deg}°, from {start_deg}°");
            let mut bench = phi(every_turn(width_deg), start_deg);
            let expected = FaultCode::HOME_AMBIGUOUS;
            assert_eq!(bench.home(), RequestOutcome::Failed(expected), "{case}");
            assert_eq!(bench.state(), ControllerState::Fault(expected), "{case}");
            // No further down than a search and a probe go anyway.
            let below_deg = contact_below(start_deg + width_deg) - bench.lowest_phi_deg;
            assert!(below_deg < 5.2, "{case}: {below_deg}° below the contact");
        }
    }
}

#[test]
fn a_cam_that_works_every_turn_serves_an_axis_of_less_than_one() {
    // Narrower than the way that the fast search needs to slow down, and wider.
    for width_deg in [0.3, 3.0] {
        for start_deg in [-190.1, -189.9, -100.0, 100.0, 159.0] {
            let case = format!("cam of {width_deg}°, from {start_deg}°");
            let mut bench = phi(every_turn(width_deg), start_deg);
            bench.set(Axis::Phi, Key::SoftMax, 160_000_000);
            assert_eq!(bench.home(), RequestOutcome::Done, "{case}");
            assert_is_home(&bench, &case);
        }
    }
}

#[test]
fn a_worn_switch_is_not_taken_for_a_cam() {
    for start_deg in [-191.0, -150.0] {
        let mut bench = phi(|phi| phi.bounce_us = 40_000, start_deg);
        assert_eq!(bench.home(), RequestOutcome::Done, "from {start_deg}°");
        assert_is_home(&bench, "worn");
    }
}

#[test]
fn a_cut_wire_of_a_normally_closed_switch_is_a_fault_before_the_arm_goes_down() {
    let mut bench = phi(|_| {}, -150.0);
    bench.arm.axis(Axis::Phi).cut_switch();
    let expected = FaultCode::HOME_SWITCH_STUCK;
    assert_eq!(bench.home(), RequestOutcome::Failed(expected));
    assert!(bench.lowest_phi_deg > -150.1, "{}°", bench.lowest_phi_deg);
}

#[test]
fn a_switch_homes_either_way_round_and_a_wrong_setting_is_a_fault() {
    for (opens_at_home, setting) in [(true, 1), (false, 0), (true, 0), (false, 1)] {
        let case = format!("opens at home: {opens_at_home}, home_normally_closed {setting}");
        let mut bench = phi(|phi| phi.home_opens = opens_at_home, -150.0);
        bench.set(Axis::Phi, Key::HomeNormallyClosed, setting);
        let outcome = bench.home();
        if opens_at_home == (setting == 1) {
            assert_eq!(outcome, RequestOutcome::Done, "{case}");
            assert_is_home(&bench, &case);
        } else {
            let expected = FaultCode::HOME_SWITCH_STUCK;
            assert_eq!(outcome, RequestOutcome::Failed(expected), "{case}");
        }
    }
}
