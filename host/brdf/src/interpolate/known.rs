//! What is known, sorted: once for choosing settings, for calibrating error bars and for filling.

use super::coordinates::{Coordinates, Point, distance2};
use super::levels::{Detail, Found, Levels, Neighbours};
use super::nodes::{Node, half_of_nodes, merge};
use crate::bins::Bins;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// The coordinates that many nodes are sorted in. What is near in one system is near in another, so that
/// the order serves for all: sorting is what costs most. Of few bins, neighbours lie far apart, and
/// are near in one system only; these are sorted anew for each.
pub(super) const SORTED_IN: Coordinates = Coordinates {
    power: 0.1,
    weight: 1.0,
};

/// Bins, and their nodes in order.
pub struct Known<'a> {
    bins: &'a Bins,
    levels: Levels,
    coordinates: Coordinates,
    one_bin_in: usize,
}

/// Fewer bins than this are few.
pub(super) const MANY_BINS: usize = 1_000_000;

impl<'a> Known<'a> {
    /// Sorts the bins' nodes.
    pub fn new(bins: &'a Bins) -> Self {
        Self::thinned(bins, 1)
    }

    /// Sorts the nodes of one bin in so many, where there are many: neighbours on the sheet of one frame
    /// tell much the same, and sorting them all takes longer than a quick fill.
    pub fn thinned(bins: &'a Bins, one_in: usize) -> Self {
        let many = bins.bins().len() >= MANY_BINS;
        Self::sorted_in(bins, if many { one_in } else { 1 }, SORTED_IN)
    }

    fn sorted_in(bins: &'a Bins, one_in: usize, coordinates: Coordinates) -> Self {
        let nodes = half_of_nodes(bins, one_in, coordinates);
        Self {
            bins,
            levels: Levels::with_mirror_images(nodes, one_in),
            coordinates,
            one_bin_in: one_in,
        }
    }

    /// The same, sorted anew for other coordinates where this order would not serve for them.
    pub(super) fn sorted_for(&self, coordinates: Coordinates) -> Option<Self> {
        let few = self.bins.bins().len() < MANY_BINS;
        (few && coordinates != self.coordinates).then(|| Self::sorted_in(self.bins, 1, coordinates))
    }

    /// The bins.
    pub fn bins(&self) -> &'a Bins {
        self.bins
    }

    /// Of how many bins one is looked at.
    pub fn one_bin_in(&self) -> usize {
        self.one_bin_in
    }

    /// The nodes as they were sorted.
    pub fn levels(&self) -> &Levels {
        &self.levels
    }

    /// The nodes in other coordinates than those they were sorted in; `None` where these are the same.
    pub fn moved(&self, coordinates: Coordinates) -> Option<Levels> {
        if let Some(sorted) = self.sorted_for(coordinates) {
            return Some(sorted.levels);
        }
        let place = |node: &Node| self.coordinates.convert(&node.point, coordinates);
        (coordinates != self.coordinates).then(|| self.levels.moved(place))
    }

    /// The nodes of those bins that `keep` keeps (by their number), in some coordinates. Nothing is
    /// copied: this is for a few thousand places, where [`Self::moved`] is for all.
    pub fn part<K: Fn(usize) -> bool>(&self, coordinates: Coordinates, keep: K) -> Part<'_, K> {
        // Groups are found by their middles, which need not be exact.
        let middles = self.levels.middles().iter();
        let middles: Vec<Point> = middles
            .map(|middle| self.coordinates.convert(middle, coordinates))
            .collect();
        Part {
            levels: &self.levels,
            sorted_in: self.coordinates,
            coordinates,
            tree: ImmutableKdTree::new_from_slice(&middles).ok(),
            keep,
        }
    }
}

/// See [`Known::part`].
pub struct Part<'a, K> {
    levels: &'a Levels,
    sorted_in: Coordinates,
    coordinates: Coordinates,
    tree: Option<ImmutableKdTree<f32, 6>>,
    keep: K,
}

