//! Places of the cells and corners of a pair of patches, and of its parts.

use crate::direction::Vec3;
use crate::interpolate::FillSettings;
use crate::interpolate::coordinates::Point;
use crate::interpolate::patches::{Part, Patch};

/// The cells of a pair of patches, light by light.
pub(super) fn write_places(
    settings: &FillSettings,
    (p, q): (&Patch, &Patch),
    places: &mut Vec<Point>,
) {
    write_pairs(settings, &p.vectors, &q.vectors, places);
}

/// Their corners, corner by corner of the first.
pub(super) fn write_corners(
    settings: &FillSettings,
    (p, q): (&Patch, &Patch),
    places: &mut Vec<Point>,
) {
    write_pairs(settings, &p.corner_vectors, &q.corner_vectors, places);
}

fn write_pairs(settings: &FillSettings, lights: &[Vec3], views: &[Vec3], places: &mut Vec<Point>) {
    places.clear();
    for light in lights {
        for view in views {
            places.push(settings.coordinates.point(*light, *view));
        }
    }
}

/// Where up to four of some directions stand, evenly spread.
pub(super) fn evenly_spread(directions: &[Vec3]) -> impl Iterator<Item = usize> + Clone + use<> {
    (0..directions.len()).step_by(directions.len().div_ceil(4).max(1))
}

/// Where the cells of a pair of parts stand among those of the whole.
pub(super) fn cells_in(a: &Part, b: &Part, q: &Patch) -> impl Iterator<Item = usize> {
    let width = q.directions.len();
    a.places.iter().flat_map(move |i| {
        b.places
            .iter()
            .map(move |j| *i as usize * width + *j as usize)
    })
}

/// Where the corners of a pair of parts stand among those of the whole.
pub(super) fn corners_in(a: &Part, b: &Part, q: &Patch) -> impl Iterator<Item = usize> {
    let width = q.corners.len();
    a.corner_places.iter().flat_map(move |i| {
        b.corner_places
            .iter()
            .map(move |j| *i as usize * width + *j as usize)
    })
}

/// All pairs of parts, in the order of their numbers.
pub(super) fn pairs_of_parts<'a>(
    p: &'a Patch,
    q: &'a Patch,
) -> impl Iterator<Item = (&'a Part, &'a Part)> + use<'a> {
    p.parts
        .iter()
        .flat_map(|a| q.parts.iter().map(move |b| (a, b)))
}
