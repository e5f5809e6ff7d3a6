//! Budgets for tests.

use gonia_rig::{Budget, Input, ReferenceCalibration, Rig};

/// Of the paper's rig with a known reference, where nothing is uncertain but `inputs`.
pub(crate) fn uncertain_of(inputs: &[(Input, f64)]) -> Budget {
    let rig = Rig::paper(100);
    let known = ReferenceCalibration::KnownReference;
    let all = Budget::new(known, 0.3, [1100.0, 1800.0, 14.0], |input| rig.input(input));
    let none = Input::ALL
        .into_iter()
        .fold(all, |of, input| of.with(input, 0.0));
    inputs
        .iter()
        .fold(none, |of, (input, u)| of.with(*input, *u))
}
