//! Which settings data bear: by cross-validation, and by what the data can contradict.

use super::data::{Data, Datum};
use super::local::{Local, Predicted};
use super::merge::{Merged, Without};
use super::mirror::{half_turn_is_measured, least, mirror_plane};
use super::places::{Near, Places, exchanged};
use super::residual::{RESIDUAL_MAX, loss, residual, size};
use super::{NEIGHBOURS_MOST, ScatteredKernel, Settings, preferred};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::interpolate::Coordinates;
use crate::interpolate::coordinates::Pair;
use crate::symmetry::{MirrorPlane, Symmetry, SymmetryKind};
use rayon::prelude::*;

/// Places that are left out and predicted, at most: each alone, or with its frame.
const TESTS: usize = 240;
/// The same where a weak dependence on the azimuth is looked for.
const MANY_TESTS: usize = 1500;
/// With fewer places than this a plane of symmetry is searched for only on request.
const PLANE_MIN: usize = 60;
/// A plane that was found is looked for again within so many degrees, with all that a fit takes from both of its sides …
const PLANE_WITHIN_DEG: f64 = 3.0;
/// … to about this.
const PLANE_NEAR_DEG: f64 = 0.3;
/// Fewer tests than this are no evidence.
const TESTS_MIN: usize = 24;
/// In the search for a dependence on the azimuth a residual beyond so many times the median of all counts as that.
const OUTLIER: f64 = 5.0;
/// Of two settings the simpler one is taken unless its error is larger by this share …
const WORSE_SHARE: f64 = 0.02;
/// … and by so many standard errors of the difference.
const WORSE_SIGMAS: f64 = 1.5;
/// … and its mean error is not larger than the least by this share: few that are far off, as on a lobe, count there.
const SIMPLER_SHARE: f64 = 0.05;
/// Of so many samples all that looks like noise may be a dependence on the azimuth, and of more in proportion.
const HIDDEN: f64 = 100.0;
/// A dependence on the azimuth is shown where its size is so many standard errors …
const SHOWN_SIGMAS: f64 = 4.0;
/// … of one of so many waves.
const WAVES: usize = 16;
/// Azimuths within this are the same: arms do not stop exactly. Degrees.
const SAME_DEG: f64 = 1.0;
/// Half the width of a 95 % interval, in standard errors of a normal distribution.
const Z95: f64 = 1.96;
/// The factor of standard errors where nothing was tested: rather wide.
const UNTESTED_FACTOR: f64 = 3.0;
/// Tested factors lie between these: a system takes its kernel and its nugget for known, which are of the same data, so
/// that its own errors are too small even where tests are nearly all noise.
const FACTORS: (f64, f64) = (1.2, 20.0);

/// Kernels and nuggets that compete: smooth to rough, little noise to much.
const KERNELS: [(ScatteredKernel, f64); 6] = [
    (ScatteredKernel::Matern32, 1e-6),
    (ScatteredKernel::Matern32, 1e-2),
    (ScatteredKernel::Matern32, 1.0),
    (ScatteredKernel::Exponential, 1e-4),
    (ScatteredKernel::Exponential, 1e-2),
    (ScatteredKernel::Exponential, 1e-1),
];
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
/// They predict as well where the mean error is not larger by this share.
const AS_NEAR: f64 = 0.01;

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
    /// Whether a plane of symmetry was asked for that is not determined, and none is taken: data lie too rarely on both
    /// sides of it.
    pub plane_undetermined: bool,
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
            plane_undetermined: false,
        }
    }
}

/// A symmetry that was asked for.
#[derive(Clone, Copy)]
pub(super) struct Asked {
    pub kind: SymmetryKind,
    /// Its plane, where that is known.
    pub plane: Option<MirrorPlane>,
}

impl Asked {
    fn untested(self) -> Symmetry {
        match (self.kind, self.plane) {
            (SymmetryKind::Bilateral, Some(plane)) => Symmetry::Bilateral(plane),
            (SymmetryKind::HalfTurnBilateral, Some(plane)) => Symmetry::HalfTurnBilateral(plane),
            (kind, _) => kind.untested(),
        }
    }
}

/// The symmetries that compete, without a plane, the simplest first.
fn symmetries(data: &Data, asked: Option<SymmetryKind>, one_azimuth: bool) -> &'static [Symmetry] {
    match asked {
        Some(SymmetryKind::Isotropic) => &[Symmetry::Isotropic, Symmetry::Turns],
        Some(SymmetryKind::HalfTurn | SymmetryKind::HalfTurnBilateral) => &[Symmetry::HalfTurn],
        Some(SymmetryKind::None | SymmetryKind::Bilateral) => &[Symmetry::None],
        None if one_azimuth => &[Symmetry::Isotropic, Symmetry::Turns],
        None if half_turn_is_measured(data, Settings::DEFAULT) => &[
            Symmetry::Isotropic,
            Symmetry::Turns,
            Symmetry::HalfTurn,
            Symmetry::None,
        ],
        None => &[Symmetry::Isotropic, Symmetry::Turns, Symmetry::None],
    }
}

