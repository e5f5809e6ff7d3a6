//! Which settings data bear: by cross-validation, and by what the data can contradict.

use super::data::Datum;
use super::local::Predicted;
use super::places::{Places, exchanged};
use super::{ScatteredKernel, Settings, predict, preferred};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::interpolate::Coordinates;
use crate::symmetry::Symmetry;
use rayon::prelude::*;

/// Places that are left out and predicted, at most: each alone, or with its frame.
const TESTS: usize = 300;
/// Fewer tests than this are no evidence.
const TESTS_MIN: usize = 24;
/// A residual beyond this counts as this: an outlier must not decide.
const RESIDUAL_MAX: f64 = 1.0;
/// Of two settings the simpler one is taken unless its error is larger by this share …
const WORSE_SHARE: f64 = 0.02;
/// … and by so many standard errors of the difference.
const WORSE_SIGMAS: f64 = 1.0;
/// A dependence on the azimuth is shown where its size is so many standard errors …
const SHOWN_SIGMAS: f64 = 4.0;
/// … of one of so many waves.
const WAVES: usize = 16;
/// Azimuths within this are the same: arms do not stop exactly. Degrees.
const SAME_DEG: f64 = 1.0;
/// Half the width of a 95 % interval, in standard errors of a normal distribution.
const Z95: f64 = 1.96;
/// The factor of standard errors where nothing was tested: rather wide.
const UNTESTED_FACTOR: f64 = 2.0;
/// Tested factors lie between these.
const FACTORS: (f64, f64) = (0.5, 20.0);

/// Kernels and nuggets that compete: smooth to rough, little noise to much.
const KERNELS: [(ScatteredKernel, f64); 5] = [
    (ScatteredKernel::Matern32, 1e-6),
    (ScatteredKernel::Matern32, 1e-2),
    (ScatteredKernel::Matern32, 1.0),
    (ScatteredKernel::Exponential, 1e-4),
    (ScatteredKernel::Exponential, 1e-2),
];
/// Then the best nugget is tried times these.
const NUGGETS: [f64; 4] = [0.1, 0.3, 3.0, 10.0];

/// Why a symmetry was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// It was asked for.
    Asked,
    /// One azimuth was measured, which can neither show nor contradict it.
    Assumed,
    /// Samples of several azimuths agree with it, or contradict every other one.
    Shown,
    /// Too few samples to tell.
    TooFew,
    /// No one has looked: of many samples none is needed.
    Untested,
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Reason::Asked => "as asked for",
            Reason::Assumed => "assumed: one azimuth was measured",
            Reason::Shown => "by cross-validation",
            Reason::TooFew => "too few samples to tell",
            Reason::Untested => "not looked for",
        })
    }
}

/// The settings for some data.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The settings.
    pub settings: Settings,
    /// Why this symmetry.
    pub reason: Reason,
    /// Mean absolute logarithm of predicted over measured of places that were left out, noise included; `None`
    /// of too few.
    pub log_error: Option<f64>,
    /// The same without any symmetry, where the data contradict the one asked for.
    pub contradicted_by: Option<f64>,
    /// By what standard errors are multiplied.
    pub error_factor: f64,
}

impl Choice {
    /// Of settings that were asked for and not tested.
    pub(super) fn of(settings: Settings) -> Self {
        Self {
            settings,
            reason: Reason::Asked,
            log_error: None,
            contradicted_by: None,
            error_factor: UNTESTED_FACTOR,
        }
    }
}

pub(super) fn choose(data: &[Datum], asked: Option<Symmetry>) -> Choice {
    let one_azimuth = has_one_azimuth(data);
    let reason = match asked {
        Some(_) => Reason::Asked,
        None if one_azimuth => Reason::Assumed,
        None => Reason::Shown,
    };
    let tests = Tests::new(data);
    if tests.numbers.len() < TESTS_MIN {
        let unasked = if one_azimuth {
            Symmetry::Isotropic
        } else {
            Symmetry::None
        };
        return Choice {
            settings: Settings {
                symmetry: asked.unwrap_or(unasked),
                ..Settings::DEFAULT
            },
            reason: if reason == Reason::Shown {
                Reason::TooFew
            } else {
                reason
            },
            log_error: None,
            contradicted_by: None,
            error_factor: UNTESTED_FACTOR,
        };
    }
    let symmetries: &[Symmetry] = match asked {
        Some(Symmetry::Isotropic | Symmetry::Turns) => &[Symmetry::Isotropic, Symmetry::Turns],
        Some(Symmetry::HalfTurn) => &[Symmetry::HalfTurn],
        Some(Symmetry::None) => &[Symmetry::None],
        None if one_azimuth => &[Symmetry::Isotropic, Symmetry::Turns],
        None => &[
            Symmetry::Isotropic,
            Symmetry::Turns,
            Symmetry::HalfTurn,
            Symmetry::None,
        ],
    };
    let trials: Vec<Trial> = symmetries
        .iter()
        .flat_map(|symmetry| {
            [true, false].map(|reciprocal_data| Settings {
                symmetry: *symmetry,
                reciprocal_data,
                ..Settings::DEFAULT
            })
        })
        .map(|settings| tests.trial(settings))
        .collect();
    let simplest = simplest(&trials, &tests, asked.is_none() && !one_azimuth);
    let best = tests.tuned(simplest);
    let contradicted_by = asked
        .filter(|symmetry| *symmetry != Symmetry::None)
        .and_then(|_| {
            let settings = Settings {
                symmetry: Symmetry::None,
                ..best.settings
            };
            let without = tests.trial(settings);
            (worse(&best, &without)
                || best.settings.symmetry.is_isotropic() && tests.shows_azimuth(&best))
            .then_some(without.error)
        });
    Choice {
        settings: best.settings,
        reason,
        log_error: Some(best.error),
        contradicted_by,
        error_factor: best.factor(),
    }
}

