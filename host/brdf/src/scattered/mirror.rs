//! The plane on whose two sides a material is most alike.

use super::Settings;
use super::data::Data;
use super::local::Local;
use super::merge::Merged;
use super::places::Places;
use super::residual::{loss, residual, size};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::interpolate::coordinates::Pair;
use crate::symmetry::MirrorPlane;
use rayon::prelude::*;

/// Places that are predicted on the other side, at most.
const TESTS: usize = 320;
/// Planes that are tried first are so far apart, degrees …
const STEP_DEG: f64 = 7.5;
/// … and the nearest is found to about this.
const NEAR_DEG: f64 = 0.5;
/// A place is measured on the other side where its error there is at most so many times that of most of the places …
const MEASURED: f64 = 2.0;
/// … and a plane is compared with others where so large a share of places is.
const COMPARED: f64 = 0.5;
/// The golden section.
const GOLDEN: f64 = 0.618_034;

/// Where the best plane is.
pub(super) struct Mirror {
    /// The plane about which data predict each other best, of those on both of whose sides they lie.
    pub plane: Option<MirrorPlane>,
    /// Whether data lie on both sides of planes of every azimuth: else the best may be another.
    pub is_determined: bool,
}

/// Looks for the plane.
pub(super) fn mirror_plane(data: &Data, settings: Settings) -> Mirror {
    let merged = Merged::new(data, &settings).data;
    let places = Places::new(&merged, &settings);
    let count = data.places.len().min(TESTS);
    let tests: Vec<usize> = (0..count)
        .map(|k| (k * data.places.len() + data.places.len() / 2) / count)
        .collect();
    let predicted = |number: &usize, place: Pair| {
        let test = &data.places[*number];
        let keep = |datum: u32| merged[datum as usize].group != test.group;
        let near = places.around(place, settings.neighbours, &settings, keep);
        let found = Local::fit(&merged, &near, &settings)?.at(&place);
        let residual = [0, 1, 2].map(|c| residual(found.value[c], test.value[c]));
        Some((found.relative[1], residual))
    };
    let sorted = |turned: &(dyn Fn(Vec3) -> Vec3 + Sync)| {
        let one = |number: &usize| {
            let test = &data.places[*number];
            let place = settings
                .coordinates
                .pair(turned(test.light), turned(test.view));
            predicted(number, place)
        };
        let mut found: Vec<(f64, [f64; 3])> = tests.par_iter().filter_map(one).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found
    };
    let here = sorted(&|v| v);
    let usual_error = here.get(here.len() * 3 / 4).map_or(0.0, |found| found.0);
    // Where little was measured on the other side, nothing speaks for or against the plane.
    let residuals = |azimuth_deg: f64| -> Option<Vec<[f64; 3]>> {
        let (sin, cos) = (2.0 * azimuth_deg).to_radians().sine_cosine();
        let mut found = sorted(&|v| [cos * v[0] + sin * v[1], sin * v[0] - cos * v[1], v[2]]);
        let compared = (COMPARED * tests.len() as f64).ceil() as usize;
        let last = found.get(compared.saturating_sub(1))?;
        if last.0 > MEASURED * usual_error {
            return None;
        }
        found.truncate(compared);
        Some(found.into_iter().map(|(_, residual)| residual).collect())
    };
    let planes = (180.0 / STEP_DEG) as usize;
    let all: Vec<Option<Vec<[f64; 3]>>> = (0..planes)
        .map(|k| residuals(k as f64 * STEP_DEG))
        .collect();
    // The usual size is that about the best plane, however few places agree with the others.
    let median = |residuals: &Vec<[f64; 3]>| {
        let mut sizes: Vec<f64> = residuals.iter().map(size).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or(1.0)
    };
    let medians = all.iter().flatten().map(median);
    let usual = medians.fold(1.0, f64::min).max(1e-6);
    let level = |residuals: &Option<Vec<[f64; 3]>>| match residuals {
        Some(residuals) => {
            let sum: f64 = residuals.iter().map(|r| loss(r, usual)).sum();
            sum / residuals.len().max(1) as f64
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
    let at = |azimuth_deg: f64| level(&residuals(azimuth_deg));
    let azimuth_deg = least(at, around - STEP_DEG, around + STEP_DEG);
    Mirror {
        plane: Some(MirrorPlane::at_deg(azimuth_deg)),
        is_determined,
    }
}

/// Where a function of an azimuth is least between two, by the golden section.
fn least(at: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut found = inner.map(&at);
    while high - low > NEAR_DEG {
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