pub(super) fn choose(data: &Data, wanted: Option<Asked>) -> Choice {
    let asked = wanted.map(|asked| asked.kind);
    let one_azimuth = has_one_azimuth(&data.places);
    let reason = match asked {
        Some(_) => Reason::Asked,
        None if one_azimuth => Reason::Assumed,
        None => Reason::Shown,
    };
    let tests = Tests::new(data, TESTS);
    if tests.numbers.len() < TESTS_MIN {
        return untested(wanted, reason);
    }
    let first: Vec<Trial> = symmetries(data, asked, one_azimuth)
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
    let usual = first.iter().map(Trial::median).fold(RESIDUAL_MAX, f64::min);
    // Each symmetry is compared with the coordinates and the kernel that suit it.
    let trials: Vec<Trial> = first
        .chunks(2)
        .map(|both| tests.suited(simplest(both, &tests, usual, false), usual))
        .collect();
    let may_depend_on_azimuth = asked.is_none() && !one_azimuth;
    let start = simplest(&trials, &tests, usual, may_depend_on_azimuth);
    let mut best = match start.settings.symmetry.is_isotropic() {
        true => tests.tuned(start, usual),
        false => with_plane(&trials, &tests, usual, wanted),
    };
    if may_depend_on_azimuth && best.settings.symmetry.is_isotropic() {
        // A weak dependence takes more tests, and the settings with the least error of their own.
        let many = Tests::new(data, MANY_TESTS);
        if many.shows_azimuth(&many.trial(best.settings)) {
            best = with_plane(&trials, &tests, usual, wanted);
        }
        if best.settings.symmetry.is_isotropic() {
            best = tests.trial(Settings {
                hidden: (HIDDEN / data.places.len() as f64).min(1.0),
                ..best.settings
            });
        }
    }
    let contradicted_by = asked
        .filter(|kind| *kind != SymmetryKind::None)
        .and_then(|_| contradiction(&tests, &best, usual));
    Choice {
        settings: best.settings,
        reason,
        log_error: Some(best.error),
        contradicted_by,
        error_factor: best.factor(),
        plane_undetermined: asks_for_plane(asked) && best.settings.symmetry.plane().is_none(),
    }
}

fn asks_for_plane(asked: Option<SymmetryKind>) -> bool {
    use SymmetryKind::{Bilateral, HalfTurnBilateral};
    matches!(asked, Some(Bilateral | HalfTurnBilateral))
}

/// What is taken of too few data to test anything by.
fn untested(asked: Option<Asked>, reason: Reason) -> Choice {
    let reason = if reason == Reason::Shown {
        Reason::TooFew
    } else {
        reason
    };
    let settings = Settings {
        symmetry: asked.map_or(Settings::FEW.symmetry, Asked::untested),
        ..Settings::FEW
    };
    Choice {
        reason,
        ..Choice::of(settings)
    }
}

