//! The plane on whose two sides a material is most alike.

use super::Settings;
use super::data::Data;
use super::local::Local;
use super::residual::{residual, size};
use super::searches::{Search, Searches};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::symmetry::MirrorPlane;
use rayon::prelude::*;
use std::sync::Arc;

/// Places that are predicted on the other side, at most.
const TESTS: usize = 320;
/// Planes that are tried first are so far apart, degrees …
const STEP_DEG: f64 = 7.5;
/// … and the nearest is found to about this.
const NEAR_DEG: f64 = 0.5;
/// So many of the data are near to a place, where it was measured.
const NEAREST: usize = 3;
/// A place is measured on the other side where the data there are at most so many times as far as around most of the
/// places …
const MEASURED: f64 = 1.5;
/// … and a plane is compared with others where so large a share of places is.
const COMPARED: f64 = 0.5;
/// So many neighbours predict while planes are compared that lie far apart.
const COARSE: usize = 32;
/// The golden section.
const GOLDEN: f64 = 0.618_034;

/// Where the best plane is.
pub(super) struct Mirror {
    /// The plane about which data predict each other best, of those on both of whose sides they lie.
    pub plane: Option<MirrorPlane>,
    /// Whether data lie on both sides of planes of every azimuth: else the best may be another.
    pub is_determined: bool,
}

/// Places of the data, and what the others predict where these lie by a turn or beyond a plane.
struct Images<'a> {
    data: &'a Data,
    settings: Settings,
    search: Arc<Search>,
    tests: Vec<usize>,
    /// Within this distance lie data of others around most of the places.
    usual_distance: f64,
}

/// What is predicted of a place at its image.
struct Found {
    /// From the image to the nearest data.
    distance: f64,
    /// Logarithm of predicted over measured, mean over the channels, and its variance as the data around show it.
    residual: f64,
    variance: f64,
}

impl Found {
    /// What it says against the symmetry: as Student's distribution with four degrees of freedom has it, by the error
    /// that is to be expected there. The slope of a lobe says more of where a plane is than all that is flat.
    fn against(&self, usual: f64) -> f64 {
        let variance = self.variance + usual * usual;
        (1.0 + self.residual.powi(2) / (4.0 * variance)).natural_log()
    }
}

impl<'a> Images<'a> {
    fn new(searches: &Searches<'a>, settings: Settings) -> Self {
        let data = searches.data;
        let count = data.places.len().min(TESTS);
        let tests = (0..count).map(|k| (k * data.places.len() + data.places.len() / 2) / count);
        let mut images = Self {
            data,
            settings,
            search: searches.of(&settings),
            tests: tests.collect(),
            usual_distance: 0.0,
        };
        let here = images.sorted(&|v| v);
        images.usual_distance = here
            .get(here.len() * 3 / 4)
            .map_or(0.0, |found| found.distance);
        images
    }

    /// What is found of each test at its image, from the nearest to others on.
    fn sorted(&self, image: &(dyn Fn(Vec3) -> Vec3 + Sync)) -> Vec<Found> {
        let predicted = |number: &usize| {
            let (test, settings) = (&self.data.places[*number], &self.settings);
            let place = settings
                .coordinates
                .pair(image(test.light), image(test.view));
            let data = &self.search.merged.data;
            let keep = |datum: u32| data[datum as usize].group != test.group;
            let near = self
                .search
                .places
                .around(place, settings.neighbours, settings, keep);
            let found = Local::fit(data, &near, settings)?.at(&place);
            let residuals = [0, 1, 2].map(|c| residual(found.value[c], test.value[c]));
            let nearest = near.get(NEAREST - 1).or(near.last())?;
            Some(Found {
                distance: nearest.distance(),
                residual: size(&residuals),
                variance: found.relative[1].powi(2) + found.noise[1],
            })
        };
        let mut found: Vec<Found> = self.tests.par_iter().filter_map(predicted).collect();
        found.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        found
    }

    /// Those that were measured at their image, too: `None` where these are too few, and nothing speaks for or against
    /// it.
    fn measured(&self, image: &(dyn Fn(Vec3) -> Vec3 + Sync)) -> Option<Vec<Found>> {
        let mut found = self.sorted(image);
        let compared = (COMPARED * self.tests.len() as f64).ceil() as usize;
        found.retain(|found| found.distance <= MEASURED * self.usual_distance);
        (found.len() >= compared).then_some(found)
    }

    fn beyond(&self, azimuth_deg: f64) -> Option<Vec<Found>> {
        let (sin, cos) = (2.0 * azimuth_deg).to_radians().sine_cosine();
        self.measured(&|v| [cos * v[0] + sin * v[1], sin * v[0] - cos * v[1], v[2]])
    }
}

/// Whether data lie where half a turn takes others: else nothing speaks for or against that symmetry.
pub(super) fn half_turn_is_measured(searches: &Searches<'_>, settings: Settings) -> bool {
    let images = Images::new(searches, settings);
    images.measured(&|v| [-v[0], -v[1], v[2]]).is_some()
}

/// Looks for the plane.
pub(super) fn mirror_plane(searches: &Searches<'_>, settings: Settings) -> Mirror {
    let mut images = Images::new(searches, settings);
    images.settings.neighbours = settings.neighbours.min(COARSE);
    let planes = (180.0 / STEP_DEG) as usize;
    let all: Vec<Option<Vec<Found>>> = (0..planes)
        .map(|k| images.beyond(k as f64 * STEP_DEG))
        .collect();
    // The usual size is that about the best plane, however few places agree with the others.
    let median = |found: &Vec<Found>| {
        let mut sizes: Vec<f64> = found.iter().map(|found| found.residual).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or(1.0)
    };
    let medians = all.iter().flatten().map(median);
    let usual = medians.fold(1.0, f64::min).max(1e-6);
    let level = |found: &Option<Vec<Found>>| match found {
        Some(found) => {
            let sum: f64 = found.iter().map(|found| found.against(usual)).sum();
            sum / found.len().max(1) as f64
        }
        None => f64::INFINITY,
    };
    let levels: Vec<f64> = all.iter().map(level).collect();
    let best = (0..planes).min_by(|a, b| levels[*a].total_cmp(&levels[*b]));
    let is_determined = levels.iter().all(|level| level.is_finite());
    let Some(best) = best.filter(|k| levels[*k].is_finite()) else {
        return Mirror {
            plane: None,
            is_determined,
        };
    };
    let around = best as f64 * STEP_DEG;
    images.settings.neighbours = settings.neighbours;
    let at = |azimuth_deg: f64| level(&images.beyond(azimuth_deg));
    let azimuth_deg = least(at, around - STEP_DEG, around + STEP_DEG, NEAR_DEG);
    Mirror {
        plane: Some(MirrorPlane::at_deg(azimuth_deg)),
        is_determined,
    }
}

/// Where a function of an azimuth is least between two, by the golden section, to about so many degrees.
pub(super) fn least(at: impl Fn(f64) -> f64, mut low: f64, mut high: f64, near_deg: f64) -> f64 {
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut found = inner.map(&at);
    while high - low > near_deg {
        if found[0] < found[1] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            found = [at(inner[0]), found[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            found = [found[1], at(inner[1])];
        }
    }
    0.5 * (low + high)
}
