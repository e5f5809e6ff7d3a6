//! The budget that samples or a dense BRDF carry in their provenance.

use crate::budget::UNCERTAINTIES;
use crate::provenance::Provenance;
use gonia_rig::{Budget, Input, NoBudget};

/// The budget of data with this provenance, if it says one: of several sets of samples together, with the largest of
/// each input.
///
/// # Errors
/// A record that is none.
pub fn budget_in(provenance: &Provenance) -> Result<Option<Budget>, NoBudget> {
    let is_budget = |name: &str| {
        let last = name.rsplit('.').next();
        last == Some(UNCERTAINTIES)
    };
    let mut found: Option<Budget> = None;
    for (_, text) in provenance.iter().filter(|(name, _)| is_budget(name)) {
        let other: Budget = text.parse()?;
        found = Some(match found {
            None => other,
            Some(one) => Input::ALL.into_iter().fold(one, |one, input| {
                let larger = other.value(input);
                if larger > one.value(input) {
                    one.with(input, larger)
                } else {
                    one
                }
            }),
        });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_rig::{ReferenceCalibration, Rig};

    #[test]
    fn of_several_sets_of_samples_each_inputs_largest_counts() {
        let rig = Rig::paper(100);
        let known = ReferenceCalibration::KnownReference;
        let budget = Budget::new(known, 0.3, [1.0; 3], |input| rig.input(input));
        let (a, b) = (
            budget.clone().with(Input::Drift, 0.05),
            budget.with(Input::Reference, 0.07),
        );
        assert_eq!(budget_in(&Provenance::new()), Ok(None));
        let mut provenance = Provenance::from([
            ("samples.1.uncertainties".to_owned(), a.to_string()),
            ("samples.2.uncertainties".to_owned(), b.to_string()),
        ]);
        let both = budget_in(&provenance).unwrap().unwrap();
        assert_eq!(both.value(Input::Drift), 0.05);
        assert_eq!(both.value(Input::Reference), 0.07);
        assert_eq!(both.value(Input::Offset), a.value(Input::Offset));
        provenance.insert("samples.3.uncertainties".into(), "unknown".into());
        assert!(budget_in(&provenance).is_err());
    }
}
