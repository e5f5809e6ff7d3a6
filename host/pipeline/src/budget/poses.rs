//! What more poses would buy, by the fall of the errors that cross-validation found.

use crate::budget::summary::{CellBudget, by_stratum, combined, median};
use crate::provenance::Provenance;
use gonia_brdf::Elementary;
use gonia_brdf::interpolate::ErrorFall;
use gonia_rig::Stratum;

/// Name of the fact in the provenance of a dense BRDF that says how its errors of interpolation fall with more poses.
const ERROR_FALL: &str = "error_fall";
/// Its parts.
const PARTS: [Stratum; 4] = [
    Stratum::All,
    Stratum::Interior,
    Stratum::Grazing,
    Stratum::Highlight,
];

/// The fact that says it, as [`fall_in`] reads it.
pub(crate) fn fall_fact(fall: &ErrorFall) -> (String, String) {
    let of = [fall.all, fall.interior, fall.grazing, fall.highlight];
    let text = PARTS.iter().zip(of).filter_map(|(part, exponent)| {
        let exponent = exponent?;
        Some(format!("{part} {exponent:.2}"))
    });
    let text: Vec<String> = text.collect();
    (ERROR_FALL.to_owned(), text.join(", "))
}

/// How errors fall with more poses, where a provenance says so.
pub fn fall_in(provenance: &Provenance) -> Option<ErrorFall> {
    let is_it = |name: &str| name.rsplit('.').next() == Some(ERROR_FALL);
    let (_, text) = provenance.iter().find(|(name, _)| is_it(name))?;
    let of = |part: Stratum| {
        text.split(", ").find_map(|of| {
            let (name, exponent) = of.split_once(' ')?;
            let exponent: f32 = exponent.parse().ok()?;
            (name == part.name() && (0.0..=2.0).contains(&exponent)).then_some(exponent)
        })
    };
    let [all, interior, grazing, highlight] = PARTS.map(of);
    Some(ErrorFall {
        all,
        interior,
        grazing,
        highlight,
    })
}

/// The exponent that is known of a part; of one by itself, that of all.
fn exponent(fall: &ErrorFall, part: Stratum) -> Option<f32> {
    let own = match part {
        Stratum::Interior => fall.interior,
        Stratum::Grazing | Stratum::Unmeasured => fall.grazing,
        Stratum::Highlight => fall.highlight,
        Stratum::All | Stratum::Retro => None,
    };
    own.or(fall.all)
}

/// The median combined standard uncertainty (k = 1, a share of the values) of each part of the domain with so many times
/// the poses; as it is where it is not known what these bring.
pub fn with_poses(
    cells: &CellBudget<'_>,
    fall: &ErrorFall,
    times: f64,
) -> Vec<(Stratum, Option<f64>)> {
    let of_part = |(part, of): (Stratum, Vec<usize>)| {
        let factor = exponent(fall, part).map(|p| times.power(-f64::from(p)));
        let u = factor.map(|factor| {
            let shares = of.iter().filter_map(|cell| cells.shares(*cell));
            let all = shares.map(|mut shares| {
                shares[0] *= factor;
                combined(&shares, None)
            });
            median(all.collect())
        });
        (part, u)
    };
    by_stratum(cells).into_iter().map(of_part).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_of_the_fall_is_read_again() {
        let fall = ErrorFall {
            all: Some(0.75),
            interior: None,
            grazing: Some(0.5),
            highlight: Some(2.0),
        };
        let (name, text) = fall_fact(&fall);
        assert_eq!(text, "all 0.75, grazing 0.50, highlight 2.00");
        let provenance = Provenance::from([(format!("samples.1.{name}"), text)]);
        assert_eq!(fall_in(&provenance), Some(fall));
        assert_eq!(fall_in(&Provenance::new()), None);
        assert_eq!(exponent(&fall, Stratum::Interior), Some(0.75));
        let odd = Provenance::from([(name, "all nan, grazing -3, highlight".into())]);
        assert_eq!(fall_in(&odd), Some(ErrorFall::default()));
    }
}
