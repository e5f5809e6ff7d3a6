//! The encoder's error map from readings against a reference: a least-squares fit of two harmonics.
//! What the map is stands in `gonia_firmware::error_map`.

use gonia_brdf::Elementary;
use nalgebra::{DMatrix, DVector};

/// Readings over less than this cannot tell two harmonics apart: one is fitted, degrees.
const ARC_FOR_TWO_DEG: f64 = 270.0;

/// The axis at rest: what the encoder says without a map, and where it truly is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// By encoder, degrees.
    pub encoder_deg: f64,
    /// By the reference (an autocollimator on a polygon, a theodolite), degrees.
    pub reference_deg: f64,
}

/// A fitted map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorMapFit {
    /// For the keys of `Key::ERROR_MAP`, in their order, µdeg.
    pub amplitudes_udeg: [i32; 4],
    /// How far 0° by the encoder lies from 0° by the reference, degrees.
    pub zero_off_deg: f64,
    /// RMS of encoder − reference about its mean before, degrees.
    pub rms_before_deg: f64,
    /// The same with the map.
    pub rms_after_deg: f64,
}

/// Why there is no map.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MapFitError {
    /// Not enough readings to know a fit from a coincidence.
    #[error("{given} readings are too few for an error map: take at least {needed}")]
    TooFew {
        /// How many there are.
        given: usize,
        /// How many there must be.
        needed: usize,
    },
    /// The readings do not determine the harmonics.
    #[error("the readings lie too close together for an error map: spread them over the travel")]
    TooClose,
    /// An error larger than a map is for.
    #[error("an error of {0:.3} degrees is no eccentricity: check the ring and the reference")]
    TooLarge(f64),
}

/// Fits a map. `zero_deg` is the encoder's zero as a place on the ring, degrees. With readings over
/// less than 270° of it the map has one harmonic, and is good within them only.
///
/// # Errors
/// Fewer than twice as many readings as unknowns, readings in one place, or errors above 0.5°.
pub fn fit_error_map(readings: &[Reading], zero_deg: f64) -> Result<ErrorMapFit, MapFitError> {
    let places = || readings.iter().map(|r| r.encoder_deg);
    let arc_deg = places().fold(f64::MIN, f64::max) - places().fold(f64::MAX, f64::min);
    let harmonics = if arc_deg >= ARC_FOR_TWO_DEG { 2 } else { 1 };
    let unknowns = 1 + 2 * harmonics;
    if readings.len() < 2 * unknowns {
        return Err(MapFitError::TooFew {
            given: readings.len(),
            needed: 2 * unknowns,
        });
    }
    let basis = |place_deg: f64, column: usize| {
        let harmonic = column.div_ceil(2) as f64;
        let angle = harmonic * place_deg.to_radians();
        match column {
            0 => 1.0,
            odd if odd % 2 == 1 => angle.cosine(),
            _ => angle.sine(),
        }
    };
    let matrix = DMatrix::from_fn(readings.len(), unknowns, |row, column| {
        basis(readings[row].encoder_deg + zero_deg, column)
    });
    let errors = DVector::from_iterator(
        readings.len(),
        readings.iter().map(|r| r.encoder_deg - r.reference_deg),
    );
    let svd = matrix.clone().svd(true, true);
    let (least, most) = (svd.singular_values.min(), svd.singular_values.max());
    // Within an eighth of a turn the constant and the cosine are the same to a thousandth.
    if least.is_nan() || least < 1e-3 * most {
        return Err(MapFitError::TooClose);
    }
    let solution = svd.solve(&errors, 0.0).map_err(|_| MapFitError::TooClose)?;
    let mut amplitudes_udeg = [0; 4];
    for (amplitude, deg) in amplitudes_udeg.iter_mut().zip(solution.iter().skip(1)) {
        if deg.is_nan() || deg.abs() > 0.5 {
            return Err(MapFitError::TooLarge(*deg));
        }
        *amplitude = (deg * 1e6).round() as i32;
    }
    let at_zero: f64 = (0..unknowns)
        .map(|column| basis(zero_deg, column) * solution[column])
        .sum();
    let left = &errors - matrix * &solution;
    let about_mean = errors.add_scalar(-errors.mean());
    let rms = |v: &DVector<f64>| (v.norm_squared() / v.len() as f64).sqrt();
    Ok(ErrorMapFit {
        amplitudes_udeg,
        zero_off_deg: at_zero,
        rms_before_deg: rms(&about_mean),
        rms_after_deg: rms(&left),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(n: usize, arc_deg: f64, error: impl Fn(f64) -> f64) -> Vec<Reading> {
        (0..n)
            .map(|i| {
                let place = arc_deg * i as f64 / n as f64;
                Reading {
                    encoder_deg: place,
                    reference_deg: place - error(place.to_radians()),
                }
            })
            .collect()
    }

    #[test]
    fn a_map_is_found_again() {
        let error =
            |p: f64| 0.007 + 0.05 * p.sine() - 0.02 * p.cosine() + 0.003 * (2.0 * p).cosine();
        let fit = fit_error_map(&readings(24, 360.0, error), 0.0).unwrap();
        assert_eq!(fit.amplitudes_udeg, [-20_000, 50_000, 3_000, 0]);
        assert!((fit.zero_off_deg - error(0.0)).abs() < 1e-9);
        assert!(fit.rms_before_deg > 0.03 && fit.rms_after_deg < 1e-9);
    }

    #[test]
    fn over_a_quarter_of_a_turn_one_harmonic_is_fitted() {
        let error = |p: f64| 0.05 * (p + 0.3).sine();
        let fit = fit_error_map(&readings(10, 90.0, error), 0.0).unwrap();
        assert_eq!(fit.amplitudes_udeg[2..], [0, 0]);
        assert!(fit.rms_after_deg < 1e-6, "{fit:?}");
    }

    #[test]
    fn too_few_too_close_and_too_large_are_refused() {
        let few = fit_error_map(&readings(5, 90.0, f64::sine), 0.0);
        let needed = 6;
        assert_eq!(few, Err(MapFitError::TooFew { given: 5, needed }));
        assert_eq!(
            fit_error_map(&readings(10, 1.0, |_| 0.0), 0.0),
            Err(MapFitError::TooClose)
        );
        assert!(matches!(
            fit_error_map(&readings(24, 360.0, |p| 3.0 * p.sine()), 0.0),
            Err(MapFitError::TooLarge(_))
        ));
    }
}