/// The simplest anisotropic trial that the data do not contradict, those with a plane among them: about the azimuth
/// that predicts best.
fn with_plane(trials: &[Trial], tests: &Tests, usual: f64, wanted: Option<Asked>) -> Trial {
    let of = |symmetry: Symmetry| {
        let own = trials
            .iter()
            .filter(move |t| t.settings.symmetry == symmetry);
        own.cloned().collect::<Vec<Trial>>()
    };
    let [half_turn, none] = [Symmetry::HalfTurn, Symmetry::None].map(of);
    let start = simplest(&[&half_turn[..], &none].concat(), tests, usual, false);
    // With more images of the data neighbours are nearer, and more of what they differ by is noise: only trials that
    // know it compare.
    let start = tests.tuned(start, usual);
    let asked = wanted.map(|asked| asked.kind);
    let (turned, alone) = match asked {
        None if tests.data.places.len() < PLANE_MIN => return start,
        None => (!half_turn.is_empty(), true),
        Some(SymmetryKind::HalfTurnBilateral) => (true, false),
        Some(SymmetryKind::Bilateral) => (false, true),
        _ => return start,
    };
    let at = |symmetry: fn(MirrorPlane) -> Symmetry, plane: MirrorPlane| {
        tests.trial(Settings {
            symmetry: symmetry(plane),
            ..start.settings
        })
    };
    let both = |plane| {
        let turned = turned.then(|| at(Symmetry::HalfTurnBilateral, plane));
        let alone = alone.then(|| at(Symmetry::Bilateral, plane));
        (turned, alone)
    };
    if let Some(plane) = wanted.and_then(|asked| asked.plane) {
        let (turned, alone) = both(plane);
        return turned.or(alone).unwrap_or(start);
    }
    let mirror = mirror_plane(tests.data, start.settings);
    let Some(plane) = mirror.plane else {
        return start;
    };
    // About the plane of what has no half-turn, one with it would be found elsewhere.
    let kind = match start.settings.symmetry.has_half_turn() {
        true => Symmetry::HalfTurnBilateral,
        false => Symmetry::Bilateral,
    };
    let level = |azimuth_deg: f64| -at(kind, MirrorPlane::at_deg(azimuth_deg)).score();
    let (from, to) = (
        plane.azimuth_deg() - PLANE_WITHIN_DEG,
        plane.azimuth_deg() + PLANE_WITHIN_DEG,
    );
    let plane = MirrorPlane::at_deg(least(level, from, to, PLANE_NEAR_DEG));
    let (with_both, with_plane) = both(plane);
    let mut all: Vec<Trial> = with_both.into_iter().collect();
    let without = |symmetry: Symmetry| match symmetry == start.settings.symmetry {
        true => start.clone(),
        false => tests.trial(Settings {
            symmetry,
            ..start.settings
        }),
    };
    if asked.is_none() && turned {
        all.push(without(Symmetry::HalfTurn));
    }
    all.extend(with_plane);
    if asked.is_none() {
        all.push(without(Symmetry::None));
    }
    let best = simplest(&all, tests, usual, false);
    // One that the data contradict is not the one that was asked for where that may be another.
    if asked.is_some() && !mirror.is_determined && worse(&best, &start, usual) {
        return start;
    }
    best
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
    let errors = trials.iter().filter(sound).map(|t| t.error);
    let enough = (1.0 + SIMPLER_SHARE) * errors.fold(f64::INFINITY, f64::min);
    let first = |best: &Trial| {
        trials
            .iter()
            .filter(sound)
            .find(|trial| !worse(trial, best, usual) && trial.error <= enough)
            .or(Some(best))
            .cloned()
    };
    best.and_then(first).unwrap_or(Trial {
        settings: Settings::DEFAULT,
        predictions: Vec::new(),
        residuals: Vec::new(),
        error: f64::INFINITY,
        log_likelihood: f64::NEG_INFINITY,
    })
}

/// Whether the first is worse than the second beyond chance.
fn worse(a: &Trial, b: &Trial, usual: f64) -> bool {
    let (difference, chance) = difference(a, b, usual);
    difference > WORSE_SHARE * b.level(usual) && difference > WORSE_SIGMAS * chance
}

/// By how much the first predicts worse than the second, and the standard error of that.
fn difference(a: &Trial, b: &Trial, usual: f64) -> (f64, f64) {
    let n = a.residuals.len().min(b.residuals.len()) as f64;
    let differences = || {
        let pairs = a.residuals.iter().zip(&b.residuals);
        pairs.map(|(a, b)| loss(a, usual) - loss(b, usual))
    };
    let mean = differences().sum::<f64>() / n;
    let variance = differences().map(|d| (d - mean).powi(2)).sum::<f64>() / n;
    (mean, (variance / n).sqrt())
}

/// Whether the first is no worse than the second, even by chance, by either measure.
fn is_as_near(a: &Trial, b: &Trial, usual: f64) -> bool {
    let (difference, chance) = difference(a, b, usual);
    difference <= chance && a.error <= (1.0 + AS_NEAR) * b.error
}

/// Places that are left out.
struct Tests<'a> {
    data: &'a Data,
    numbers: Vec<usize>,
}

/// Data near a place, nearest first.
struct Around {
    place: Pair,
    near: Vec<Near>,
    /// Those that are less than they were without the place's own group, beside their number among the near ones.
    less: Vec<(usize, Datum)>,
}

/// What tests are predicted from, as long as settings differ in the kernel alone.
struct Neighbourhoods {
    merged: Merged,
    tests: Vec<Neighbourhood>,
}

/// What a test is predicted from: data nearest first around its place, and around the reciprocal one.
struct Neighbourhood {
    own: Around,
    reciprocal: Option<Around>,
}

/// Settings, and what they predict of the tests.
#[derive(Clone)]
struct Trial {
    settings: Settings,
    predictions: Vec<Predicted>,
    /// Logarithm of predicted over measured, per channel.
    residuals: Vec<[f64; 3]>,
    error: f64,
    /// Sum of those of the systems.
    log_likelihood: f64,
}

