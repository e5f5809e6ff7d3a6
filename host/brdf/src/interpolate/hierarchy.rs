//! The data in a hierarchy of two levels of detail, and the nearest of them to a place.
//!
//! Samples lie densely on the sheet of each frame and sparsely between frames: the hundred nearest
//! bins are all of one or two frames, and none of the others. So neighbours in a balanced
//! kd-tree are *merged*, about ten into one (mean place, mean logarithm, both weighted by count, so
//! that a linear function is kept exactly). A hundred merged data reach as far as a thousand
//! bins, with their noise averaged. Where a material is sharper than that, the bins' own data are
//! what the merged ones are made of.

use super::coordinates::{Point, distance2};
use super::datum::{Datum, SIGMA_PER_MAD, merge};
use crate::quantile::median;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;
use std::ops::Range;

/// Data merged into one: at least this many, and less than twice as many.
const MERGE: usize = 6;
/// Merged data in a group, of which the search tree holds only the middle: finding a few groups
/// and ranking their members is several times cheaper than finding a hundred data one by one, and
/// a block needs a good neighbourhood, not the exact one.
const GROUP: usize = 8;
/// More data are ranked than are wanted, by this factor.
const SURPLUS: f64 = 1.6;

/// A level of detail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// About ten bins in one datum.
    Merged,
    /// A datum a bin.
    Bins,
}

/// Data in the order of a balanced kd-tree, the data merged of them, and a tree over groups of these.
pub struct Hierarchy<const N: usize = 3> {
    bins: Vec<Datum<N>>,
    merged: Vec<Datum<N>>,
    /// Where the bins of each merged datum start, and the end of the last.
    starts: Vec<u32>,
    /// Whether the second half of the data are the mirror images of the first, in their order.
    mirrored: bool,
    /// Middles of the groups of merged data.
    middles: Vec<Point>,
    tree: Option<ImmutableKdTree<f32, 6>>,
}

/// A neighbour: squared distance and number of the datum.
pub type Found = (f32, u32);

/// What a block can be fitted to: data at two levels of detail, and the nearest of them.
pub trait Neighbours<const N: usize = 3> {
    /// Writes merged data near a place to `found`, in no order: more than `n`, and with few
    /// exceptions the nearest `n` among them. Fewer when there are not as many.
    fn around(&self, place: &Point, n: usize, found: &mut Vec<Found>);

    /// Writes the bins of merged data to `found`, with their distances from a place.
    fn expand(&self, place: &Point, merged: &[Found], found: &mut Vec<Found>);

    /// A datum that was found.
    fn datum(&self, detail: Detail, number: u32) -> Datum<N>;
}

impl<const N: usize> Hierarchy<N> {
    /// Sorts and merges the data.
    pub fn new(data: Vec<Datum<N>>) -> Self {
        let (bins, starts) = in_order(data, 1);
        Self::sorted(bins, starts, false)
    }

    /// The same of `half` of the data, and the mirror images of all these: half the work. No mirror image
    /// of a datum is to be in the half itself.
    /// Each datum stands for `stands_for` bins, and so fewer are merged.
    pub fn with_mirror_images(half: Vec<Datum<N>>, stands_for: usize) -> Self {
        let (mut bins, mut starts) = in_order(half, stands_for);
        let n = bins.len();
        append_mirror_images(&mut bins);
        starts.pop();
        let images: Vec<u32> = starts.iter().map(|start| start + n as u32).collect();
        starts.extend(images);
        starts.push(2 * n as u32);
        Self::sorted(bins, starts, true)
    }

    /// The same data at other places. What is near in one system of coordinates is near in
    /// another: the order is kept, because sorting is what costs most.
    pub fn moved(&self, place: impl Fn(&Datum<N>) -> Point + Sync) -> Self {
        let bins = self
            .bins
            .par_iter()
            .map(|datum| Datum {
                point: place(datum),
                ..*datum
            })
            .collect();
        Self::sorted(bins, self.starts.clone(), self.mirrored)
    }

    fn sorted(bins: Vec<Datum<N>>, starts: Vec<u32>, mirrored: bool) -> Self {
        let merging = if mirrored {
            starts.len() / 2
        } else {
            starts.len() - 1
        };
        let mut merged: Vec<Datum<N>> = starts[..=merging]
            .par_windows(2)
            .filter_map(|w| merge(here(&bins[w[0] as usize..w[1] as usize])))
            .collect();
        if mirrored {
            append_mirror_images(&mut merged);
        }
        let middles: Vec<Point> = merged
            .chunks(GROUP)
            .filter_map(|data| merge(here(data)))
            .map(|n| n.point)
            .collect();
        let tree = ImmutableKdTree::new_from_slice(&middles).ok();
        Self {
            bins,
            merged,
            starts,
            mirrored,
            middles,
            tree,
        }
    }

