//! Which settings data bear: by cross-validation, and by what the data can contradict.

use super::Settings;
use super::data::{Data, Datum};
use super::left_out::Tests;
use super::mirror::{half_turn_is_measured, least, mirror_plane};
use super::residual::RESIDUAL_MAX;
use super::searches::Searches;
use super::trial::{Trial, worse};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::symmetry::{MirrorPlane, Symmetry, SymmetryKind};

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
/// A simpler symmetry is taken where its mean error is not larger than the least by this share: few that are far off, as on
/// a lobe, count there.
const SIMPLER_SHARE: f64 = 0.05;
/// Of so many samples all that looks like noise may be a dependence on the azimuth, and of more in proportion.
const HIDDEN: f64 = 100.0;
/// Azimuths within this are the same: arms do not stop exactly. Degrees.
const SAME_DEG: f64 = 1.0;
/// The factor of standard errors where nothing was tested: rather wide.
const UNTESTED_FACTOR: f64 = 3.0;

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
fn symmetries(
    searches: &Searches<'_>,
    asked: Option<SymmetryKind>,
    one_azimuth: bool,
) -> &'static [Symmetry] {
    match asked {
        Some(SymmetryKind::Isotropic) => &[Symmetry::Isotropic, Symmetry::Turns],
        Some(SymmetryKind::HalfTurn | SymmetryKind::HalfTurnBilateral) => &[Symmetry::HalfTurn],
        Some(SymmetryKind::None | SymmetryKind::Bilateral) => &[Symmetry::None],
        None if one_azimuth => &[Symmetry::Isotropic, Symmetry::Turns],
        None if half_turn_is_measured(searches, Settings::DEFAULT) => &[
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
    let searches = Searches::new(data);
    let tests = Tests::new(&searches, TESTS);
    if tests.numbers.len() < TESTS_MIN {
        return untested(wanted, reason);
    }
    let first: Vec<Trial> = symmetries(&searches, asked, one_azimuth)
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
        let many = Tests::new(&searches, MANY_TESTS);
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
    let mirror = mirror_plane(tests.searches, start.settings);
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
