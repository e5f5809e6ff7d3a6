//! Which settings suit a material: coordinates by cross-validation over held-out frames, the
//! tolerance by what cutting may cost.

use super::Settings;
use super::budget::affordable_tolerance;
use super::coordinates::Coordinates;
use super::hold_out::{HoldOut, Prediction};
use super::known::Known;
use super::patches::cover;

/// Held-out bins that are predicted, at most, over all sets.
const TESTS: usize = 1200;
/// One frame in so many is held out.
const HOLD_OUT: u32 = 24;
/// What competes: the power of the sum's length in the coordinates, and the kernel's weight. The last is for
/// retro-reflectors, whose peak depends on the difference of light and view.
const CANDIDATES: [(f64, f64); 4] = [(0.0, 0.3), (0.1, 0.3), (0.25, 0.3), (0.25, 1.0)];

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

/// Takes the noise that the bins show, then tries the candidate coordinates on frames
/// (or, without frame numbers, clusters of directions) held out. With too few of them, `base` keeps
/// its coordinates. The tolerance is raised where cutting would cost more than the budget.
pub fn select(known: &Known, base: Settings) -> Selection {
    let bins = known.bins();
    let mut settings = Settings {
        one_bin_in: known.one_bin_in(),
        ..base
    };
    if let Some(variance) = bins.noise_variance() {
        settings.noise_variance = variance;
    }
    let sets = HoldOut::sets(bins);
    let tests = TESTS / sets as usize;
    let candidates = CANDIDATES.map(|(power, kernel_weight)| Settings {
        coordinates: Coordinates {
            power,
            ..base.coordinates
        },
        kernel_weight,
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
            log_rms: (squares.iter().sum::<f64>() / squares.len() as f64).sqrt(),
        })
        .collect();
    if let Some(best) = trials.iter().min_by(|a, b| a.log_rms.total_cmp(&b.log_rms)) {
        settings = best.settings;
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
        .filter_map(|c| prediction.residual[c])
        .map(|r| f64::from(r.clamp(-RESIDUAL_MAX, RESIDUAL_MAX)).powi(2));
    (f64::from(lowest) >= INTERIOR_DEG.to_radians().cos()).then(|| squares.sum::<f64>() / 3.0)
}
