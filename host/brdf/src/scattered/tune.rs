//! The coordinates, the kernel, the noise and the number of samples to a datum that predict best.

use super::left_out::{Neighbourhoods, Tests};
use super::trial::{Trial, is_as_near, worse};
use super::{ScatteredKernel, Settings};
use crate::interpolate::Coordinates;

/// Kernels and nuggets that compete: smooth to rough, little noise to much.
const KERNELS: [(ScatteredKernel, f64); 6] = [
    (ScatteredKernel::Matern32, 1e-6),
    (ScatteredKernel::Matern32, 1e-2),
    (ScatteredKernel::Matern32, 1.0),
    (ScatteredKernel::Exponential, 1e-4),
    (ScatteredKernel::Exponential, 1e-2),
    (ScatteredKernel::Exponential, 1e-1),
];
/// Data of one difference of light and view are near each other.
const OF_RETRO_REFLECTORS: Coordinates = Coordinates::sum_difference(3.0);
/// Then the best nugget is tried times these.
const NUGGETS: [f64; 7] = [0.1, 0.3, 3.0, 10.0, 30.0, 100.0, 1000.0];
/// Then noise of a variance of so many times the square of the median residual, with the nugget times these.
const NOISES: [f64; 6] = [0.3, 0.6, 1.0, 1.5, 2.0, 2.4];
const NOISE_NUGGETS: [f64; 2] = [1e-3, 0.1];
/// Then so many neighbours are merged into one …
const MERGED: [usize; 3] = [4, 16, 64];
/// … with the nugget times these, where so many are left.
const MERGED_NUGGETS: [f64; 3] = [1.0, 0.35, 0.1];
const MERGED_MIN: usize = 100;

impl Tests<'_> {
    /// The same symmetry with the coordinates and the kernel that predict best.
    pub fn suited(&self, start: Trial, usual: f64) -> Trial {
        let systems = [
            Coordinates::sum_difference(0.5),
            Coordinates {
                exponent: 0.25,
                weight: 0.3,
            },
            Coordinates::half_difference(0.3),
        ];
        let mut best = start;
        let around = self.neighbourhoods(best.settings);
        for (kernel, nugget) in KERNELS {
            let settings = Settings {
                kernel,
                ..best.settings.with_nugget(nugget)
            };
            self.try_at(&around, settings, usual, &mut best);
        }
        for coordinates in systems {
            let settings = Settings {
                coordinates,
                ..best.settings
            };
            let around = self.neighbourhoods(settings);
            self.try_at(&around, settings, usual, &mut best);
        }
        // A retro-reflector's peak is far nearer in them or not at all.
        let settings = Settings {
            coordinates: OF_RETRO_REFLECTORS,
            ..best.settings
        };
        let trial = self.trial_at(&self.neighbourhoods(settings), settings);
        if worse(&best, &trial, usual) {
            best = trial;
        }
        best
    }

    /// The same with the noise and the number of samples to a datum that predict best.
    pub fn tuned(&self, start: Trial, usual: f64) -> Trial {
        let mut best = start;
        let around = self.neighbourhoods(best.settings);
        self.with_likely_nugget(&around, usual, &mut best);
        self.with_noise(&around, usual, &mut best);
        self.merge(usual, &mut best);
        best
    }

    /// Of nuggets that predict alike, the one with which the data are most likely: residuals are mostly noise, and
    /// say little of it.
    fn with_likely_nugget(&self, around: &Neighbourhoods, usual: f64, best: &mut Trial) {
        let found = best.settings;
        let mut trials: Vec<Trial> = NUGGETS
            .into_iter()
            .map(|factor| Settings {
                nugget: found.nugget * factor,
                ..found
            })
            .map(|settings| self.trial_at(around, settings))
            .collect();
        trials.push(best.clone());
        let nearest = trials
            .iter()
            .min_by(|a, b| a.level(usual).total_cmp(&b.level(usual)));
        let Some(nearest) = nearest.cloned() else {
            return;
        };
        let likely = trials
            .into_iter()
            .filter(|trial| !worse(trial, &nearest, usual))
            .max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood));
        if let Some(likely) = likely {
            let settings = found.with_nugget(likely.settings.nugget);
            *best = if settings == likely.settings {
                likely
            } else {
                self.trial_at(around, settings)
            };
        }
    }

    /// With noise that is the same everywhere, where that predicts better.
    fn with_noise(&self, around: &Neighbourhoods, usual: f64, best: &mut Trial) {
        let found = best.settings;
        let scale = best.median().powi(2);
        let mut trials = vec![best.clone()];
        for share in NOISES {
            for factor in NOISE_NUGGETS {
                let settings = Settings {
                    noise_variance: share * scale,
                    ..found.with_nugget((found.nugget * factor).max(1e-7))
                };
                trials.push(self.trial_at(around, settings));
            }
        }
        let nearest = trials
            .iter()
            .min_by(|a, b| a.level(usual).total_cmp(&b.level(usual)));
        let Some(nearest) = nearest.cloned() else {
            return;
        };
        // Of those that predict alike, the one whose errors are what it says.
        let honest = trials
            .into_iter()
            .filter(|trial| !worse(trial, &nearest, usual))
            .max_by(|a, b| a.score().total_cmp(&b.score()));
        if let Some(honest) = honest {
            *best = honest;
        }
    }

    /// Neighbours are merged as long as nothing is predicted worse.
    fn merge(&self, usual: f64, best: &mut Trial) {
        for merged in MERGED {
            if self.data.places.len() < MERGED_MIN * merged {
                return;
            }
            let settings = Settings {
                merged,
                ..best.settings
            };
            let around = self.neighbourhoods(settings);
            let trials = MERGED_NUGGETS.map(|factor| {
                let settings = settings.with_nugget(best.settings.nugget * factor);
                self.trial_at(&around, settings)
            });
            let nearest = trials
                .into_iter()
                .min_by(|a, b| a.level(usual).total_cmp(&b.level(usual)));
            match nearest {
                Some(nearest) if is_as_near(&nearest, best, usual) => *best = nearest,
                _ => return,
            }
        }
    }

    /// Takes settings in place of the best ones where they predict better.
    fn try_at(&self, around: &Neighbourhoods, settings: Settings, usual: f64, best: &mut Trial) {
        let trial = self.trial_at(around, settings);
        if trial.level(usual) < best.level(usual) {
            *best = trial;
        }
    }
}
