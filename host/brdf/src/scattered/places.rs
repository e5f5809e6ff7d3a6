//! Data at the places where a symmetry sees them, and the search among these.

use super::Settings;
use super::data::Datum;
use super::tree::{At, Nearest, Tree};
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::interpolate::coordinates::Pair;

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

/// All data, and where they count.
pub(super) struct Places {
    /// In the order of the tree.
    held: Vec<(Pair, u32)>,
    tree: Tree,
    /// Whether all images of the data are held; else those near to a place are found near the place's own images.
    holds_images: bool,
}

/// The search underestimates the distance of turned places by up to a factor of two: so it returns this many
/// times the number of places that are needed.
const MORE: usize = 3;
/// Images of one datum within this of each other are one.
const SAME2: f64 = 1e-12;

impl Places {
    /// With all images of the data: for many searches.
    pub fn new<const N: usize>(data: &[Datum<N>], settings: &Settings) -> Self {
        let images = image_count(settings);
        let held = (0u32..).zip(data).flat_map(|(number, datum)| {
            let pair = settings.coordinates.pair(datum.light, datum.view);
            (0..images).map(move |k| (image(pair, k, settings), number))
        });
        Self::holding(held.collect(), settings, true)
    }

    /// Without their images: for few searches, with any settings that have these coordinates, and turn as these do or do
    /// not.
    pub fn without_images<const N: usize>(data: &[Datum<N>], settings: &Settings) -> Self {
        let held = (0u32..)
            .zip(data)
            .map(|(number, datum)| (settings.coordinates.pair(datum.light, datum.view), number));
        Self::holding(held.collect(), settings, false)
    }

    fn holding(held: Vec<(Pair, u32)>, settings: &Settings, holds_images: bool) -> Self {
        let at: Vec<At> = held
            .iter()
            .map(|(pair, _)| settings.symmetry.search_place(*pair))
            .collect();
        let (tree, order) = Tree::new(&at);
        Self {
            tree,
            held: order.iter().map(|k| held[*k as usize]).collect(),
            holds_images,
        }
    }

    /// Number of images.
    pub fn images(&self) -> usize {
        self.held.len()
    }

    /// The `n` images nearest to a place, nearest first, of data that are kept.
    pub fn around(
        &self,
        place: Pair,
        n: usize,
        settings: &Settings,
        keep: impl Fn(u32) -> bool,
    ) -> Vec<Near> {
        let mut wanted = if settings.symmetry.is_isotropic() {
            MORE * n
        } else {
            n + 8
        };
        loop {
            let mut near: Vec<Near> = self
                .nearest(place, wanted, settings)
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
            in_order(&mut near);
            near.dedup_by(|b, a| a.datum == b.datum && distance2(&a.pair, &b.pair) < SAME2);
            let all = match self.holds_images {
                true => self.held.len(),
                false => self.held.len() * image_count(settings),
            };
            if near.len() >= n || wanted >= all {
                near.truncate(n);
                return near;
            }
            wanted *= 2;
        }
    }

    /// So many images, or all, nearest as the search sees it.
    fn nearest(
        &self,
        place: Pair,
        wanted: usize,
        settings: &Settings,
    ) -> impl Iterator<Item = (Pair, u32)> {
        let searches = match self.holds_images {
            true => 1,
            false => image_count(settings),
        };
        // Each image is its own inverse: a datum's is as far from the place as the datum from the place's.
        let mut nearest = Nearest::new(wanted.min(searches * self.held.len()));
        for k in 0..searches {
            let query = settings.symmetry.search_place(image(place, k, settings));
            self.tree.search(query, k as u32, &mut nearest);
        }
        nearest.found().map(|(item, k)| {
            let (pair, datum) = self.held[item as usize];
            (image(pair, k as usize, settings), datum)
        })
    }
}

/// Sorts by distance: equal ones come in the order of the data, whatever the tree.
fn in_order(near: &mut Vec<Near>) {
    // Distances are not negative: their bits are in their order. The places themselves are moved once.
    let mut order: Vec<(u64, u32, u32)> = (0u32..)
        .zip(near.iter())
        .map(|(k, near)| (near.distance2.to_bits(), near.datum, k))
        .collect();
    order.sort_unstable();
    *near = order.iter().map(|(_, _, k)| near[*k as usize]).collect();
}

/// How many images count as a datum, itself among them, turns by any angle aside.
fn image_count(settings: &Settings) -> usize {
    settings.symmetry.image_count() * if settings.reciprocal_data { 2 } else { 1 }
}

/// The image of a number: the symmetry's, each followed by its reciprocal one where that counts; 0 is the pair itself.
fn image(pair: Pair, number: usize, settings: &Settings) -> Pair {
    if !settings.reciprocal_data {
        return settings.symmetry.image(pair, number);
    }
    let image = settings.symmetry.image(pair, number / 2);
    match number % 2 {
        0 => image,
        _ => exchanged(image),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::Direction;
    use crate::random::Random;
    use crate::symmetry::{MirrorPlane, Symmetry};

    #[test]
    fn images_that_are_not_held_are_found_as_those_that_are() {
        let mut random = Random::new(5);
        let mut direction = || {
            let (theta, phi) = (random.between(0.0, 85.0), random.between(0.0, 360.0));
            Direction::from_deg(theta, phi).to_vec3()
        };
        let mut datum = |group: u32| Datum {
            light: direction(),
            view: direction(),
            value: [1.0; 3],
            log: [0.0; 3],
            count: 1.0,
            group,
        };
        let data: Vec<Datum> = (0..400).map(&mut datum).collect();
        let tests: Vec<Datum> = (0..10).map(&mut datum).collect();
        let plane = MirrorPlane::at_deg(22.5);
        for symmetry in [
            Symmetry::None,
            Symmetry::HalfTurn,
            Symmetry::Bilateral(plane),
            Symmetry::HalfTurnBilateral(plane),
            Symmetry::Turns,
            Symmetry::Isotropic,
        ] {
            for reciprocal_data in [true, false] {
                let settings = Settings {
                    symmetry,
                    reciprocal_data,
                    ..Settings::DEFAULT
                };
                let all = Places::new(&data, &settings);
                let bare = Places::without_images(&data, &settings);
                for test in &tests {
                    let place = settings.coordinates.pair(test.light, test.view);
                    // Up to all images of all data.
                    for n in [1, 64, 4000] {
                        let found = |places: &Places| -> Vec<(u32, f64)> {
                            let near = places.around(place, n, &settings, |datum| datum % 7 > 0);
                            near.iter().map(|n| (n.datum, n.distance())).collect()
                        };
                        assert_eq!(found(&all), found(&bare), "{symmetry}, {n}");
                    }
                }
            }
        }
    }
}