impl<'a> Tests<'a> {
    fn new(data: &'a Data, at_most: usize) -> Self {
        let (all, count) = (data.places.len(), data.places.len().min(at_most));
        // Evenly among all, in an order without the period of any scan.
        let numbers = (0..count).map(|k| (k * all + all / 2) / count);
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
    fn neighbourhoods(&self, settings: Settings) -> Neighbourhoods {
        let merged = Merged::new(self.data, &settings);
        let places = Places::new(&merged.data, &settings);
        let around = |test: &Datum, place: Pair| {
            let without = |datum| merged.without(datum, test.group, self.data, &settings);
            let keep = |datum: u32| !matches!(without(datum), Without::Nothing);
            let near = places.around(place, NEIGHBOURS_MOST, &settings, keep);
            let less = near
                .iter()
                .enumerate()
                .filter_map(|(k, near)| match without(near.datum) {
                    Without::Less(datum) => Some((k, datum)),
                    _ => None,
                })
                .collect();
            Around { place, near, less }
        };
        let tests = self
            .numbers
            .par_iter()
            .map(|number| {
                let test = &self.data.places[*number];
                let place = settings.coordinates.pair(test.light, test.view);
                Neighbourhood {
                    own: around(test, place),
                    reciprocal: (!settings.reciprocal_data).then(|| around(test, exchanged(place))),
                }
            })
            .collect();
        Neighbourhoods { merged, tests }
    }

    fn trial_at(&self, neighbourhoods: &Neighbourhoods, settings: Settings) -> Trial {
        let predicted = |around: &Around| {
            let near = &around.near[..around.near.len().min(settings.neighbours)];
            let data = &neighbourhoods.merged.data;
            let mut here: Vec<&Datum> = near.iter().map(|n| &data[n.datum as usize]).collect();
            for (k, datum) in &around.less {
                if let Some(here) = here.get_mut(*k) {
                    *here = datum;
                }
            }
            match Local::fit_to(&here, near, &settings) {
                Some(local) => (local.at(&around.place), local.log_likelihood()),
                None => (Predicted::NOTHING, 0.0),
            }
        };
        let (predictions, likelihoods): (Vec<Predicted>, Vec<f64>) = neighbourhoods
            .tests
            .par_iter()
            .map(|here| {
                let (own, likelihood) = predicted(&here.own);
                match &here.reciprocal {
                    Some(reciprocal) => (preferred(&own, &predicted(reciprocal).0), likelihood),
                    None => (own, likelihood),
                }
            })
            .unzip();
        let places = &self.data.places;
        let residuals: Vec<[f64; 3]> = predictions
            .iter()
            .zip(&self.numbers)
            .map(|(p, n)| [0, 1, 2].map(|c| residual(p.value[c], places[*n].value[c])))
            .collect();
        let error = residuals.iter().map(size).sum::<f64>() / residuals.len() as f64;
        Trial {
            settings,
            predictions,
            residuals,
            error,
            log_likelihood: likelihoods.iter().sum(),
        }
    }

    /// The same symmetry with the coordinates and the kernel that predict best.
    fn suited(&self, start: Trial, usual: f64) -> Trial {
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
        best
    }

    /// The same with the noise and the number of samples to a datum that predict best.
    fn tuned(&self, start: Trial, usual: f64) -> Trial {
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
        let at: Vec<Vec<f64>> = self
            .numbers
            .iter()
            .map(|n| waves(&self.data.places[*n]))
            .collect();
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

    /// How likely the residuals are by the variances that are predicted with them, by Student's distribution with four
    /// degrees of freedom: few that are far off do not outweigh all others.
    fn score(&self) -> f64 {
        let pairs = self.residuals.iter().zip(&self.predictions);
        pairs
            .map(|(r, p)| {
                let variance = (p.relative[1].powi(2) + p.noise[1]).max(1e-18);
                let far = 1.0 + r[1] * r[1] / (4.0 * variance);
                -0.5 * variance.natural_log() - 2.5 * far.natural_log()
            })
            .sum()
    }

    /// With which 95 % of the residuals lie within 1.96 standard errors, noise included. A residual counts by the share
    /// of its variance that is not noise: what noise hides says nothing. Where all is noise, the systems' own errors stand.
    fn factor(&self) -> f64 {
        let mut shown: Vec<(f64, f64)> = self
            .residuals
            .iter()
            .zip(&self.predictions)
            .flat_map(|(r, p)| {
                [0, 1, 2].map(|c| {
                    let variance = p.relative[c].powi(2).max(1e-18);
                    let ratio = ((r[c] / Z95).powi(2) - p.noise[c]) / variance;
                    (ratio, variance / (variance + p.noise[c]))
                })
            })
            .collect();
        shown.sort_by(|a, b| a.0.total_cmp(&b.0));
        let sum: f64 = shown.iter().map(|(_, share)| share).sum();
        let mut within = 0.0;
        let last = shown.iter().find(|(_, share)| {
            within += share;
            within >= 0.95 * sum
        });
        let ratio = last.map_or(1.0, |(ratio, _)| *ratio);
        ratio.clamp(FACTORS.0.powi(2), FACTORS.1.powi(2)).sqrt()
    }
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
