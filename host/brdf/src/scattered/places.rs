//! Data at the places where a symmetry sees them, and the search among these.

use super::Settings;
use super::data::Datum;
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::interpolate::coordinates::Pair;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// A datum near a place: turned, where the symmetry allows it, so that it lies nearest to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Near {
    pub pair: Pair,
    pub datum: u32,
    distance2: f64,
}

impl Near {
    /// From the place that it is near to; above zero.
    pub fn distance(&self) -> f64 {
        self.distance2.sqrt().max(1e-6)
    }
}

/// All images of all data.
pub(super) struct Places {
    images: Vec<(Pair, u32)>,
    tree: Option<ImmutableKdTree<f32, 6>>,
}

/// The search underestimates the distance of turned places by up to a factor of two: so it returns this many
/// times the number of places that are needed.
const MORE: usize = 3;
/// Images of one datum within this of each other are one.
const SAME2: f64 = 1e-12;

impl Places {
    pub fn new(data: &[Datum], settings: &Settings) -> Self {
        let mut images = Vec::with_capacity(2 * data.len());
        for (number, datum) in data.iter().enumerate() {
            let pair = settings.coordinates.pair(datum.light, datum.view);
            for image in settings.symmetry.images(pair) {
                images.push((image, number as u32));
                if settings.reciprocal_data {
                    images.push((exchanged(image), number as u32));
                }
            }
        }
        let at: Vec<[f32; 6]> = images
            .iter()
            .map(|(pair, _)| settings.symmetry.search_place(*pair))
            .collect();
        Self {
            tree: ImmutableKdTree::new_from_slice(&at).ok(),
            images,
        }
    }

    /// Number of images.
    pub fn images(&self) -> usize {
        self.images.len()
    }

    /// The `n` images nearest to a place, nearest first, of data that are kept.
    pub fn around(
        &self,
        place: Pair,
        n: usize,
        settings: &Settings,
        keep: impl Fn(u32) -> bool,
    ) -> Vec<Near> {
        let Some(tree) = &self.tree else {
            return Vec::new();
        };
        let query = settings.symmetry.search_place(place);
        let mut wanted = if settings.symmetry.is_isotropic() {
            MORE * n
        } else {
            n + 8
        };
        loop {
            let many = wanted.min(self.images.len());
            let Some(size) = NonZero::new(many) else {
                return Vec::new();
            };
            let mut near: Vec<Near> = tree
                .query(&query)
                .nearest_n::<SquaredEuclidean<f32>>(size)
                .execute()
                .into_iter()
                .map(|found| self.images[found.item as usize])
                .filter(|(_, datum)| keep(*datum))
                .map(|(pair, datum)| {
                    let pair = settings.symmetry.aligned(pair, place);
                    Near {
                        pair,
                        datum,
                        distance2: distance2(&pair, &place),
                    }
                })
                .collect();
            // Equal distances come in the order of the data, whatever the tree.
            near.sort_by(|a, b| {
                let order = a.distance2.total_cmp(&b.distance2);
                order.then_with(|| a.datum.cmp(&b.datum))
            });
            near.dedup_by(|b, a| a.datum == b.datum && distance2(&a.pair, &b.pair) < SAME2);
            if near.len() >= n || many == self.images.len() {
                near.truncate(n);
                return near;
            }
            wanted = 2 * many;
        }
    }
}

/// Both turned about the normal so that the light, or if that is nearer to the normal the view, has azimuth 0.
pub(super) fn turned_to_axis(light: Vec3, view: Vec3) -> (Vec3, Vec3) {
    let planar = |v: Vec3| v[0].hypotenuse(v[1]);
    let to = if planar(light) >= planar(view) {
        light
    } else {
        view
    };
    let length = planar(to);
    if length < 1e-12 {
        return (light, view);
    }
    let (cos, sin) = (to[0] / length, to[1] / length);
    let turned = |v: Vec3| [cos * v[0] + sin * v[1], cos * v[1] - sin * v[0], v[2]];
    (turned(light), turned(view))
}

/// Radius of a neighbourhood.
pub(super) fn radius_of(near: &[Near]) -> f64 {
    near.last().map_or(1e-6, Near::distance)
}

/// With light and view exchanged.
pub(super) fn exchanged(p: Pair) -> Pair {
    [p[0], p[1], p[2], -p[3], -p[4], -p[5]]
}

pub(super) fn distance2(a: &Pair, b: &Pair) -> f64 {
    (0..6).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}
