//! Which settings suit a material: coordinates by cross-validation, the tolerance by what refinement
//! may cost.

use super::block::kernel::{AnyKernel, NewBlock};
use super::budget::affordable_tolerance;
use super::coordinates::Coordinates;
use super::cross_validation::{Fold, Prediction};
use super::data::{Data, MANY_BINS};
use super::patches::cover;
use super::{FillSettings, Preset};
use crate::bins::Bins;
use crate::elementary::Elementary;

/// A fold leaves out one frame in so many.
const ONE_IN: u32 = 24;
/// What competes: the exponent of the sum's length in the coordinates, and the kernel's weight. The last is for
/// retro-reflectors, whose peak depends on the difference of light and view.
const CANDIDATES: [(f64, f64); 4] = [(0.0, 0.3), (0.1, 0.3), (0.25, 0.3), (0.25, 1.0)];
/// A kernel that looks at hardly anything but the difference.
const RETRO_REFLECTING: (f64, f64) = (0.25, 8.0);
/// It is taken where it leaves less than this share of the others' error at frames left out, noise included: it is blind to
/// how far the sum of light and view is from any datum, and a matt material, which depends on neither, may be a little nearer with it at
/// frames left out and twice as far off between rings. Of a retro-reflector the share was .52 from the paper's plan and
/// .72 from its every tenth pose; of matte .96.
const WORTH_BLINDNESS: f64 = 0.8;
/// Twice the data make a fill about twice as dear. They are taken where they leave less than this share of the error at
/// frames left out, noise included. Of 18 materials on the paper's plan it was .52 to .57 for three with lobes of few degrees,
/// .80 for one, and .93 and more for the others.
const WORTH_TWICE: f64 = 0.7;

/// Only where both polar angles are below this do frames have others all around them; beyond, it is
/// extrapolation that would be judged. Degrees.
const INTERIOR_DEG: f64 = 75.0;

/// Settings, and their error in cross-validation.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The settings.
    pub settings: FillSettings,
    /// Natural logarithm of predicted over measured in the interior, half of it bright bins, the samples'
    /// noise included: RMS, or of few bins the mean absolute value.
    pub log_error: f64,
}

/// The outcome of a selection.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// The best settings.
    pub settings: FillSettings,
    /// All that were compared; empty when there were too few frames for a fold.
    pub candidates: Vec<Candidate>,
}

/// Takes the noise that the bins show, then compares the candidate coordinates by cross-validation,
/// grouped by image (or, without frame numbers, by clusters of directions). With too few of these, `base`
/// keeps its coordinates. The tolerance is raised to the target error, and where refinement would cost more than the
/// budget.
pub fn select<const N: usize>(data: &Data<N>, base: FillSettings) -> Selection
where
    dyn AnyKernel: NewBlock<N>,
{
    let bins = data.bins();
    let mut settings = FillSettings {
        one_bin_in: data.one_bin_in(),
        ..base
    };
    if let Some(variance) = bins.noise_variance() {
        settings.noise_variance = variance;
    }
    let comparison = Comparison::of(bins, base);
    let candidate = |(exponent, kernel_weight): &(f64, f64)| {
        let tried = FillSettings {
            coordinates: Coordinates {
                exponent: *exponent,
                ..base.coordinates
            },
            kernel_weight: *kernel_weight,
            noise_variance: settings.noise_variance,
            one_bin_in: settings.one_bin_in,
            kernel: base.kernel,
            ..comparison.blocks
        };
        let log_error = comparison.error(data, &tried)?;
        Some(Candidate {
            settings: tried,
            log_error,
        })
    };
    let mut candidates: Vec<Candidate> = CANDIDATES.iter().filter_map(candidate).collect();
    let order = |a: &&Candidate, b: &&Candidate| a.log_error.total_cmp(&b.log_error);
    let usual = candidates.iter().min_by(order).cloned();
    let blind = candidate(&RETRO_REFLECTING);
    candidates.extend(blind.clone());
    let is_worth =
        |of: &Candidate, usual: &Candidate| of.log_error < WORTH_BLINDNESS * usual.log_error;
    if let Some(usual) = usual {
        let best = blind.filter(|of| is_worth(of, &usual)).unwrap_or(usual);
        settings.coordinates = best.settings.coordinates;
        settings.kernel_weight = best.settings.kernel_weight;
        if let Some(twice) = comparison.with_twice_the_data(data, &best) {
            if twice.log_error < WORTH_TWICE * best.log_error {
                settings.neighbours = twice.settings.neighbours;
            }
            candidates.push(twice);
        }
    }
    let cover = cover(bins.grid(), &settings.patch_sizes_deg());
    let sorted = data.sorted_for(settings.coordinates);
    let subset = sorted
        .as_ref()
        .unwrap_or(data)
        .subset(settings.coordinates, |_| true);
    // Where all is refined, all is.
    if settings.tolerance > 0.0 {
        let target = settings.target_error / settings.noise_sigma();
        settings.tolerance = settings.tolerance.max(target);
    }
    settings.tolerance = affordable_tolerance(&subset, &cover, &settings);
    Selection {
        settings,
        candidates,
    }
}