impl<K: Fn(usize) -> bool> Part<'_, K> {
    fn place(&self, node: &Node) -> Point {
        self.sorted_in.convert(&node.point, self.coordinates)
    }

    /// Whether a bin of a merged node is not left out.
    fn is_kept(&self, number: usize) -> bool {
        let mut nodes = self.levels.bins()[self.levels.bins_of(number)].iter();
        nodes.any(|node| (self.keep)(node.bin()))
    }

    /// A merged node without the bins that are left out; `None` when none are left.
    fn merged(&self, number: usize) -> Option<Node> {
        let nodes = self.levels.bins()[self.levels.bins_of(number)].iter();
        let kept = nodes.filter(|node| (self.keep)(node.bin()));
        merge(kept.map(|node| (self.place(node), node)))
    }
}

impl<K: Fn(usize) -> bool> Neighbours for Part<'_, K> {
    fn around(&self, place: &Point, n: usize, found: &mut Vec<Found>) {
        found.clear();
        let (Some(tree), Some(groups)) = (&self.tree, NonZero::new(Levels::groups_for(n))) else {
            return;
        };
        let query = tree.query(place);
        for group in query.nearest_n::<SquaredEuclidean<f32>>(groups).execute() {
            for number in self.levels.group(group.item as usize) {
                // Near enough for ranking is where the node would be with all of its bins.
                if self.is_kept(number) {
                    let node = &self.levels.nodes(Detail::Merged)[number];
                    found.push((distance2(place, &self.place(node)), number as u32));
                }
            }
        }
    }

    fn expand(&self, place: &Point, merged: &[Found], found: &mut Vec<Found>) {
        found.clear();
        for (_, parent) in merged {
            for number in self.levels.bins_of(*parent as usize) {
                let node = &self.levels.bins()[number];
                if (self.keep)(node.bin()) {
                    found.push((distance2(place, &self.place(node)), number as u32));
                }
            }
        }
    }

    fn node(&self, detail: Detail, number: u32) -> Node {
        let stored = self.levels.node(detail, number);
        match detail {
            Detail::Merged => self.merged(number as usize).unwrap_or(stored),
            Detail::Bins => Node {
                point: self.place(&stored),
                ..stored
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use crate::sample::Sample;

    fn bins() -> Bins {
        let samples: Vec<Sample> = (0..6000)
            .map(|k| {
                let at = |a: f64, to: f64| ((k as f64 * a).fract() * to) as f32;
                Sample {
                    theta_i_deg: at(0.819_173, 84.0),
                    phi_i_deg: at(0.671_044, 360.0),
                    theta_v_deg: at(0.549_700, 84.0),
                    phi_v_deg: at(0.450_300, 360.0),
                    rgb: [1.0 + k as f32, 2.0, 3.0],
                    frame: k,
                }
            })
            .collect();
        Bins::new(Grid::PAPER, &samples)
    }

    #[test]
    fn what_is_left_out_is_neither_found_nor_merged() {
        let bins = bins();
        let known = Known::new(&bins);
        let keep = |bin: usize| !bin.is_multiple_of(3);
        let part = known.part(Coordinates::sum_difference(0.5), keep);
        let (mut near, mut found) = (Vec::new(), Vec::new());
        let place = part.node(Detail::Bins, 500).point;
        part.around(&place, 40, &mut near);
        part.expand(&place, &near, &mut found);
        assert!(near.len() >= 40 && found.len() > near.len());
        for (distance, number) in &found {
            let node = part.node(Detail::Bins, *number);
            assert!(keep(node.bin()));
            assert_eq!(*distance, distance2(&place, &node.point));
        }
        let counted: f32 = found
            .iter()
            .map(|f| part.node(Detail::Bins, f.1).count)
            .sum();
        let merged: f32 = near
            .iter()
            .map(|f| part.node(Detail::Merged, f.1).count)
            .sum();
        assert!((counted - merged).abs() < 1e-3 * counted);
    }

    #[test]
    fn with_nothing_left_out_the_same_is_found_as_in_all_nodes() {
        let bins = bins();
        let known = Known::new(&bins);
        let part = known.part(SORTED_IN, |_| true);
        let (mut some, mut all) = (Vec::new(), Vec::new());
        for number in [0, 999, 7000] {
            let place = part.node(Detail::Bins, number).point;
            part.around(&place, 40, &mut some);
            known.levels().around(&place, 40, &mut all);
            let shared = some
                .iter()
                .filter(|a| all.iter().any(|b| a.1 == b.1))
                .count();
            assert!(10 * shared >= 9 * all.len(), "{shared} of {}", all.len());
        }
    }
}
