//! Cross-validation: places that are left out, and what settings predict of them from the others.

use super::data::{Data, Datum};
use super::local::{Local, Predicted};
use super::merge::Without;
use super::places::{Near, exchanged};
use super::residual::{residual, size};
use super::searches::{Search, Searches};
use super::trial::Trial;
use super::{NEIGHBOURS_MOST, Settings, preferred};
use crate::direction::Vec3;
use crate::interpolate::coordinates::Pair;
use rayon::prelude::*;
use std::sync::Arc;

/// In the search for a dependence on the azimuth a residual beyond so many times the median of all counts as that.
const OUTLIER: f64 = 5.0;
/// A dependence on the azimuth is shown where its size is so many standard errors …
const SHOWN_SIGMAS: f64 = 4.0;
/// … of one of so many waves.
const WAVES: usize = 16;

/// Places that are left out.
pub(super) struct Tests<'a> {
    pub data: &'a Data,
    pub searches: &'a Searches<'a>,
    pub numbers: Vec<usize>,
}

/// Data near a place, nearest first.
struct Around {
    place: Pair,
    near: Vec<Near>,
    /// Those that are less than they were without the place's own group, beside their number among the near ones.
    less: Vec<(usize, Datum)>,
}

/// What tests are predicted from, as long as settings differ in the kernel alone.
pub(super) struct Neighbourhoods {
    search: Arc<Search>,
    tests: Vec<Neighbourhood>,
}

/// What a test is predicted from: data nearest first around its place, and around the reciprocal one.
struct Neighbourhood {
    own: Around,
    reciprocal: Option<Around>,
}

impl<'a> Tests<'a> {
    pub fn new(searches: &'a Searches<'a>, at_most: usize) -> Self {
        let data = searches.data;
        let (all, count) = (data.places.len(), data.places.len().min(at_most));
        // Evenly among all, in an order without the period of any scan.
        let numbers = (0..count).map(|k| (k * all + all / 2) / count);
        Self {
            data,
            searches,
            numbers: numbers.collect(),
        }
    }

    pub fn trial(&self, settings: Settings) -> Trial {
        self.trial_at(&self.neighbourhoods(settings), settings)
    }

    /// The data around the tests without their own groups, as many as any trial takes: they do not depend on
    /// the kernel.
    pub fn neighbourhoods(&self, settings: Settings) -> Neighbourhoods {
        let search = self.searches.of(&settings);
        let (merged, places) = (&search.merged, &search.places);
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
        Neighbourhoods { search, tests }
    }

    pub fn trial_at(&self, neighbourhoods: &Neighbourhoods, settings: Settings) -> Trial {
        let predicted = |around: &Around| {
            let near = &around.near[..around.near.len().min(settings.neighbours)];
            let data = &neighbourhoods.search.merged.data;
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

    /// Whether what is left after a fit depends on the azimuth of light or view.
    pub fn shows_azimuth(&self, trial: &Trial) -> bool {
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