    /// The data of a level.
    pub fn data(&self, detail: Detail) -> &[Datum<N>] {
        match detail {
            Detail::Merged => &self.merged,
            Detail::Bins => &self.bins,
        }
    }

    /// The bins' own data.
    pub(super) fn bins(&self) -> &[Datum<N>] {
        &self.bins
    }

    /// The numbers of the bins that are merged into one.
    pub(super) fn bins_of(&self, merged: usize) -> Range<usize> {
        self.starts[merged] as usize..self.starts[merged + 1] as usize
    }

    /// Middles of the groups of merged data.
    pub(super) fn middles(&self) -> &[Point] {
        &self.middles
    }

    /// The numbers of the merged data in a group.
    pub(super) fn group(&self, number: usize) -> Range<usize> {
        let start = number * GROUP;
        start..(start + GROUP).min(self.merged.len())
    }

    /// How many groups are looked at for the nearest `n` merged data.
    pub(super) fn groups_for(n: usize) -> usize {
        ((n as f64 * SURPLUS) as usize).div_ceil(GROUP)
    }
}

impl<const N: usize> Neighbours<N> for Hierarchy<N> {
    fn around(&self, place: &Point, n: usize, found: &mut Vec<Found>) {
        found.clear();
        let (Some(tree), Some(groups)) = (&self.tree, NonZero::new(Self::groups_for(n))) else {
            return;
        };
        for group in tree
            .query(place)
            .nearest_n::<SquaredEuclidean<f32>>(groups)
            .execute()
        {
            for k in self.group(group.item as usize) {
                found.push((distance2(place, &self.merged[k].point), k as u32));
            }
        }
    }

    fn expand(&self, place: &Point, merged: &[Found], found: &mut Vec<Found>) {
        found.clear();
        for (_, parent) in merged {
            for k in self.bins_of(*parent as usize) {
                found.push((distance2(place, &self.bins[k].point), k as u32));
            }
        }
    }

    fn datum(&self, detail: Detail, number: u32) -> Datum<N> {
        self.data(detail)[number as usize]
    }
}

/// Appends the mirror images of data to them.
fn append_mirror_images<const N: usize>(data: &mut Vec<Datum<N>>) {
    let n = data.len();
    let Some(any) = data.first().copied() else {
        return;
    };
    data.resize(2 * n, any);
    let (half, images) = data.split_at_mut(n);
    let pairs = images.par_iter_mut().zip(half);
    pairs.for_each(|(image, datum)| *image = datum.mirrored());
}

/// Data at their own places.
fn here<const N: usize>(data: &[Datum<N>]) -> impl Iterator<Item = (Point, &Datum<N>)> {
    data.iter().map(|datum| (datum.point, datum))
}

