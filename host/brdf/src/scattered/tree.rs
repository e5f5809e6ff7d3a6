//! A balanced tree over places, and the nearest of them: leaf by leaf, many distances at a time.

use pulp::bytemuck::cast_slice;
use pulp::{Arch, Simd, WithSimd};

/// A place that is searched for: six coordinates.
pub(super) type At = [f32; 6];

/// Places of a leaf, at most.
const LEAF: usize = 32;
/// So many parts of the tree wait to be looked at, at most: one a level.
const DEPTH_MAX: usize = 32;
/// So many searches compete, at most.
const SEARCHES: u32 = 8;

/// The corner of a box with the smallest coordinates, and the one with the largest.
type Bounds = [At; 2];

/// Places of a leaf, axis by axis, and the number of the first, which the others follow; beyond the last one no coordinate
/// is a number.
struct Leaf {
    at: [[f32; LEAF]; 6],
    first: u32,
}

/// The tree: each part is halved across its longest side, so often that the halves fit leaves.
pub(super) struct Tree {
    /// Bounds of the whole, of its halves, of theirs and so on.
    bounds: Vec<Bounds>,
    leaves: Vec<Leaf>,
    arch: Arch,
}

/// What is nearest, of one search or of several that compete: places by number, each with the number of the search.
pub(super) struct Nearest {
    many: usize,
    /// Squared distance, number of the place, number of the search, in this order of significance: squared distances are
    /// not negative, so that their bits are in their order.
    found: Vec<u64>,
    /// None farther than this counts.
    within: f32,
}

impl Nearest {
    /// So many.
    pub fn new(many: usize) -> Self {
        Self {
            many: many.max(1),
            found: Vec::with_capacity(2 * many + LEAF),
            within: f32::INFINITY,
        }
    }

    /// Number of the place, and of the search, in no order.
    pub fn found(mut self) -> impl Iterator<Item = (u32, u32)> {
        self.drop_far();
        self.found.into_iter().map(|found| {
            let number = found as u32;
            (number / SEARCHES, number % SEARCHES)
        })
    }

    /// Keeps as many as are wanted.
    fn drop_far(&mut self) {
        if self.found.len() > self.many {
            let (_, last, _) = self.found.select_nth_unstable(self.many - 1);
            self.within = f32::from_bits((*last >> 32) as u32);
            self.found.truncate(self.many);
        }
    }
}

impl Tree {
    /// Of fewer than 2²⁹ places, and in which order it numbers them: what is near has near numbers, and what is looked up
    /// by them is near in memory.
    pub fn new(places: &[At]) -> (Self, Vec<u32>) {
        let mut all: Vec<(At, u32)> = places.iter().copied().zip(0u32..).collect();
        let depth = all.len().div_ceil(LEAF).next_power_of_two().ilog2();
        let mut tree = Self {
            bounds: vec![[[f32::INFINITY; 6], [f32::NEG_INFINITY; 6]]; (2 << depth) - 1],
            leaves: Vec::with_capacity(1 << depth),
            arch: Arch::new(),
        };
        tree.split(&mut all, 0, 0, depth);
        (tree, all.into_iter().map(|(_, number)| number).collect())
    }

    /// Splits places, of which the first has a number, into a part of the tree.
    fn split(&mut self, places: &mut [(At, u32)], first: u32, part: usize, depth: u32) {
        let [mut low, mut high] = self.bounds[part];
        for (at, _) in places.iter() {
            for axis in 0..6 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
        }
        self.bounds[part] = [low, high];
        if depth == 0 {
            let mut leaf = Leaf {
                at: [[f32::NAN; LEAF]; 6],
                first,
            };
            for (k, (at, _)) in places.iter().enumerate() {
                for axis in 0..6 {
                    leaf.at[axis][k] = at[axis];
                }
            }
            self.leaves.push(leaf);
            return;
        }
        let length = |axis: &usize| high[*axis] - low[*axis];
        let longest = (0..6).max_by(|a, b| length(a).total_cmp(&length(b)));
        let axis = longest.unwrap_or(0);
        let half = places.len() / 2;
        if half > 0 {
            let order = |a: &(At, u32), b: &(At, u32)| a.0[axis].total_cmp(&b.0[axis]);
            places.select_nth_unstable_by(half, order);
        }
        let (before, after) = places.split_at_mut(half);
        self.split(before, first, 2 * part + 1, depth - 1);
        self.split(after, first + half as u32, 2 * part + 2, depth - 1);
    }

