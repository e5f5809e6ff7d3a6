//! Neighbours merged into one: where noise is most of what sets them apart, a mean of several says more than each, and
//! its logarithm is not biased by noise.

use super::Settings;
use super::data::{Data, Datum};
use super::places::turned_to_axis;
use crate::direction::{Vec3, normalize};
use crate::interpolate::coordinates::Pair;

/// Data, and which of the places each is the mean of.
pub(super) struct Merged<const N: usize = 3> {
    pub data: Vec<Datum<N>>,
    /// Numbers of places; none where each datum is a place of its own.
    members: Vec<Vec<u32>>,
}

/// A place on its way into a mean.
struct Member {
    number: u32,
    light: Vec3,
    view: Vec3,
    pair: Pair,
}

impl<const N: usize> Merged<N> {
    /// So many neighbours each as the settings say.
    pub fn new(all: &Data<N>, settings: &Settings) -> Self {
        if settings.merged <= 1 {
            return Self {
                data: all.places.clone(),
                members: Vec::new(),
            };
        }
        let mut members: Vec<Member> = (0u32..)
            .zip(&all.places)
            .map(|(number, datum)| {
                let (light, view) = oriented(datum, settings);
                Member {
                    number,
                    light,
                    view,
                    pair: settings.coordinates.pair(light, view),
                }
            })
            .collect();
        let mut merged = Self {
            data: Vec::new(),
            members: Vec::new(),
        };
        merged.split(&mut members, all, settings.merged);
        merged
    }

    /// Halves at the median of the widest axis until few enough are left.
    fn split(&mut self, members: &mut [Member], all: &Data<N>, at_most: usize) {
        if members.len() <= at_most {
            self.data.push(mean(members, all));
            self.members
                .push(members.iter().map(|m| m.number).collect());
            return;
        }
        let width = |axis: usize| {
            let of_axis = || members.iter().map(|m| m.pair[axis]);
            of_axis().fold(f64::NEG_INFINITY, f64::max) - of_axis().fold(f64::INFINITY, f64::min)
        };
        let widths = [0, 1, 2, 3, 4, 5].map(width);
        let widest = (0..6).max_by(|a, b| widths[*a].total_cmp(&widths[*b]));
        let axis = widest.unwrap_or(0);
        let half = members.len() / 2;
        members.select_nth_unstable_by(half, |a, b| {
            let order = a.pair[axis].total_cmp(&b.pair[axis]);
            order.then(a.number.cmp(&b.number))
        });
        let (low, high) = members.split_at_mut(half);
        self.split(low, all, at_most);
        self.split(high, all, at_most);
    }

    /// A datum without the places of a group: `None` where none are left.
    pub fn without(
        &self,
        number: u32,
        group: u32,
        all: &Data<N>,
        settings: &Settings,
    ) -> Without<N> {
        let Some(members) = self.members.get(number as usize) else {
            return match self.data[number as usize].group == group {
                true => Without::Nothing,
                false => Without::Same,
            };
        };
        let is_kept = |m: &u32| all.places[*m as usize].group != group;
        if members.iter().all(is_kept) {
            return Without::Same;
        }
        let kept: Vec<Member> = members
            .iter()
            .filter(|m| is_kept(m))
            .map(|number| {
                let (light, view) = oriented(&all.places[*number as usize], settings);
                Member {
                    number: *number,
                    light,
                    view,
                    pair: [0.0; 6],
                }
            })
            .collect();
        match kept.is_empty() {
            true => Without::Nothing,
            false => Without::Less(mean(&kept, all)),
        }
    }
}

/// What is left of a datum without a group.
pub(super) enum Without<const N: usize = 3> {
    Same,
    Less(Datum<N>),
    Nothing,
}

/// Where turns do not matter, all are merged at one azimuth.
fn oriented<const N: usize>(datum: &Datum<N>, settings: &Settings) -> (Vec3, Vec3) {
    if settings.symmetry.is_isotropic() {
        turned_to_axis(datum.light, datum.view)
    } else {
        (datum.light, datum.view)
    }
}

fn mean<const N: usize>(members: &[Member], all: &Data<N>) -> Datum<N> {
    let of = |m: &Member| &all.places[m.number as usize];
    let count: f64 = members.iter().map(|m| of(m).count).sum();
    let sum = |what: &dyn Fn(&Member) -> f64| {
        let weighted = members.iter().map(|m| of(m).count * what(m));
        weighted.sum::<f64>() / count
    };
    let direction = |what: fn(&Member) -> Vec3| normalize([0, 1, 2].map(|k| sum(&|m| what(m)[k])));
    let value = std::array::from_fn(|c| sum(&|m| of(m).value[c]));
    Datum {
        light: direction(|m| m.light),
        view: direction(|m| m.view),
        value,
        log: all.logs(value),
        count,
        group: members.first().map_or(0, |m| of(m).group),
    }
}
