//! Which settings data bear: by cross-validation, and by what the data can contradict.

use super::data::Datum;
use super::local::Predicted;
use super::places::{Near, Places, exchanged};
use super::{NEIGHBOURS_MOST, ScatteredKernel, Settings, predict_from, preferred};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::interpolate::Coordinates;
use crate::interpolate::coordinates::Pair;
use crate::symmetry::Symmetry;
use rayon::prelude::*;

/// Places that are left out and predicted, at most: each alone, or with its frame.
const TESTS: usize = 240;
/// The same where a weak dependence on the azimuth is looked for.
const MANY_TESTS: usize = 1500;
/// Fewer tests than this are no evidence.
const TESTS_MIN: usize = 24;
/// A residual beyond this counts as this …
const RESIDUAL_MAX: f64 = 1.0;
/// … and in the search for a dependence on the azimuth, beyond so many times the median of all.
const OUTLIER: f64 = 5.0;
/// Of two settings the simpler one is taken unless its error is larger by this share …
const WORSE_SHARE: f64 = 0.02;
/// … and by so many standard errors of the difference.
const WORSE_SIGMAS: f64 = 1.5;
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
    let tests = Tests::new(data, TESTS);
    if tests.numbers.len() < TESTS_MIN {
        return untested(asked, one_azimuth, reason);
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
    let usual = trials
        .iter()
        .map(Trial::median)
        .fold(RESIDUAL_MAX, f64::min);
    let may_depend_on_azimuth = asked.is_none() && !one_azimuth;
    let mut best = tests.tuned(
        simplest(&trials, &tests, usual, may_depend_on_azimuth),
        usual,
    );
    if may_depend_on_azimuth && best.settings.symmetry.is_isotropic() {
        // A weak dependence takes more tests, and the settings with the least error of their own.
        let many = Tests::new(data, MANY_TESTS);
        if many.shows_azimuth(&many.trial(best.settings)) {
            let anisotropic: Vec<Trial> = trials
                .into_iter()
                .filter(|trial| !trial.settings.symmetry.is_isotropic())
                .collect();
            best = tests.tuned(simplest(&anisotropic, &tests, usual, false), usual);
        }
    }
    let contradicted_by = asked
        .filter(|symmetry| *symmetry != Symmetry::None)
        .and_then(|_| contradiction(&tests, &best, usual));
    Choice {
        settings: best.settings,
        reason,
        log_error: Some(best.error),
        contradicted_by,
        error_factor: best.factor(),
    }
}

/// What is taken of too few data to test anything by.
fn untested(asked: Option<Symmetry>, one_azimuth: bool, reason: Reason) -> Choice {
    let unasked = if one_azimuth {
        Symmetry::Isotropic
    } else {
        Symmetry::None
    };
    let reason = if reason == Reason::Shown {
        Reason::TooFew
    } else {
        reason
    };
    let settings = Settings {
        symmetry: asked.unwrap_or(unasked),
        ..Settings::DEFAULT
    };
    Choice {
        reason,
        ..Choice::of(settings)
    }
}

/// The error without the symmetry that was asked for, where the data contradict that.
fn contradiction(tests: &Tests, best: &Trial, usual: f64) -> Option<f64> {
    let without = tests.trial(Settings {
        symmetry: Symmetry::None,
        ..best.settings
    });
    let shows_azimuth = || best.settings.symmetry.is_isotropic() && tests.shows_azimuth(best);
    (worse(best, &without, usual) || shows_azimuth()).then_some(without.error)
}

/// The first, in order of simplicity, that the data do not contradict.
fn simplest(trials: &[Trial], tests: &Tests, usual: f64, may_depend_on_azimuth: bool) -> Trial {
    let sound = |trial: &&Trial| {
        !(may_depend_on_azimuth
            && trial.settings.symmetry.is_isotropic()
            && tests.shows_azimuth(trial))
    };
    let best = trials
        .iter()
        .filter(sound)
        .min_by(|a, b| a.level(usual).total_cmp(&b.level(usual)));
    let first = |best: &Trial| {
        trials
            .iter()
            .filter(sound)
            .find(|trial| !worse(trial, best, usual))
            .cloned()
    };
    best.and_then(first).unwrap_or(Trial {
        settings: Settings::DEFAULT,
        predictions: Vec::new(),
        residuals: Vec::new(),
        error: f64::INFINITY,
    })
}

/// Whether the first is worse than the second beyond chance.
fn worse(a: &Trial, b: &Trial, usual: f64) -> bool {
    let n = a.residuals.len().min(b.residuals.len()) as f64;
    let differences = || {
        let pairs = a.residuals.iter().zip(&b.residuals);
        pairs.map(|(a, b)| loss(a, usual) - loss(b, usual))
    };
    let mean = differences().sum::<f64>() / n;
    let variance = differences().map(|d| (d - mean).powi(2)).sum::<f64>() / n;
    mean > WORSE_SHARE * b.level(usual) && mean > WORSE_SIGMAS * (variance / n).sqrt()
}

/// Mean over the channels of a residual's size.
fn size(residual: &[f64; 3]) -> f64 {
    residual.iter().map(|r| r.abs()).sum::<f64>() / 3.0
}

