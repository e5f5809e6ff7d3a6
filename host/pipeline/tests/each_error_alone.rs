//! Each input of the measurement equation by itself: a session that has its error, beside the same session without it.

#![allow(clippy::expect_used)]

#[path = "../benches/coverage/alone.rs"]
mod alone;
#[path = "../benches/coverage/session.rs"]
mod session;

use alone::Baseline;
use gonia_rig::Input;

/// The change that an error makes is what the budget says of it, within U; with that input left out of the budget it is
/// not.
#[test]
#[ignore = "13 sessions from frames to cells: some CPU-minutes"]
fn each_error_changes_values_by_what_the_budget_says_and_not_less_when_it_is_left_out() {
    let baseline = Baseline::new();
    let mut failed = Vec::new();
    for input in Input::ALL {
        let of = baseline.with_error_of(input);
        let text = format!("{}: {of:.3?}", input.key());
        println!("{text}");
        let is_right = (0.8..1.25).contains(&of.ratio) && of.within > 0.93;
        if !is_right || of.left_out > 0.93 {
            failed.push(text);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
