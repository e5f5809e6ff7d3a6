//! The data, sorted: once for choosing settings, for calibrating error bars and for filling.

use super::coordinates::{Coordinates, Point, distance2};
use super::datum::{Datum, half_of_data, merge};
use super::hierarchy::{Detail, Found, Hierarchy, Neighbours};
use crate::bins::Bins;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// The coordinates that many data are sorted in. What is near in one system is near in another, so that
/// the order serves for all: sorting is what costs most. Of few bins, neighbours lie far apart, and
/// are near in one system only; these are sorted anew for each.
pub(super) const SORTED_IN: Coordinates = Coordinates {
    exponent: 0.1,
    weight: 1.0,
};

/// Bins, and their data in order.
pub struct Data<'a, const N: usize = 3> {
    bins: &'a Bins<N>,
    hierarchy: Hierarchy<N>,
    coordinates: Coordinates,
    one_bin_in: usize,
}

/// Fewer bins than this are few.
pub(super) const MANY_BINS: usize = 1_000_000;

impl<'a, const N: usize> Data<'a, N> {
    /// Sorts the bins' data.
    pub fn new(bins: &'a Bins<N>) -> Self {
        Self::thinned(bins, 1)
    }

    /// Sorts the data of one bin in so many, where there are many: neighbours on the sheet of one frame
    /// differ little, and sorting them all takes longer than a quick fill.
    pub fn thinned(bins: &'a Bins<N>, one_in: usize) -> Self {
        let many = bins.bins().len() >= MANY_BINS;
        Self::sorted_in(bins, if many { one_in } else { 1 }, SORTED_IN)
    }

    fn sorted_in(bins: &'a Bins<N>, one_in: usize, coordinates: Coordinates) -> Self {
        let data = half_of_data(bins, one_in, coordinates);
        Self {
            bins,
            hierarchy: Hierarchy::with_mirror_images(data, one_in),
            coordinates,
            one_bin_in: one_in,
        }
    }

    /// The same, sorted anew for other coordinates where this order would not serve for them.
    pub(super) fn sorted_for(&self, coordinates: Coordinates) -> Option<Self> {
        let few = self.bins.bins().len() < MANY_BINS;
        (few && coordinates != self.coordinates).then(|| Self::sorted_in(self.bins, 1, coordinates))
    }

    /// The same data in the order that serves best for some coordinates: what uses these several times sorts once.
    pub fn in_order_for(self, coordinates: Coordinates) -> Self {
        self.sorted_for(coordinates).unwrap_or(self)
    }

    /// The bins.
    pub fn bins(&self) -> &'a Bins<N> {
        self.bins
    }

    /// Of how many bins one is used.
    pub fn one_bin_in(&self) -> usize {
        self.one_bin_in
    }

    /// The data as they were sorted.
    pub fn hierarchy(&self) -> &Hierarchy<N> {
        &self.hierarchy
    }

    /// The data in other coordinates than those they were sorted in; `None` where these are the same.
    pub fn moved(&self, coordinates: Coordinates) -> Option<Hierarchy<N>> {
        if let Some(sorted) = self.sorted_for(coordinates) {
            return Some(sorted.hierarchy);
        }
        let place = |datum: &Datum<N>| self.coordinates.convert(&datum.point, coordinates);
        (coordinates != self.coordinates).then(|| self.hierarchy.moved(place))
    }

    /// The data of those bins that `keep` keeps (by their number), in some coordinates. Nothing is
    /// copied: this is for a few thousand places, where [`Self::moved`] is for all.
    pub fn subset<K: Fn(usize) -> bool>(
        &self,
        coordinates: Coordinates,
        keep: K,
    ) -> Subset<'_, K, N> {
        // Groups are found by their middles, which need not be exact.
        let middles = self.hierarchy.middles().iter();
        let middles: Vec<Point> = middles
            .map(|middle| self.coordinates.convert(middle, coordinates))
            .collect();
        Subset {
            hierarchy: &self.hierarchy,
            sorted_in: self.coordinates,
            coordinates,
            tree: ImmutableKdTree::new_from_slice(&middles).ok(),
            keep,
        }
    }
}

