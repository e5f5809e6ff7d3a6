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
    for input in Input::ALL {
        let of = baseline.with_error_of(input);
        let text = format!("{}: {of:.3?}", input.key());
        println!("{text}");
        let shows = of.explained > 0.5;
        let is_right = (0.8..1.25).contains(&of.ratio) && of.within > 0.93;
        if shows && !(is_right && of.left_out < of.within) || !shows && SHOWN.contains(&input) {
            failed.push(text);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