/// How candidates are compared.
struct Comparison<'a, const N: usize> {
    folds: Vec<Fold<'a, N>>,
    /// The blocks that predict.
    blocks: FillSettings,
    /// Errors count by this exponent.
    exponent: f64,
    /// Whether there are few bins.
    few: bool,
}

impl<'a, const N: usize> Comparison<'a, N>
where
    dyn AnyKernel: NewBlock<N>,
{
    /// A few poses see so little of a highlight that a handful of frames would decide by chance, and
    /// squares would be those of a few bins on its slope: there, every frame is left out once and errors
    /// count as they are. The coordinates then matter more than the blocks, so all presets take the same.
    fn of(bins: &'a Bins<N>, base: FillSettings) -> Self {
        let few = bins.bins().len() < MANY_BINS;
        let (folds, tests) = if few { (ONE_IN, 200) } else { (1, 1200) };
        Self {
            folds: (0..folds)
                .filter_map(|number| Fold::new(bins, number, ONE_IN, tests))
                .collect(),
            blocks: if few { Preset::Fast.settings() } else { base },
            exponent: if few { 1.0 } else { 2.0 },
            few,
        }
    }

    /// The best candidate with twice the data, where that could pay: a few poses choose their coordinates by other
    /// blocks than they are filled with, and of an error no larger than a sample's noise little can be taken off.
    fn with_twice_the_data(&self, data: &Data<N>, best: &Candidate) -> Option<Candidate> {
        let neighbours = 2 * best.settings.neighbours;
        let noise = f64::from(best.settings.noise_sigma());
        if self.few || neighbours > best.settings.neighbours_most || best.log_error <= noise {
            return None;
        }
        let settings = FillSettings {
            neighbours,
            ..best.settings
        };
        let log_error = self.error(data, &settings)?;
        Some(Candidate {
            settings,
            log_error,
        })
    }

    /// See [`Candidate::log_error`]; `None` without a fold.
    fn error(&self, data: &Data<N>, settings: &FillSettings) -> Option<f64> {
        let sorted = data.sorted_for(settings.coordinates);
        let data = sorted.as_ref().unwrap_or(data);
        let predictions = self
            .folds
            .iter()
            .flat_map(|fold| fold.predict(data, settings));
        let errors: Vec<f64> = predictions
            .filter(is_interior)
            .map(|p| {
                let residuals = p.residual.iter().flatten();
                let errors = residuals.map(|r| f64::from(r.abs().min(RESIDUAL_MAX)));
                errors.map(|e| e.power(self.exponent)).sum::<f64>() / N as f64
            })
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        (!errors.is_empty()).then(|| mean.power(1.0 / self.exponent))
    }
}

/// A residual beyond this counts as this: an outlier must not decide.
const RESIDUAL_MAX: f32 = 1.0;

/// Whether both polar angles are below [`INTERIOR_DEG`].
fn is_interior<const N: usize>(prediction: &Prediction<N>) -> bool {
    let lowest = prediction.bin.light[2].min(prediction.bin.view[2]);
    f64::from(lowest) >= INTERIOR_DEG.to_radians().cosine()
}
