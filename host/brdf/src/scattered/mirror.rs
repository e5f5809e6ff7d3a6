//! The plane on whose two sides a material is most alike.

use super::Settings;
use super::data::Data;
use super::local::Local;
use super::merge::Merged;
use super::places::Places;
use super::residual::{loss, residual, size};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::symmetry::MirrorPlane;
use rayon::prelude::*;

/// Places that are predicted on the other side, at most.
const TESTS: usize = 320;
/// Planes that are tried first are so far apart, degrees …
const STEP_DEG: f64 = 7.5;
/// … and the nearest is found to about this.
const NEAR_DEG: f64 = 0.5;
/// The golden section.
const GOLDEN: f64 = 0.618_034;

/// The plane about which data predict each other best.
pub(super) fn mirror_plane(data: &Data, settings: Settings) -> MirrorPlane {
    let merged = Merged::new(data, &settings).data;
    let places = Places::new(&merged, &settings);
    let count = data.places.len().min(TESTS);
    let tests: Vec<usize> = (0..count)
        .map(|k| (k * data.places.len() + data.places.len() / 2) / count)
        .collect();
    let residuals = |azimuth_deg: f64| -> Vec<[f64; 3]> {
        let (sin, cos) = (2.0 * azimuth_deg).to_radians().sine_cosine();
        let mirrored = |v: Vec3| [cos * v[0] + sin * v[1], sin * v[0] - cos * v[1], v[2]];
        let one = |number: &usize| {
            let test = &data.places[*number];
            let place = settings
                .coordinates
                .pair(mirrored(test.light), mirrored(test.view));
            let keep = |datum: u32| merged[datum as usize].group != test.group;
            let near = places.around(place, settings.neighbours, &settings, keep);
            let found = Local::fit(&merged, &near, &settings)?.at(&place);
            let residual = [0, 1, 2].map(|c| residual(found.value[c], test.value[c]));
            Some((found.relative[1], residual))
        };
        // Where little was measured on the other side, nothing speaks for or against the plane.
        let mut found: Vec<(f64, [f64; 3])> = tests.par_iter().filter_map(one).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.truncate(found.len().div_ceil(2));
        found.into_iter().map(|(_, residual)| residual).collect()
    };
    let planes = (180.0 / STEP_DEG) as usize;
    let all: Vec<Vec<[f64; 3]>> = (0..planes)
        .map(|k| residuals(k as f64 * STEP_DEG))
        .collect();
    // The usual size is that about the best plane, however few places agree with the others.
    let median = |residuals: &Vec<[f64; 3]>| {
        let mut sizes: Vec<f64> = residuals.iter().map(size).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or(1.0)
    };
    let usual = all.iter().map(median).fold(1.0, f64::min).max(1e-6);
    let level = |residuals: &Vec<[f64; 3]>| {
        let sum: f64 = residuals.iter().map(|r| loss(r, usual)).sum();
        sum / residuals.len().max(1) as f64
    };
    let levels: Vec<f64> = all.iter().map(level).collect();
    let best = (0..planes).min_by(|a, b| levels[*a].total_cmp(&levels[*b]));
    let around = best.unwrap_or(0) as f64 * STEP_DEG;
    let at = |azimuth_deg: f64| level(&residuals(azimuth_deg));
    let (mut low, mut high) = (around - STEP_DEG, around + STEP_DEG);
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut found = inner.map(at);
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
    MirrorPlane::at_deg(0.5 * (low + high))
}
