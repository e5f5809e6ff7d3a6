//! Which settings suit a material: coordinates by cross-validation over held-out frames, the
//! tolerance by what cutting may cost.

use super::Settings;
use super::budget::affordable_tolerance;
use super::coordinates::Coordinates;
use super::hold_out::{HoldOut, Prediction};
use super::known::Known;
use super::nodes::log_noise_variance;
use super::patches::cover;

/// Held-out bins that are predicted, at most, over all sets.
const TESTS: usize = 1200;
/// Bins that tell the noise, about.
const NOISE_BINS: usize = 300_000;
/// One frame in so many is held out.
const HOLD_OUT: u32 = 24;
/// The systems of coordinates that compete; of those that are as good as the best, the first.
const CANDIDATES: [Coordinates; 3] = [
    Coordinates::HalfDifference { weight: 0.5 },
    Coordinates::SumDifference { weight: 0.5 },
    Coordinates::SumDifference { weight: 1.0 },
];

/// A ratio of errors that means nothing.
const TIE: f64 = 1.05;
/// Only where both elevations are below this do held-out frames have others all around them; beyond, it
/// is extrapolation that would be judged. Degrees.
const INTERIOR_DEG: f64 = 75.0;

/// One candidate and how it did.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The settings tried.
    pub settings: Settings,
    /// RMS of the natural logarithm of predicted over measured in the interior, half of it bright bins, the
    /// samples' noise included.
    pub log_rms: f64,
}

/// The outcome of a selection.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// The best settings.
    pub settings: Settings,
    /// All that was tried; empty when there were too few frames to hold any out.
    pub trials: Vec<Trial>,
}

/// Estimates the noise from the spread inside bins, then tries the candidate coordinates on frames
/// (or, without frame numbers, clusters of directions) held out. With too few of them, `base` keeps
/// its coordinates. The tolerance is raised where cutting would cost more than the budget.
pub fn select(known: &Known, base: Settings) -> Selection {
    let bins = known.bins();
    let mut settings = Settings {
        one_bin_in: known.one_bin_in(),
        ..base
    };
    let stride = (bins.bins().len() / NOISE_BINS).max(1) | 1;
    if let Some(variance) = log_noise_variance(bins.bins().iter().step_by(stride)) {
        settings.noise_variance = variance;
    }
    let sets = HoldOut::sets(bins);
    let tests = TESTS / sets as usize;
    let candidates = CANDIDATES.map(|coordinates| Settings {
        coordinates,
        ..settings
    });
    let mut squares = CANDIDATES.map(|_| Vec::new());
    for set in 0..sets {
        let Some(held_out) = HoldOut::new(known, set, HOLD_OUT, tests) else {
            continue;
        };
        for (candidate, squares) in candidates.iter().zip(&mut squares) {
            squares.extend(held_out.predict(candidate).iter().filter_map(square));
        }
    }
    let trials: Vec<Trial> = candidates
        .into_iter()
        .zip(&squares)
        .filter(|(_, squares)| !squares.is_empty())
        .map(|(settings, squares)| Trial {
            settings,
            log_rms: mean(squares).sqrt(),
        })
        .collect();
    let best = squares.iter().min_by(|a, b| mean(a).total_cmp(&mean(b)));
    let as_good = best.and_then(|best| squares.iter().position(|other| tie(best, other)));
    if let Some(trial) = as_good.and_then(|number| trials.get(number)) {
        settings = trial.settings;
    }
    let cover = cover(bins.grid(), &settings.patch_sizes_deg());
    let sorted = known.sorted_for(settings.coordinates);
    let nodes = sorted
        .as_ref()
        .unwrap_or(known)
        .part(settings.coordinates, |_| true);
    settings.tolerance = affordable_tolerance(&nodes, &cover, &settings);
    Selection { settings, trials }
}

/// A residual beyond this is no better known: an outlier must not decide.
const RESIDUAL_MAX: f32 = 1.0;

/// Mean square residual of a prediction in the interior. The brightest tenth of the bins are half of the
/// tests, and count as much: weighed by their number, highlights would not count at all on a plan so
/// sparse that few frames see them.
fn square(prediction: &Prediction) -> Option<f64> {
    let lowest = prediction.bin.light[2].min(prediction.bin.view[2]);
    let squares = (0..3)
        .filter_map(|c| prediction.residual(c))
        .map(|r| f64::from(r.clamp(-RESIDUAL_MAX, RESIDUAL_MAX)).powi(2));
    (f64::from(lowest) >= INTERIOR_DEG.to_radians().cos()).then(|| squares.sum::<f64>() / 3.0)
}

/// Whether a candidate is as good as the best, as far as the same tests can tell: nearly as good in any
/// case, or worse by less than the standard error of their difference, because a few tests in a sharp
/// highlight may make all of that.
fn tie(best: &[f64], other: &[f64]) -> bool {
    if mean(other) <= TIE * TIE * mean(best) {
        return true;
    }
    let differences: Vec<f64> = other.iter().zip(best).map(|(o, b)| o - b).collect();
    let worse = mean(&differences);
    let squares: Vec<f64> = differences.iter().map(|d| (d - worse).powi(2)).collect();
    worse <= (mean(&squares) / squares.len() as f64).sqrt()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_worse_on_many_tests_is_no_tie() {
        let best: Vec<f64> = (0..1000).map(|k| 1.0 + 0.1 * f64::from(k % 7)).collect();
        let times = |factor: f64| best.iter().map(|b| factor * b).collect::<Vec<f64>>();
        assert!(tie(&best, &best) && tie(&best, &times(1.1)));
        assert!(!tie(&best, &times(1.2)));
        // A fifth worse too, but by one test, and better by another.
        let mut by_one = best.clone();
        by_one[500] += 400.0;
        by_one[501] -= 140.0;
        assert!(mean(&by_one) > 1.15 * mean(&best) && tie(&best, &by_one));
    }
}