/// Keeps the nearest `n` and returns the distance of the farthest of them.
pub fn keep_nearest(found: &mut Vec<Found>, n: usize) -> f32 {
    if found.len() > n {
        found.select_nth_unstable_by(n, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(n);
    }
    found.iter().map(|f| f.0).fold(0.0, f32::max).sqrt()
}

/// Sorts data so that neighbours follow each other. Also where those that are to be merged start, and the
/// end of the last.
fn in_order<const N: usize>(
    mut data: Vec<Datum<N>>,
    stands_for: usize,
) -> (Vec<Datum<N>>, Vec<u32>) {
    let merged = (data.len() * stands_for / MERGE).min(data.len());
    let depth = merged.max(1).ilog2();
    split(&mut data, depth);
    let mut starts = Vec::with_capacity((1 << depth) + 1);
    push_starts(0, data.len(), depth, &mut starts);
    starts.push(data.len() as u32);
    down_weight_outliers(&mut data, &starts);
    (data, starts)
}

/// Sorts data by halving `depth` times along the widest axis.
fn split<const N: usize>(data: &mut [Datum<N>], depth: u32) {
    if depth == 0 {
        return;
    }
    let axis = widest_axis(data);
    let middle = data.len() / 2;
    data.select_nth_unstable_by(middle, |a, b| a.point[axis].total_cmp(&b.point[axis]));
    let (left, right) = data.split_at_mut(middle);
    if left.len() > 20_000 {
        rayon::join(|| split(left, depth - 1), || split(right, depth - 1));
    } else {
        split(left, depth - 1);
        split(right, depth - 1);
    }
}

/// Where the pieces of [`split`] start.
fn push_starts(from: usize, to: usize, depth: u32, starts: &mut Vec<u32>) {
    if depth == 0 {
        starts.push(from as u32);
        return;
    }
    let middle = from + (to - from) / 2;
    push_starts(from, middle, depth - 1, starts);
    push_starts(middle, to, depth - 1, starts);
}

fn widest_axis<const N: usize>(data: &[Datum<N>]) -> usize {
    let mut low = [f32::INFINITY; 6];
    let mut high = [f32::NEG_INFINITY; 6];
    // A thousand data show the shape of a large set.
    for datum in data.iter().step_by(data.len().div_ceil(1000)) {
        for k in 0..6 {
            low[k] = low[k].min(datum.point[k]);
            high[k] = high[k].max(datum.point[k]);
        }
    }
    let width = |k: &usize| high[*k] - low[*k];
    (0..6)
        .max_by(|a, b| width(a).total_cmp(&width(b)))
        .unwrap_or(0)
}

/// A datum of one or two samples that lies this many robust standard deviations of its neighbours
/// away from their median is an outlier (Hampel's test) …
const HAMPEL: f32 = 6.0;
/// … unless it is as near as this, in natural logarithms.
const HAMPEL_MIN: f32 = 0.3;
/// What an outlier's count is multiplied by.
const OUTLIER_WEIGHT: f32 = 0.01;

/// Finds outliers among the data that are merged into one. A median of three samples or more has
/// dealt with them already, and may well be the only one of its neighbours to see a highlight.
fn down_weight_outliers<const N: usize>(data: &mut [Datum<N>], starts: &[u32]) {
    let mut rest = data;
    let mut groups = Vec::with_capacity(starts.len());
    for w in starts.windows(2) {
        let (group, tail) = rest.split_at_mut((w[1] - w[0]) as usize);
        groups.push(group);
        rest = tail;
    }
    groups.par_iter_mut().with_min_len(1000).for_each_init(
        || (Vec::new(), Vec::new()),
        |(values, deviations), group| {
            // The sum over the channels: colour has no part in what makes an outlier.
            values.clear();
            values.extend(
                group
                    .iter()
                    .map(|n| n.log_value.iter().sum::<f32>() / N as f32),
            );
            deviations.clone_from(values);
            let middle = median(deviations);
            deviations.clear();
            deviations.extend(values.iter().map(|v| (v - middle).abs()));
            let limit = (HAMPEL * SIGMA_PER_MAD * median(deviations)).max(HAMPEL_MIN);
            for (datum, value) in group.iter_mut().zip(values.iter()) {
                if datum.count < 3.0 && (*value - middle).abs() > limit {
                    datum.count *= OUTLIER_WEIGHT;
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice() -> Vec<Datum> {
        (0..4000u32)
            .map(|k| {
                let (x, y, z) = ((k % 20) as f32, (k / 20 % 20) as f32, (k / 400) as f32);
                Datum {
                    point: [x, y, z, 0.0, 0.0, 0.0],
                    log_value: [x, 2.0 * y, x - z].map(|v| 0.01 * v),
                    count: 1.0 + (k % 3) as f32,
                    source: k,
                }
            })
            .collect()
    }

    /// Distances of the exact `n` nearest bins.
    fn exact(hierarchy: &Hierarchy, place: &Point, n: usize) -> Vec<f32> {
        let mut distances: Vec<f32> = hierarchy
            .data(Detail::Bins)
            .iter()
            .map(|n| distance2(place, &n.point).sqrt())
            .collect();
        distances.sort_by(f32::total_cmp);
        distances.truncate(n);
        distances
    }

    #[test]
    fn what_is_found_is_nearly_the_nearest_and_nothing_twice() {
        let hierarchy = Hierarchy::new(lattice());
        let (mut near, mut found) = (Vec::new(), Vec::new());
        for place in [[10.2, 9.9, 5.1, 0.0, 0.0, 0.0], [0.0; 6]] {
            hierarchy.around(&place, 30, &mut near);
            hierarchy.expand(&place, &near, &mut found);
            let radius = keep_nearest(&mut found, 60);
            assert_eq!(found.len(), 60);
            let farthest = exact(&hierarchy, &place, 60)[59];
            assert!(radius <= 1.15 * farthest, "{radius} {farthest}");
            let mut numbers: Vec<u32> = found.iter().map(|f| f.1).collect();
            numbers.sort();
            numbers.dedup();
            assert_eq!(numbers.len(), 60);
        }
    }

    #[test]
    fn merging_keeps_all_samples_and_a_linear_function() {
        let hierarchy = Hierarchy::new(lattice());
        let merged = hierarchy.data(Detail::Merged);
        assert_eq!(merged.len(), 512);
        let total: f32 = merged.iter().map(|n| n.count).sum();
        assert_eq!(total, lattice().iter().map(|n| n.count).sum::<f32>());
        for datum in merged {
            let [x, y, z, ..] = datum.point;
            for (got, truth) in datum
                .log_value
                .iter()
                .zip([x, 2.0 * y, x - z].map(|v| 0.01 * v))
            {
                assert!((got - truth).abs() < 1e-5, "{got} {truth}");
            }
        }
    }

    #[test]
    fn data_that_stand_for_many_bins_are_merged_by_few_but_never_by_none() {
        for stands_for in [1, 4, 1000] {
            let hierarchy = Hierarchy::with_mirror_images(lattice(), stands_for);
            let merged = hierarchy.data(Detail::Merged).len();
            assert!((0..merged).all(|k| !hierarchy.bins_of(k).is_empty()));
            assert_eq!(hierarchy.bins_of(merged - 1).end, 8000);
            let wanted = (8000 * stands_for / MERGE).min(8000);
            assert!(merged <= wanted && 2 * merged > wanted, "{merged}");
        }
    }

    #[test]
    fn mirror_images_stand_at_their_places_and_share_their_values() {
        let hierarchy = Hierarchy::with_mirror_images(lattice(), 1);
        for detail in [Detail::Bins, Detail::Merged] {
            let (half, images) = hierarchy
                .data(detail)
                .split_at(hierarchy.data(detail).len() / 2);
            assert_eq!(half.len(), images.len());
            for (datum, image) in half.iter().zip(images) {
                assert_eq!(image.point, datum.mirrored().point);
                assert_eq!(image.log_value, datum.log_value);
            }
        }
        let merged = hierarchy.data(Detail::Merged).len();
        assert_eq!(hierarchy.bins_of(merged - 1).end, 8000);
        // Each bin once in either half: the merged data of the second are those of its bins.
        for k in [0, merged / 2, merged - 1] {
            let bins = &hierarchy.bins()[hierarchy.bins_of(k)];
            let count: f32 = bins.iter().map(|n| n.count).sum();
            assert_eq!(count, hierarchy.data(Detail::Merged)[k].count);
        }
    }

    #[test]
    fn a_lone_outlier_is_down_weighted_and_one_of_many_samples_is_not() {
        let mut data = lattice();
        for datum in &mut data {
            datum.count = if datum.source == 1000 { 3.0 } else { 1.0 };
        }
        for k in [500, 1000] {
            data[k].log_value = [2.0; 3];
        }
        let hierarchy = Hierarchy::new(data);
        for datum in hierarchy.data(Detail::Bins) {
            let expected = match datum.source {
                500 => OUTLIER_WEIGHT,
                1000 => 3.0,
                _ => 1.0,
            };
            assert_eq!(datum.count, expected, "{}", datum.source);
        }
    }

    #[test]
    fn few_data_or_none_are_all_there_is() {
        let (mut near, mut found) = (Vec::new(), Vec::new());
        for n in [1, 3, 13] {
            let few = Hierarchy::new(lattice().into_iter().take(n).collect());
            few.around(&[0.0; 6], 60, &mut near);
            few.expand(&[0.0; 6], &near, &mut found);
            assert_eq!(found.len(), n);
        }
        let none: Hierarchy = Hierarchy::new(Vec::new());
        none.around(&[0.0; 6], 60, &mut near);
        assert!(near.is_empty());
    }

    #[test]
    fn identical_data_do_not_break_the_tree() {
        let mut data = lattice();
        data.iter_mut().for_each(|n| n.point = [1.0; 6]);
        let hierarchy = Hierarchy::new(data);
        let mut found = Vec::new();
        hierarchy.around(&[1.0; 6], 60, &mut found);
        assert_eq!(keep_nearest(&mut found, 60), 0.0);
        assert_eq!(found.len(), 60);
    }
}
