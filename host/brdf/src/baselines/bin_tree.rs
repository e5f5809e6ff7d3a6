//! The bins nearest to a place, exactly.

use super::settings::{BaselineSettings, Places, Transform};
use super::space::{Place, Space};
use crate::bins::Bins;
use crate::direction::Vec3;
use crate::interpolate::datum::floor_of;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// Site values around a place, nearest first.
#[derive(Clone, Debug, Default)]
pub struct Neighbourhood {
    /// Where they are, counted from the place.
    pub offsets: Vec<Place>,
    /// Their distances from the place.
    pub distances: Vec<f64>,
    /// Their values per channel.
    pub values: Vec<[f64; 3]>,
}

impl Neighbourhood {
    /// Adds a value; the caller keeps the order.
    pub fn push(&mut self, offset: Place, value: [f64; 3]) {
        self.distances.push(length2(&offset).sqrt());
        self.offsets.push(offset);
        self.values.push(value);
    }

    /// The distance of the farthest one, 0 of none.
    pub fn radius(&self) -> f64 {
        self.distances.iter().copied().fold(0.0, f64::max)
    }

    fn clear(&mut self) {
        self.offsets.clear();
        self.distances.clear();
        self.values.clear();
    }
}

fn length2(offset: &Place) -> f64 {
    offset.iter().map(|x| x * x).sum()
}

/// A bin, at its own place or at its mirror's, once or some turns around.
#[derive(Clone, Copy)]
struct Site {
    bin: u32,
    is_mirror: bool,
    turns: [i8; 2],
}

/// All sites, and a tree over their places.
pub(super) struct BinTree<'a> {
    bins: &'a Bins,
    space: Space,
    places: Places,
    values: Transform,
    /// Smallest value that a logarithm is taken of.
    floor: [f32; 3],
    /// Unit vector of each direction of the grid.
    directions: Vec<Vec3>,
    sites: Vec<Site>,
    /// Single precision ranks; distances are taken again in double precision.
    tree: Option<ImmutableKdTree<f32, 6>>,
}

impl<'a> BinTree<'a> {
    pub fn new(bins: &'a Bins, settings: &BaselineSettings) -> Self {
        let grid = bins.grid();
        let mut tree = Self {
            bins,
            space: settings.space,
            places: settings.places,
            values: settings.values,
            floor: floor_of(bins.bins().iter()),
            directions: (0..grid.n_directions())
                .map(|d| grid.direction(d).to_vec3())
                .collect(),
            sites: Vec::new(),
            tree: None,
        };
        let mut sites = Vec::new();
        let mut points = Vec::new();
        for bin in 0..bins.bins().len() as u32 {
            for is_mirror in [false, true] {
                let once = Site {
                    bin,
                    is_mirror,
                    turns: [0, 0],
                };
                let place = tree.place_of(once);
                if is_mirror
                    && (!settings.mirrored
                        || place
                            == tree.place_of(Site {
                                is_mirror: false,
                                ..once
                            }))
                {
                    continue;
                }
                for turns in tree.space.turns(&place) {
                    points.push(tree.space.turned(place, turns).map(|x| x as f32));
                    sites.push(Site { turns, ..once });
                }
            }
        }
        tree.sites = sites;
        tree.tree = ImmutableKdTree::new_from_slice(&points).ok();
        tree
    }

    /// Smallest value per channel that counts as positive.
    pub fn floor(&self) -> [f32; 3] {
        self.floor
    }

    /// Finds the `n` nearest to a pair of unit vectors; fewer when there are not as many. Of those
    /// equally far the earlier bin comes first.
    pub fn gather(&self, light: Vec3, view: Vec3, n: usize, near: &mut Neighbourhood) {
        near.clear();
        let (Some(tree), Some(n)) = (&self.tree, NonZero::new(n.min(self.sites.len()))) else {
            return;
        };
        let here = self.space.place(light, view);
        let mut found: Vec<(f64, u32, Place)> = tree
            .query(&here.map(|x| x as f32))
            .nearest_n::<SquaredEuclidean<f32>>(n)
            .execute()
            .into_iter()
            .map(|hit| {
                let site = self.sites[hit.item as usize];
                let place = self.space.turned(self.place_of(site), site.turns);
                let offset = std::array::from_fn(|k| place[k] - here[k]);
                (length2(&offset), hit.item, offset)
            })
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, item, offset) in found {
            near.push(offset, self.value_of(self.sites[item as usize]));
        }
    }

    fn place_of(&self, site: Site) -> Place {
        let bin = &self.bins.bins()[site.bin as usize];
        let (light, view) = match self.places {
            Places::Centres => {
                let (light, view) = self.bins.grid().light_and_view(bin.cell as usize);
                (self.directions[light], self.directions[view])
            }
            Places::Means => (bin.light.map(f64::from), bin.view.map(f64::from)),
        };
        if site.is_mirror {
            self.space.place(view, light)
        } else {
            self.space.place(light, view)
        }
    }

    fn value_of(&self, site: Site) -> [f64; 3] {
        let bin = &self.bins.bins()[site.bin as usize];
        match self.values {
            Transform::Linear => bin.median.map(f64::from),
            Transform::Logarithm => {
                [0, 1, 2].map(|c| self.bins.log_value(bin, c, self.floor[c]).into())
            }
        }
    }
}