    /// Adds to what is nearest, as what a search with this number (0 ..= 7) finds around a place.
    pub fn search(&self, place: At, search: u32, nearest: &mut Nearest) {
        self.arch.dispatch(Searched {
            tree: self,
            place,
            search,
            nearest,
        });
    }
}

struct Searched<'a> {
    tree: &'a Tree,
    place: At,
    search: u32,
    nearest: &'a mut Nearest,
}

impl WithSimd for Searched<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { tree, place, .. } = self;
        let at = place.map(|x| simd.splat_f32s(x));
        let nearest = self.nearest;
        let first_leaf = tree.leaves.len() - 1;
        // Parts that are left to be looked at, and how far they are.
        let mut waiting = [(0usize, 0f32); DEPTH_MAX];
        let mut many = 1;
        while many > 0 {
            many -= 1;
            let (mut part, distance2) = waiting[many];
            if distance2 > nearest.within {
                continue;
            }
            while part < first_leaf {
                let halves = [2 * part + 1, 2 * part + 2];
                let [a, b] = halves.map(|half| beyond(&tree.bounds[half], &place));
                let (near, far) = match a <= b {
                    true => ((halves[0], a), (halves[1], b)),
                    false => ((halves[1], b), (halves[0], a)),
                };
                if far.1 <= nearest.within {
                    waiting[many] = far;
                    many += 1;
                }
                part = near.0;
            }
            if beyond(&tree.bounds[part], &place) > nearest.within {
                continue;
            }
            let leaf = &tree.leaves[part - first_leaf];
            for group in 0..LEAF / S::F32_LANES {
                let mut wide = simd.splat_f32s(0.0);
                for axis in 0..6 {
                    let off = simd.sub_f32s(S::as_simd_f32s(&leaf.at[axis]).0[group], at[axis]);
                    wide = simd.add_f32s(wide, simd.mul_f32s(off, off));
                }
                // Of what is no number this does not hold.
                let within = simd.splat_f32s(nearest.within);
                let is_near = simd.less_than_or_equal_f32s(wide, within);
                if simd.first_true_m32s(is_near) == S::F32_LANES {
                    continue;
                }
                let wide = [wide];
                let squares: &[f32] = cast_slice(&wide);
                let first = leaf.first + (group * S::F32_LANES) as u32;
                for (square, number) in squares.iter().zip(first..) {
                    if *square <= nearest.within {
                        let number = u64::from(number * SEARCHES + self.search);
                        let found = u64::from(square.to_bits()) << 32 | number;
                        nearest.found.push(found);
                    }
                }
            }
            if nearest.found.len() >= 2 * nearest.many {
                nearest.drop_far();
            }
        }
    }
}

/// The square of how far a place is from a box.
#[inline(always)]
fn beyond([low, high]: &Bounds, place: &At) -> f32 {
    let mut sum = 0.0;
    for axis in 0..6 {
        let (below, above) = (low[axis] - place[axis], place[axis] - high[axis]);
        let off = if below > above { below } else { above };
        let off = if off > 0.0 { off } else { 0.0 };
        sum += off * off;
    }
    sum
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn what_is_found_is_nearest_by_one_search_and_by_several() {
        let mut random = Random::new(4);
        let mut at = || [0; 6].map(|_| random.between(-1.0, 1.0) as f32);
        for count in [0, 1, 31, 33, 70, 1000] {
            // Every place is there twice.
            let half: Vec<At> = (0..count).map(|_| at()).collect();
            let places = [&half[..], &half[..]].concat();
            let (tree, order) = Tree::new(&places);
            let places: Vec<At> = order.iter().map(|k| places[*k as usize]).collect();
            let queries = [at(), at()];
            for many in [1, 8, 200] {
                let mut nearest = Nearest::new(many);
                let mut all = Vec::new();
                for (search, query) in (0u32..).zip(&queries) {
                    tree.search(*query, search, &mut nearest);
                    all.extend((0u32..).zip(&places).map(|(number, place)| {
                        let off = (0..6).map(|k| (place[k] - query[k]) * (place[k] - query[k]));
                        (off.fold(0f32, |a, b| a + b).to_bits(), number, search)
                    }));
                }
                all.sort_unstable();
                all.truncate(many);
                let mut expected: Vec<(u32, u32)> = all.iter().map(|f| (f.1, f.2)).collect();
                let mut found: Vec<(u32, u32)> = nearest.found().collect();
                expected.sort_unstable();
                found.sort_unstable();
                assert_eq!(found, expected, "{count} {many}");
            }
        }
    }
}
