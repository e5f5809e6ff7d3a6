//! The gear's error over a turn of the worm, from where the shaft truly is when the steps say where it
//! should be: a least-squares fit of one harmonic. What it is for stands in
//! `gonia_firmware::error_map`.

use gonia_brdf::Elementary;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// As many readings make a fit that is no coincidence.
const LEAST_READINGS: usize = 6;

/// The axis at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GearReading {
    /// Where it is, degrees: what the error is periodic in.
    pub shaft_deg: f64,
    /// How far the shaft is ahead of the steps, but for a constant, degrees.
    pub ahead_deg: f64,
}

/// A fitted gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GearMapFit {
    /// Cosine and sine, µdeg, for the keys `gear_cos` and `gear_sin`.
    pub amplitudes_udeg: [i32; 2],
    /// RMS of shaft − steps about its mean before, degrees.
    pub rms_before_deg: f64,
    /// The same with the map.
    pub rms_after_deg: f64,
}

/// Fits a gear whose error comes again every `worm_turn_deg`. `None` where the readings do not tell:
/// too few, or all at the same few phases of the worm.
pub fn fit_gear_map(readings: &[GearReading], worm_turn_deg: f64) -> Option<GearMapFit> {
    if readings.len() < LEAST_READINGS {
        return None;
    }
    let matrix = DMatrix::from_fn(readings.len(), 3, |row, column| {
        let phase = TAU * readings[row].shaft_deg / worm_turn_deg;
        [1.0, phase.cosine(), phase.sine()][column]
    });
    let ahead = DVector::from_iterator(readings.len(), readings.iter().map(|r| r.ahead_deg));
    let svd = matrix.clone().svd(true, true);
    let (least, most) = (svd.singular_values.min(), svd.singular_values.max());
    // Evenly spread phases have 0.71; a half of that still doubles no error.
    if least.is_nan() || least < 0.35 * most {
        return None;
    }
    let solution = svd.solve(&ahead, 0.0).ok()?;
    let amplitudes_udeg = [solution[1], solution[2]].map(|deg| (deg * 1e6).round() as i32);
    let left = &ahead - matrix * &solution;
    let about_mean = ahead.add_scalar(-ahead.mean());
    let rms = |v: &DVector<f64>| (v.norm_squared() / v.len() as f64).sqrt();
    Some(GearMapFit {
        amplitudes_udeg,
        rms_before_deg: rms(&about_mean),
        rms_after_deg: rms(&left),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(spacing_deg: f64) -> Vec<GearReading> {
        let reading = |i: u32| {
            let shaft_deg = spacing_deg * f64::from(i);
            let phase = TAU * shaft_deg / 4.0;
            GearReading {
                shaft_deg,
                ahead_deg: 0.2 + 0.002 * phase.cosine() - 0.003 * phase.sine(),
            }
        };
        (0..24).map(reading).collect()
    }

    #[test]
    fn a_gear_is_found_again_whatever_it_is_ahead_in_all() {
        for spacing_deg in [15.0, 9.7] {
            let fit = fit_gear_map(&readings(spacing_deg), 4.0).unwrap();
            assert_eq!(fit.amplitudes_udeg, [2_000, -3_000]);
            assert!(
                fit.rms_before_deg > 0.002 && fit.rms_after_deg < 1e-9,
                "{fit:?}"
            );
        }
    }

    #[test]
    fn stands_at_one_or_two_phases_of_the_worm_tell_nothing() {
        assert_eq!(fit_gear_map(&readings(20.0), 4.0), None);
        assert_eq!(fit_gear_map(&readings(10.0), 4.0), None);
        assert_eq!(fit_gear_map(&readings(15.0)[..5], 4.0), None);
    }
}