/// The first, in order of simplicity, that the data do not contradict.
fn simplest(trials: &[Trial], tests: &Tests, may_depend_on_azimuth: bool) -> Trial {
    let sound = |trial: &&Trial| {
        !(may_depend_on_azimuth
            && trial.settings.symmetry.is_isotropic()
            && tests.shows_azimuth(trial))
    };
    let best = trials
        .iter()
        .filter(sound)
        .min_by(|a, b| a.level.total_cmp(&b.level));
    let first = |best: &Trial| {
        trials
            .iter()
            .filter(sound)
            .find(|trial| !worse(trial, best))
            .cloned()
    };
    best.and_then(first).unwrap_or(Trial {
        settings: Settings::DEFAULT,
        predictions: Vec::new(),
        residuals: Vec::new(),
        error: f64::INFINITY,
        level: f64::INFINITY,
    })
}

/// Whether the first is worse than the second beyond chance.
fn worse(a: &Trial, b: &Trial) -> bool {
    let n = a.residuals.len().min(b.residuals.len()) as f64;
    let differences = || {
        let pairs = a.residuals.iter().zip(&b.residuals);
        pairs.map(|(a, b)| size(a).sqrt() - size(b).sqrt())
    };
    let mean = differences().sum::<f64>() / n;
    let variance = differences().map(|d| (d - mean).powi(2)).sum::<f64>() / n;
    mean > WORSE_SHARE * b.level && mean > WORSE_SIGMAS * (variance / n).sqrt()
}

/// Mean over the channels of a residual's size.
fn size(residual: &[f64; 3]) -> f64 {
    residual.iter().map(|r| r.abs()).sum::<f64>() / 3.0
}

/// Places that are left out.
struct Tests<'a> {
    data: &'a [Datum],
    numbers: Vec<usize>,
}

/// Settings, and what they predict of the tests.
#[derive(Clone)]
struct Trial {
    settings: Settings,
    predictions: Vec<Predicted>,
    /// Logarithm of predicted over measured, per channel.
    residuals: Vec<[f64; 3]>,
    error: f64,
    /// Mean root of the residuals' sizes: what is compared, because few large ones would hide what all the
    /// others say.
    level: f64,
}

impl<'a> Tests<'a> {
    fn new(data: &'a [Datum]) -> Self {
        let count = data.len().min(TESTS);
        // Evenly among all, in an order without the period of any scan.
        let numbers = (0..count).map(|k| (k * data.len() + data.len() / 2) / count);
        Self {
            data,
            numbers: numbers.collect(),
        }
    }

    fn trial(&self, settings: Settings) -> Trial {
        self.trial_at(&Places::new(self.data, &settings), settings)
    }

    fn trial_at(&self, places: &Places, settings: Settings) -> Trial {
        let data = self.data;
        let predictions: Vec<Predicted> = self
            .numbers
            .par_iter()
            .map(|number| {
                let test = &data[*number];
                let keep = |other: u32| data[other as usize].group != test.group;
                let place = settings.coordinates.pair(test.light, test.view);
                let here = predict(data, places, &settings, place, keep);
                if settings.reciprocal_data {
                    return here;
                }
                let there = predict(data, places, &settings, exchanged(place), keep);
                preferred(&here, &there)
            })
            .collect();
        let residuals: Vec<[f64; 3]> = predictions
            .iter()
            .zip(&self.numbers)
            .map(|(p, n)| [0, 1, 2].map(|c| residual(p.value[c], data[*n].value[c])))
            .collect();
        let error = residuals.iter().map(size).sum::<f64>() / residuals.len() as f64;
        let level = residuals.iter().map(|r| size(r).sqrt()).sum::<f64>() / residuals.len() as f64;
        Trial {
            settings,
            predictions,
            residuals,
            error,
            level,
        }
    }