/// What a residual counts: by its square where it is of the usual size, which noise makes, and by its root where
/// it is far larger, so that a few places on a peak do not hide what all others say.
fn loss(residual: &[f64; 3], usual: f64) -> f64 {
    size(residual).hypotenuse(usual).sqrt() - usual.sqrt()
}

/// Places that are left out.
struct Tests<'a> {
    data: &'a [Datum],
    numbers: Vec<usize>,
}

/// What a test is predicted from: data nearest first around its place, and around the reciprocal one.
struct Neighbourhood {
    own: (Pair, Vec<Near>),
    reciprocal: Option<(Pair, Vec<Near>)>,
}

/// Settings, and what they predict of the tests.
#[derive(Clone)]
struct Trial {
    settings: Settings,
    predictions: Vec<Predicted>,
    /// Logarithm of predicted over measured, per channel.
    residuals: Vec<[f64; 3]>,
    error: f64,
}

impl<'a> Tests<'a> {
    fn new(data: &'a [Datum], at_most: usize) -> Self {
        let count = data.len().min(at_most);
        // Evenly among all, in an order without the period of any scan.
        let numbers = (0..count).map(|k| (k * data.len() + data.len() / 2) / count);
        Self {
            data,
            numbers: numbers.collect(),
        }
    }

    fn trial(&self, settings: Settings) -> Trial {
        self.trial_at(&self.neighbourhoods(settings), settings)
    }

    /// The data around the tests without their own groups, as many as any trial takes: they do not depend on
    /// the kernel.
    fn neighbourhoods(&self, settings: Settings) -> Vec<Neighbourhood> {
        let places = Places::new(self.data, &settings);
        let around = |test: &Datum, place: Pair| {
            let keep = |other: u32| self.data[other as usize].group != test.group;
            (
                place,
                places.around(place, NEIGHBOURS_MOST, &settings, keep),
            )
        };
        self.numbers
            .par_iter()
            .map(|number| {
                let test = &self.data[*number];
                let place = settings.coordinates.pair(test.light, test.view);
                Neighbourhood {
                    own: around(test, place),
                    reciprocal: (!settings.reciprocal_data).then(|| around(test, exchanged(place))),
                }
            })
            .collect()
    }

    fn trial_at(&self, neighbourhoods: &[Neighbourhood], settings: Settings) -> Trial {
        let data = self.data;
        let predicted = |(place, near): &(Pair, Vec<Near>)| {
            let near = &near[..near.len().min(settings.neighbours)];
            predict_from(data, near, &settings, *place)
        };
        let predictions: Vec<Predicted> = neighbourhoods
            .par_iter()
            .map(|here| {
                let own = predicted(&here.own);
                match &here.reciprocal {
                    Some(reciprocal) => preferred(&own, &predicted(reciprocal)),
                    None => own,
                }
            })
            .collect();
        let residuals: Vec<[f64; 3]> = predictions
            .iter()
            .zip(&self.numbers)
            .map(|(p, n)| [0, 1, 2].map(|c| residual(p.value[c], data[*n].value[c])))
            .collect();
        let error = residuals.iter().map(size).sum::<f64>() / residuals.len() as f64;
        Trial {
            settings,
            predictions,
            residuals,
            error,
        }
    }

    /// The same symmetry with the coordinates, the kernel and the nugget that predict best.
    fn tuned(&self, start: Trial, usual: f64) -> Trial {
        let systems = [
            Coordinates::sum_difference(0.5),
            Coordinates {
                exponent: 0.25,
                weight: 0.3,
            },
            Coordinates::half_difference(0.3),
        ];
        let mut best = start;
        let mut around = self.neighbourhoods(best.settings);
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
            let others = self.neighbourhoods(settings);
            if self.try_at(&others, settings, usual, &mut best) {
                around = others;
            }
        }
        let found = best.settings.nugget;
        for factor in NUGGETS {
            let settings = best.settings.with_nugget(found * factor);
            self.try_at(&around, settings, usual, &mut best);
        }
        best
    }

    /// Takes settings in place of the best ones where they predict better.
    fn try_at(
        &self,
        around: &[Neighbourhood],
        settings: Settings,
        usual: f64,
        best: &mut Trial,
    ) -> bool {
        let trial = self.trial_at(around, settings);
        let is_better = trial.level(usual) < best.level(usual);
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
        // Few that are far off would hide what all the others say.
        let cap = OUTLIER * trial.median();
        let residuals: Vec<f64> = trial
            .residuals
            .iter()
            .map(|r| (r.iter().sum::<f64>() / 3.0).clamp(-cap, cap))
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
    /// What is compared: see [`loss`].
    fn level(&self, usual: f64) -> f64 {
        if self.residuals.is_empty() {
            return f64::INFINITY;
        }
        let sum: f64 = self.residuals.iter().map(|r| loss(r, usual)).sum();
        sum / self.residuals.len() as f64
    }

    fn median(&self) -> f64 {
        let mut sizes: Vec<f64> = self.residuals.iter().map(size).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or(RESIDUAL_MAX)
    }

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