/// See [`Data::subset`].
pub struct Subset<'a, K, const N: usize = 3> {
    hierarchy: &'a Hierarchy<N>,
    sorted_in: Coordinates,
    coordinates: Coordinates,
    tree: Option<ImmutableKdTree<f32, 6>>,
    keep: K,
}

impl<K: Fn(usize) -> bool, const N: usize> Subset<'_, K, N> {
    fn place(&self, datum: &Datum<N>) -> Point {
        self.sorted_in.convert(&datum.point, self.coordinates)
    }

    /// Whether a bin of a merged datum is not left out.
    fn is_kept(&self, number: usize) -> bool {
        let mut data = self.hierarchy.bins()[self.hierarchy.bins_of(number)].iter();
        data.any(|datum| (self.keep)(datum.bin()))
    }

    /// A merged datum without the bins that are left out; `None` when none are left.
    fn merged(&self, number: usize) -> Option<Datum<N>> {
        let data = self.hierarchy.bins()[self.hierarchy.bins_of(number)].iter();
        let kept = data.filter(|datum| (self.keep)(datum.bin()));
        merge(kept.map(|datum| (self.place(datum), datum)))
    }
}

impl<K: Fn(usize) -> bool, const N: usize> Neighbours<N> for Subset<'_, K, N> {
    fn around(&self, place: &Point, n: usize, found: &mut Vec<Found>) {
        found.clear();
        let (Some(tree), Some(groups)) = (&self.tree, NonZero::new(Hierarchy::<N>::groups_for(n)))
        else {
            return;
        };
        let query = tree.query(place);
        for group in query.nearest_n::<SquaredEuclidean<f32>>(groups).execute() {
            for number in self.hierarchy.group(group.item as usize) {
                // Near enough for ranking is where the datum would be with all of its bins.
                if self.is_kept(number) {
                    let datum = &self.hierarchy.data(Detail::Merged)[number];
                    found.push((distance2(place, &self.place(datum)), number as u32));
                }
            }
        }
    }

    fn expand(&self, place: &Point, merged: &[Found], found: &mut Vec<Found>) {
        found.clear();
        for (_, parent) in merged {
            for number in self.hierarchy.bins_of(*parent as usize) {
                let datum = &self.hierarchy.bins()[number];
                if (self.keep)(datum.bin()) {
                    found.push((distance2(place, &self.place(datum)), number as u32));
                }
            }
        }
    }

    fn datum(&self, detail: Detail, number: u32) -> Datum<N> {
        let stored = self.hierarchy.datum(detail, number);
        match detail {
            Detail::Merged => self.merged(number as usize).unwrap_or(stored),
            Detail::Bins => Datum {
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
        let data = Data::new(&bins);
        let keep = |bin: usize| !bin.is_multiple_of(3);
        let subset = data.subset(Coordinates::sum_difference(0.5), keep);
        let (mut near, mut found) = (Vec::new(), Vec::new());
        let place = subset.datum(Detail::Bins, 500).point;
        subset.around(&place, 40, &mut near);
        subset.expand(&place, &near, &mut found);
        assert!(near.len() >= 40 && found.len() > near.len());
        for (distance, number) in &found {
            let datum = subset.datum(Detail::Bins, *number);
            assert!(keep(datum.bin()));
            assert_eq!(*distance, distance2(&place, &datum.point));
        }
        let counted: f32 = found
            .iter()
            .map(|f| subset.datum(Detail::Bins, f.1).count)
            .sum();
        let merged: f32 = near
            .iter()
            .map(|f| subset.datum(Detail::Merged, f.1).count)
            .sum();
        assert!((counted - merged).abs() < 1e-3 * counted);
    }

    #[test]
    fn with_nothing_left_out_the_same_is_found_as_in_all_nodes() {
        let bins = bins();
        let data = Data::new(&bins);
        let subset = data.subset(SORTED_IN, |_| true);
        let (mut some, mut all) = (Vec::new(), Vec::new());
        for number in [0, 999, 7000] {
            let place = subset.datum(Detail::Bins, number).point;
            subset.around(&place, 40, &mut some);
            data.hierarchy().around(&place, 40, &mut all);
            let shared = some
                .iter()
                .filter(|a| all.iter().any(|b| a.1 == b.1))
                .count();
            assert!(10 * shared >= 9 * all.len(), "{shared} of {}", all.len());
        }
    }
}