    /// The same symmetry with the coordinates, the kernel and the nugget that predict best.
    fn tuned(&self, start: Trial) -> Trial {
        let systems = [
            Coordinates::sum_difference(0.5),
            Coordinates {
                exponent: 0.25,
                weight: 0.3,
            },
            Coordinates::half_difference(0.3),
        ];
        let mut best = start;
        let places = Places::new(self.data, &best.settings);
        for (kernel, nugget) in KERNELS {
            let settings = Settings {
                kernel,
                ..best.settings.with_nugget(nugget)
            };
            self.try_at(&places, settings, &mut best);
        }
        let mut best_places = places;
        for coordinates in systems {
            let settings = Settings {
                coordinates,
                ..best.settings
            };
            let places = Places::new(self.data, &settings);
            if self.try_at(&places, settings, &mut best) {
                best_places = places;
            }
        }
        let found = best.settings.nugget;
        for factor in NUGGETS {
            let settings = best.settings.with_nugget(found * factor);
            self.try_at(&best_places, settings, &mut best);
        }
        best
    }

    /// Takes settings in place of the best ones where they predict better.
    fn try_at(&self, places: &Places, settings: Settings, best: &mut Trial) -> bool {
        let trial = self.trial_at(places, settings);
        let is_better = trial.level < best.level;
        if is_better {
            *best = trial;
        }
        is_better
    }

    /// Whether what is left after a fit depends on the azimuth of light or view.
    fn shows_azimuth(&self, trial: &Trial) -> bool {
        let waves = |d: &Datum| -> Vec<f64> {
            let sum = [0, 1, 2].map(|k| d.light[k] + d.view[k]);
            // Of light, view, their sum, and the sum of their azimuths; once and twice a turn.
            let planar = |v: Vec3| [v[0], v[1]];
            let times =
                |a: [f64; 2], b: [f64; 2]| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
            let [light, view, sum] = [d.light, d.view, sum].map(planar);
            let both = times(light, view);
            // Around the normal there is no azimuth: what is squared fades there.
            [light, view, sum, both]
                .into_iter()
                .flat_map(|z| [z, times(z, z)])
                .flatten()
                .collect()
        };
        let residuals: Vec<f64> = trial
            .residuals
            .iter()
            .map(|r| r.iter().sum::<f64>() / 3.0)
            .collect();
        let at: Vec<Vec<f64>> = self.numbers.iter().map(|n| waves(&self.data[*n])).collect();
        let count = residuals.len() as f64;
        let mean = residuals.iter().sum::<f64>() / count;
        (0..WAVES).any(|k| {
            let middle = at.iter().map(|w| w[k]).sum::<f64>() / count;
            let (mut sum, mut squares) = (0.0, 0.0);
            for (r, w) in residuals.iter().zip(&at) {
                let product = (r - mean) * (w[k] - middle);
                sum += product;
                squares += product * product;
            }
            sum.abs() > SHOWN_SIGMAS * squares.sqrt()
        })
    }
}

impl Trial {
    /// With which 95 % of the residuals lie within 1.96 standard errors, noise included.
    fn factor(&self) -> f64 {
        let mut squares: Vec<f64> = self
            .residuals
            .iter()
            .zip(&self.predictions)
            .flat_map(|(r, p)| {
                [0, 1, 2].map(|c| {
                    let variance = p.relative[c].powi(2).max(1e-18);
                    ((r[c] / Z95).powi(2) - p.noise[c]) / variance
                })
            })
            .collect();
        squares.sort_by(f64::total_cmp);
        // Of few, rather one too many.
        let rank = ((0.95 * squares.len() as f64).ceil() as usize).min(squares.len() - 1);
        squares[rank].max(0.0).sqrt().clamp(FACTORS.0, FACTORS.1)
    }
}

/// Logarithm of predicted over measured; of what is noise about zero, the difference over the predicted.
fn residual(predicted: f64, measured: f64) -> f64 {
    let ratio = measured / predicted.max(1e-300);
    let residual = if ratio > 0.2 {
        -ratio.natural_log()
    } else {
        1.0 - ratio
    };
    residual.clamp(-RESIDUAL_MAX, RESIDUAL_MAX)
}

/// Whether all lights, or all views, lie on one axis through the normal.
fn has_one_azimuth(data: &[Datum]) -> bool {
    let on_axis = |of: fn(&Datum) -> Vec3| {
        let inclined = |v: &Vec3| v[0].hypotenuse(v[1]) > SAME_DEG.to_radians();
        let axis = |v: Vec3| v[1].arc_tangent2(v[0]);
        let Some(first) = data.iter().map(of).find(inclined) else {
            return true;
        };
        let same = |v: Vec3| (axis(v) - axis(first)).sine().abs() <= SAME_DEG.to_radians();
        data.iter().map(of).all(|v| !inclined(&v) || same(v))
    };
    on_axis(|d| d.light) || on_axis(|d| d.view)
}
