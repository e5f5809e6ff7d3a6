//! The nodes at two levels of detail, and the nearest of them to a place.
//!
//! Samples lie densely on the sheet of each frame and sparsely between frames: the hundred nearest
//! bins tell much of one or two frames and nothing of the others. So neighbours in a balanced
//! kd-tree are *merged*, about ten into one (mean place, mean logarithm, both weighted by count, so
//! that a linear function is kept exactly). A hundred merged nodes reach as far as a thousand
//! bins, with their noise averaged. Where a material is sharper than that, the bins' own nodes are
//! the children of the merged ones.

use super::coordinates::{Point, distance2};
use super::nodes::{Node, SIGMA_PER_MAD, merge};
use crate::bins::median;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;
use std::ops::Range;

/// Nodes merged into one: at least this many, and less than twice as many.
const MERGE: usize = 6;
/// Merged nodes in a group, of which the search tree holds only the middle: finding a few groups
/// and ranking their members is several times cheaper than finding a hundred nodes one by one, and
/// a block needs a good neighbourhood, not the exact one.
const GROUP: usize = 8;
/// More nodes are ranked than are asked for, by this factor.
const SURPLUS: f64 = 1.6;

/// A level of detail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// About ten bins in one node.
    Merged,
    /// A node a bin.
    Bins,
}

/// Nodes in the order of a balanced kd-tree, their merged parents, and a tree over groups of these.
pub struct Levels {
    bins: Vec<Node>,
    merged: Vec<Node>,
    /// Where the bins of each merged node start, and the end of the last.
    starts: Vec<u32>,
    /// Whether the second half of the nodes are the mirror images of the first, in their order.
    mirrored: bool,
    /// Middles of the groups of merged nodes.
    middles: Vec<Point>,
    tree: Option<ImmutableKdTree<f32, 6>>,
}

/// A neighbour: squared distance and number of the node.
pub type Found = (f32, u32);

/// What a block can be fitted to: nodes at two levels of detail, and the nearest of them.
pub trait Neighbours {
    /// Writes merged nodes near a place to `found`, in no order: more than `n`, and with few
    /// exceptions the nearest `n` among them. Fewer when there are not as many.
    fn around(&self, place: &Point, n: usize, found: &mut Vec<Found>);

    /// Writes the bins of merged nodes to `found`, with their distances from a place.
    fn expand(&self, place: &Point, merged: &[Found], found: &mut Vec<Found>);

    /// A node that was found.
    fn node(&self, detail: Detail, number: u32) -> Node;
}

impl Levels {
    /// Sorts and merges the nodes.
    pub fn new(nodes: Vec<Node>) -> Self {
        let (bins, starts) = in_order(nodes, 1);
        Self::sorted(bins, starts, false)
    }

    /// The same of `half` of the nodes, and the mirror images of all these: half the work. No mirror image
    /// of a node is to be in the half itself.
    /// Each node stands for `stands_for` bins, and so fewer are merged.
    pub fn with_mirror_images(half: Vec<Node>, stands_for: usize) -> Self {
        let (mut bins, mut starts) = in_order(half, stands_for);
        let n = bins.len();
        append_mirror_images(&mut bins);
        starts.pop();
        let images: Vec<u32> = starts.iter().map(|start| start + n as u32).collect();
        starts.extend(images);
        starts.push(2 * n as u32);
        Self::sorted(bins, starts, true)
    }

    /// The same nodes at other places. What is near in one system of coordinates is near in
    /// another: the order is kept, because sorting is what costs most.
    pub fn moved(&self, place: impl Fn(&Node) -> Point + Sync) -> Self {
        let bins = self
            .bins
            .par_iter()
            .map(|node| Node {
                point: place(node),
                ..*node
            })
            .collect();
        Self::sorted(bins, self.starts.clone(), self.mirrored)
    }

    fn sorted(bins: Vec<Node>, starts: Vec<u32>, mirrored: bool) -> Self {
        let merging = if mirrored {
            starts.len() / 2
        } else {
            starts.len() - 1
        };
        let mut merged: Vec<Node> = starts[..=merging]
            .par_windows(2)
            .filter_map(|w| merge(here(&bins[w[0] as usize..w[1] as usize])))
            .collect();
        if mirrored {
            append_mirror_images(&mut merged);
        }
        let middles: Vec<Point> = merged
            .chunks(GROUP)
            .filter_map(|nodes| merge(here(nodes)))
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

    /// The nodes of a level.
    pub fn nodes(&self, detail: Detail) -> &[Node] {
        match detail {
            Detail::Merged => &self.merged,
            Detail::Bins => &self.bins,
        }
    }

    /// The bins' own nodes.
    pub(super) fn bins(&self) -> &[Node] {
        &self.bins
    }

    /// The numbers of the bins that are merged into one.
    pub(super) fn bins_of(&self, merged: usize) -> Range<usize> {
        self.starts[merged] as usize..self.starts[merged + 1] as usize
    }

    /// Middles of the groups of merged nodes.
    pub(super) fn middles(&self) -> &[Point] {
        &self.middles
    }

    /// The numbers of the merged nodes in a group.
    pub(super) fn group(&self, number: usize) -> Range<usize> {
        let start = number * GROUP;
        start..(start + GROUP).min(self.merged.len())
    }

    /// How many groups are looked at for the nearest `n` merged nodes.
    pub(super) fn groups_for(n: usize) -> usize {
        ((n as f64 * SURPLUS) as usize).div_ceil(GROUP)
    }
}

impl Neighbours for Levels {
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

