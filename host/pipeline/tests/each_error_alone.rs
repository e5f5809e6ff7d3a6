//! Each input of the measurement equation by itself: a session that has its error, beside the same session without it.

#![allow(clippy::expect_used)]

#[path = "../benches/coverage/alone.rs"]
mod alone;
#[path = "../benches/coverage/session.rs"]
mod session;

use gonia_rig::Input;

/// U (k = 2) is true of so many cells, and with the input left out of the budget of fewer.
const TRUE_OF: f64 = 0.93;
/// Of fewer cells the share means little.
const CELLS_MIN: usize = 500;

/// With the input that has the error in the budget the true values lie within U; with it left out they do not.
#[test]
#[ignore = "24 sessions from frames to cells: some CPU-minutes"]
fn cells_lie_within_u_if_the_budget_holds_the_error_and_not_if_it_is_left_out() {
    let mut failed = Vec::new();
    // `GONIA_INPUTS=stray,height` leaves only those whose keys hold one of these.
    let only = std::env::var("GONIA_INPUTS").unwrap_or_default();
    let is_in = |input: &Input| only.split(',').any(|part| input.key().contains(part));
    for input in Input::ALL.into_iter().filter(is_in) {
        let of = alone::with_error_of(input);
        let text = format!("{}: {of:.3?}", input.key());
        println!("{text}");
        let covers = of.within > TRUE_OF && of.left_out < TRUE_OF && of.shown_by >= CELLS_MIN;
        // Where the changes are seen well, they are of the size that the budget says.
        let is_right = of.explained < 0.5 || (least_ratio(input)..1.25).contains(&of.ratio);
        if !covers || !is_right {
            failed.push(text);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

/// Of stray light the equation is cautious: it takes all of the frame about the sample for black paint (0.05), and the
/// simulated desk (0.03) ends at 400 mm.
fn least_ratio(input: Input) -> f64 {
    if input == Input::StrayLight { 0.3 } else { 0.8 }
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
        let is_right = (least_ratio(input)..1.25).contains(&ratio);
        if sound != off || !is_right || explained < 0.7 {
            failed.push(text);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
