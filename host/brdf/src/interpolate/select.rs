//! Which settings suit a material: coordinates by cross-validation over held-out frames, the
//! tolerance by what cutting may cost.

use super::budget::affordable_tolerance;
use super::coordinates::Coordinates;
use super::hold_out::{HoldOut, Prediction};
use super::known::{Known, MANY_BINS};
use super::patches::cover;
use super::{Preset, Settings};
use crate::bins::Bins;

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
    /// Natural logarithm of predicted over measured in the interior, half of it bright bins, the samples'
    /// noise included: RMS, or of few bins the mean absolute value.
    pub log_error: f64,
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
    let trying = Trying::of(bins, base);
    let trials: Vec<Trial> = CANDIDATES
        .iter()
        .filter_map(|(power, kernel_weight)| {
            let tried = Settings {
                coordinates: Coordinates {
                    power: *power,
                    ..base.coordinates
                },
                kernel_weight: *kernel_weight,
                noise_variance: settings.noise_variance,
                one_bin_in: settings.one_bin_in,
                ..trying.blocks
            };
            let log_error = trying.error(known, &tried)?;
            Some(Trial {
                settings: tried,
                log_error,
            })
        })
        .collect();
    if let Some(best) = trials
        .iter()
        .min_by(|a, b| a.log_error.total_cmp(&b.log_error))
    {
        settings.coordinates = best.settings.coordinates;
        settings.kernel_weight = best.settings.kernel_weight;
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

/// How candidates are tried.
struct Trying<'a> {
    /// Sets of frames held out in turn.
    sets: Vec<HoldOut<'a>>,
    /// The blocks that predict them.
    blocks: Settings,
    /// Errors count by this power.
    power: f64,
}

impl<'a> Trying<'a> {
    /// A few poses see so little of a highlight that a handful of frames would decide by chance, and
    /// squares would be those of a few bins on its slope: there, every frame is held out once and errors
    /// count as they are. The coordinates then matter more than the blocks, so all presets try the same.
    fn of(bins: &'a Bins, base: Settings) -> Self {
        let few = bins.bins().len() < MANY_BINS;
        let (sets, tests) = if few { (HOLD_OUT, 200) } else { (1, 1200) };
        Self {
            sets: (0..sets)
                .filter_map(|set| HoldOut::new(bins, set, HOLD_OUT, tests))
                .collect(),
            blocks: if few { Preset::Fast.settings() } else { base },
            power: if few { 1.0 } else { 2.0 },
        }
    }

    /// See [`Trial::log_error`]; `None` when there is nothing to hold out.
    fn error(&self, known: &Known, settings: &Settings) -> Option<f64> {
        let sorted = known.sorted_for(settings.coordinates);
        let known = sorted.as_ref().unwrap_or(known);
        let predictions = self
            .sets
            .iter()
            .flat_map(|set| set.predict(known, settings));
        let errors: Vec<f64> = predictions
            .filter(is_interior)
            .map(|p| {
                let residuals = p.residual.iter().flatten();
                let errors = residuals.map(|r| f64::from(r.abs().min(RESIDUAL_MAX)));
                errors.map(|e| e.powf(self.power)).sum::<f64>() / 3.0
            })
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        (!errors.is_empty()).then(|| mean.powf(1.0 / self.power))
    }
}

/// A residual beyond this is no better known: an outlier must not decide.
const RESIDUAL_MAX: f32 = 1.0;

/// Whether both elevations are below [`INTERIOR_DEG`].
fn is_interior(prediction: &Prediction) -> bool {
    let lowest = prediction.bin.light[2].min(prediction.bin.view[2]);
    f64::from(lowest) >= INTERIOR_DEG.to_radians().cos()
}