    fn node(&self, detail: Detail, number: u32) -> Node {
        self.nodes(detail)[number as usize]
    }
}

/// Appends the mirror images of nodes to them.
fn append_mirror_images(nodes: &mut Vec<Node>) {
    let n = nodes.len();
    let Some(any) = nodes.first().copied() else {
        return;
    };
    nodes.resize(2 * n, any);
    let (half, images) = nodes.split_at_mut(n);
    let pairs = images.par_iter_mut().zip(half);
    pairs.for_each(|(image, node)| *image = node.mirrored());
}

/// Nodes at their own places.
fn here(nodes: &[Node]) -> impl Iterator<Item = (Point, &Node)> {
    nodes.iter().map(|node| (node.point, node))
}

/// Keeps the nearest `n` and returns the distance of the farthest of them.
pub fn keep_nearest(found: &mut Vec<Found>, n: usize) -> f32 {
    if found.len() > n {
        found.select_nth_unstable_by(n, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(n);
    }
    found.iter().map(|f| f.0).fold(0.0, f32::max).sqrt()
}

/// Sorts nodes so that neighbours follow each other. Also where those that are to be merged start, and the
/// end of the last.
fn in_order(mut nodes: Vec<Node>, stands_for: usize) -> (Vec<Node>, Vec<u32>) {
    let merged = (nodes.len() * stands_for / MERGE).min(nodes.len());
    let depth = merged.max(1).ilog2();
    split(&mut nodes, depth);
    let mut starts = Vec::with_capacity((1 << depth) + 1);
    push_starts(0, nodes.len(), depth, &mut starts);
    starts.push(nodes.len() as u32);
    doubt_outliers(&mut nodes, &starts);
    (nodes, starts)
}

/// Sorts nodes by halving `depth` times along the widest axis.
fn split(nodes: &mut [Node], depth: u32) {
    if depth == 0 {
        return;
    }
    let axis = widest_axis(nodes);
    let middle = nodes.len() / 2;
    nodes.select_nth_unstable_by(middle, |a, b| a.point[axis].total_cmp(&b.point[axis]));
    let (left, right) = nodes.split_at_mut(middle);
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

fn widest_axis(nodes: &[Node]) -> usize {
    let mut low = [f32::INFINITY; 6];
    let mut high = [f32::NEG_INFINITY; 6];
    // A thousand nodes show the shape of a large set.
    for node in nodes.iter().step_by(nodes.len().div_ceil(1000)) {
        for k in 0..6 {
            low[k] = low[k].min(node.point[k]);
            high[k] = high[k].max(node.point[k]);
        }
    }
    let width = |k: &usize| high[*k] - low[*k];
    (0..6)
        .max_by(|a, b| width(a).total_cmp(&width(b)))
        .unwrap_or(0)
}

/// A node of one or two samples that lies this many robust standard deviations of its neighbours
/// away from their median is doubted (Hampel's test) …
const HAMPEL: f32 = 6.0;
/// … unless it is as near as this, in natural logarithms.
const HAMPEL_MIN: f32 = 0.3;
/// What a doubted node still counts.
const DOUBTED: f32 = 0.01;

/// Finds outliers among the nodes that are merged into one. A median of three samples or more has
/// dealt with them already, and may well be the only one of its neighbours to see a highlight.
fn doubt_outliers(nodes: &mut [Node], starts: &[u32]) {
    let mut rest = nodes;
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
            values.extend(group.iter().map(|n| n.log_value.iter().sum::<f32>() / 3.0));
            deviations.clone_from(values);
            let middle = median(deviations);
            deviations.clear();
            deviations.extend(values.iter().map(|v| (v - middle).abs()));
            let limit = (HAMPEL * SIGMA_PER_MAD * median(deviations)).max(HAMPEL_MIN);
            for (node, value) in group.iter_mut().zip(values.iter()) {
                if node.count < 3.0 && (*value - middle).abs() > limit {
                    node.count *= DOUBTED;
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice() -> Vec<Node> {
        (0..4000u32)
            .map(|k| {
                let (x, y, z) = ((k % 20) as f32, (k / 20 % 20) as f32, (k / 400) as f32);
                Node {
                    point: [x, y, z, 0.0, 0.0, 0.0],
                    log_value: [x, 2.0 * y, x - z].map(|v| 0.01 * v),
                    count: 1.0 + (k % 3) as f32,
                    source: k,
                }
            })
            .collect()
    }

    /// Distances of the exact `n` nearest bins.
    fn exact(levels: &Levels, place: &Point, n: usize) -> Vec<f32> {
        let mut distances: Vec<f32> = levels
            .nodes(Detail::Bins)
            .iter()
            .map(|n| distance2(place, &n.point).sqrt())
            .collect();
        distances.sort_by(f32::total_cmp);
        distances.truncate(n);
        distances
    }

    #[test]
    fn what_is_found_is_nearly_the_nearest_and_nothing_twice() {
        let levels = Levels::new(lattice());
        let (mut near, mut found) = (Vec::new(), Vec::new());
        for place in [[10.2, 9.9, 5.1, 0.0, 0.0, 0.0], [0.0; 6]] {
            levels.around(&place, 30, &mut near);
            levels.expand(&place, &near, &mut found);
            let radius = keep_nearest(&mut found, 60);
            assert_eq!(found.len(), 60);
            let farthest = exact(&levels, &place, 60)[59];
            assert!(radius <= 1.15 * farthest, "{radius} {farthest}");
            let mut numbers: Vec<u32> = found.iter().map(|f| f.1).collect();
            numbers.sort();
            numbers.dedup();
            assert_eq!(numbers.len(), 60);
        }
    }

    #[test]
    fn merging_keeps_all_samples_and_a_linear_function() {
        let levels = Levels::new(lattice());
        let merged = levels.nodes(Detail::Merged);
        assert_eq!(merged.len(), 512);
        let total: f32 = merged.iter().map(|n| n.count).sum();
        assert_eq!(total, lattice().iter().map(|n| n.count).sum::<f32>());
        for node in merged {
            let [x, y, z, ..] = node.point;
            for (got, truth) in node
                .log_value
                .iter()
                .zip([x, 2.0 * y, x - z].map(|v| 0.01 * v))
            {
                assert!((got - truth).abs() < 1e-5, "{got} {truth}");
            }
        }
    }

    #[test]
    fn nodes_that_stand_for_many_bins_are_merged_by_few_but_never_by_none() {
        for stands_for in [1, 4, 1000] {
            let levels = Levels::with_mirror_images(lattice(), stands_for);
            let merged = levels.nodes(Detail::Merged).len();
            assert!((0..merged).all(|k| !levels.bins_of(k).is_empty()));
            assert_eq!(levels.bins_of(merged - 1).end, 8000);
            let wanted = (8000 * stands_for / MERGE).min(8000);
            assert!(merged <= wanted && 2 * merged > wanted, "{merged}");
        }
    }

    #[test]
    fn mirror_images_stand_at_their_places_and_share_their_values() {
        let levels = Levels::with_mirror_images(lattice(), 1);
        for detail in [Detail::Bins, Detail::Merged] {
            let (half, images) = levels
                .nodes(detail)
                .split_at(levels.nodes(detail).len() / 2);
            assert_eq!(half.len(), images.len());
            for (node, image) in half.iter().zip(images) {
                assert_eq!(image.point, node.mirrored().point);
                assert_eq!(image.log_value, node.log_value);
            }
        }
        let merged = levels.nodes(Detail::Merged).len();
        assert_eq!(levels.bins_of(merged - 1).end, 8000);
        // Each bin once in either half: the merged nodes of the second are those of its bins.
        for k in [0, merged / 2, merged - 1] {
            let bins = &levels.bins()[levels.bins_of(k)];
            let count: f32 = bins.iter().map(|n| n.count).sum();
            assert_eq!(count, levels.nodes(Detail::Merged)[k].count);
        }
    }

    #[test]
    fn a_lone_outlier_is_doubted_and_one_of_many_samples_is_not() {
        let mut nodes = lattice();
        for node in &mut nodes {
            node.count = if node.source == 1000 { 3.0 } else { 1.0 };
        }
        for k in [500, 1000] {
            nodes[k].log_value = [2.0; 3];
        }
        let levels = Levels::new(nodes);
        for node in levels.nodes(Detail::Bins) {
            let expected = match node.source {
                500 => DOUBTED,
                1000 => 3.0,
                _ => 1.0,
            };
            assert_eq!(node.count, expected, "{}", node.source);
        }
    }

    #[test]
    fn few_nodes_or_none_are_all_there_is() {
        let (mut near, mut found) = (Vec::new(), Vec::new());
        for n in [1, 3, 13] {
            let few = Levels::new(lattice().into_iter().take(n).collect());
            few.around(&[0.0; 6], 60, &mut near);
            few.expand(&[0.0; 6], &near, &mut found);
            assert_eq!(found.len(), n);
        }
        let none = Levels::new(Vec::new());
        none.around(&[0.0; 6], 60, &mut near);
        assert!(near.is_empty());
    }

    #[test]
    fn identical_nodes_do_not_break_the_tree() {
        let mut nodes = lattice();
        nodes.iter_mut().for_each(|n| n.point = [1.0; 6]);
        let levels = Levels::new(nodes);
        let mut found = Vec::new();
        levels.around(&[1.0; 6], 60, &mut found);
        assert_eq!(keep_nearest(&mut found, 60), 0.0);
        assert_eq!(found.len(), 60);
    }
}
