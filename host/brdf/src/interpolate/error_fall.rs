//! How the errors of interpolation fall with the number of frames: what more poses would buy.
//!
//! The same left-out bins are predicted by all other frames and by half of them. Errors go about with a power of the
//! number of frames, and the two give its exponent.

use super::FillSettings;
use super::block::kernel::{AnyKernel, NewBlock};
use super::cross_validation::{Fold, MeanPrediction, TESTS_MIN};
use super::data::Data;
use super::error_bars::Calibration;
use crate::elementary::Elementary;
use crate::quantile::weighted_quantile;

/// Means of left-out bins that are predicted twice, at most.
const TESTS: usize = 3000;
/// A fold leaves out one frame in so many.
const ONE_IN: u32 = 24;
/// The errors are compared that so large a share does not exceed: a standard deviation where they are normal.
const SHARE: f32 = 0.68;
/// Where less than this share of it is error, and the rest noise, nothing is said.
const LEAST_ERROR: f32 = 0.1;
/// No exponent is larger: smoother materials bring no more, and noise of the tests would.
const LARGEST: f32 = 2.0;

/// Exponents p of `u ∝ n^−p` by part of the domain, n the number of frames, 0 ..= 2; `None` where noise hides them.
/// Highlights have none: the few bins that are left out there predict it no better than a guess.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorFall {
    /// Of all cells.
    pub all: Option<f32>,
    /// Of both polar angles at most 75 degrees.
    pub interior: Option<f32>,
    /// Of either above.
    pub grazing: Option<f32>,
}

impl ErrorFall {
    /// Measures it by cross-validation. All `None` where there are too few frames for a fold.
    pub fn measure<const N: usize>(
        data: &Data<N>,
        settings: &FillSettings,
        calibration: &Calibration,
    ) -> Self
    where
        dyn AnyKernel: NewBlock<N>,
    {
        let bins = data.bins();
        let sorted = data.sorted_for(settings.coordinates);
        let data = sorted.as_ref().unwrap_or(data);
        let folds = Fold::number_of_many_groups(bins, ONE_IN);
        let (mut whole, mut half) = (Vec::new(), Vec::new());
        for number in 0..folds {
            let fold = Fold::one_of_many(bins, number, ONE_IN, TESTS / folds as usize);
            let Some(fold) = fold else { continue };
            whole.extend(fold.predict_means(data, settings));
            half.extend(fold.halved().predict_means(data, settings));
        }
        let exponent = |is_in: &dyn Fn(bool) -> bool| {
            let pairs = whole.iter().zip(&half);
            let of_part = pairs.filter(|(of, _)| is_in(Calibration::is_grazing(of)));
            let (whole, half): (Vec<_>, Vec<_>) = of_part.unzip();
            if whole.len() < TESTS_MIN {
                return None;
            }
            let [whole, half] = [whole, half].map(|means| variance(&means, calibration));
            let ratio = f64::from(half?) / f64::from(whole?);
            Some(((0.5 * ratio.natural_log() / std::f64::consts::LN_2) as f32).clamp(0.0, LARGEST))
        };
        Self {
            all: exponent(&|_| true),
            interior: exponent(&|grazing| !grazing),
            grazing: exponent(&|grazing| grazing),
        }
    }
}

/// The variance of the errors of such means without the noise of their bins; `None` where that is nearly all.
fn variance<const N: usize>(
    means: &[&MeanPrediction<N>],
    calibration: &Calibration,
) -> Option<f32> {
    let mut squares = Vec::with_capacity(N * means.len());
    let (mut noise, mut weights) = (0.0f32, 0.0f32);
    for mean in means {
        for c in 0..N {
            if let Some(residual) = mean.residual[c] {
                let weight = mean.first.weight;
                squares.push((residual * residual, weight));
                noise += weight * calibration.noise_of(mean, c);
                weights += weight;
            }
        }
    }
    let square = weighted_quantile(&mut squares, SHARE)?;
    let error = square - noise / weights;
    (error > LEAST_ERROR * square).then_some(error)
}
