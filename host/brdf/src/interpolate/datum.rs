//! The data to interpolate between: logarithms of values at mean measured directions, each with its
//! reciprocal twin.

use super::coordinates::{Coordinates, Point};
use crate::bins::{Bin, Bins};
use crate::quantile::median;
use rayon::prelude::*;

/// One value and its place.
#[derive(Clone, Copy, Debug)]
pub struct Datum<const N: usize = 3> {
    /// Place.
    pub point: Point,
    /// Natural logarithm of the bin's value, per channel: see [`Bins::log_value`].
    pub log_value: [f32; N],
    /// Number of samples behind it; less for an outlier.
    pub count: f32,
    /// Twice the number of the bin it came from, and one more where light and view are exchanged;
    /// of no meaning for a merged datum.
    pub source: u32,
}

impl<const N: usize> Datum<N> {
    /// Number of the bin that the datum came from.
    pub fn bin(&self) -> usize {
        (self.source / 2) as usize
    }

    /// The same with light and view exchanged: [`Coordinates`] only flip the sign of the second half.
    pub fn mirrored(&self) -> Self {
        let [a, b, c, d, e, f] = self.point;
        Self {
            point: [a, b, c, -d, -e, -f],
            source: self.source ^ 1,
            ..*self
        }
    }
}

/// A median at or below this share of the material's median brightness is raised to it: noise can
/// make dark values negative, and their logarithm must stay finite.
const FLOOR_SHARE: f32 = 1e-4;

/// The datum of one bin in so many, numbered as all bins come: the bin's own or its mirror image (light and
/// view exchanged), whichever has the difference of light and view that points to positive x. The others
/// are the mirror images of these.
pub fn half_of_data<const N: usize>(
    bins: &Bins<N>,
    one_in: usize,
    coordinates: Coordinates,
) -> Vec<Datum<N>> {
    let floor = floor_of(bins.bins().iter());
    (0..bins.bins().len())
        .into_par_iter()
        .step_by(one_in.max(1))
        .map(|number| {
            let bin = &bins.bins()[number];
            let datum = Datum {
                point: coordinates.point(bin.light.map(f64::from), bin.view.map(f64::from)),
                log_value: std::array::from_fn(|c| bins.log_value(bin, c, floor[c])),
                count: bin.count as f32,
                source: 2 * number as u32,
            };
            if datum.point[3] < 0.0 {
                datum.mirrored()
            } else {
                datum
            }
        })
        .collect()
}

/// The mean of data at given places, weighted by count; `None` of none.
pub(super) fn merge<'a, const N: usize>(
    data: impl Iterator<Item = (Point, &'a Datum<N>)>,
) -> Option<Datum<N>> {
    let mut point = [0.0; 6];
    let mut log_value = [0.0f32; N];
    let mut count = 0.0;
    for (place, datum) in data {
        for k in 0..6 {
            point[k] += datum.count * place[k];
        }
        for c in 0..N {
            log_value[c] += datum.count * datum.log_value[c];
        }
        count += datum.count;
    }
    (count > 0.0).then(|| Datum {
        point: point.map(|p| p / count),
        log_value: log_value.map(|v| v / count),
        count,
        source: u32::MAX,
    })
}

/// The smallest value per channel that takes part.
pub(crate) fn floor_of<'a, const N: usize>(
    bins: impl Iterator<Item = &'a Bin<N>> + Clone,
) -> [f32; N] {
    std::array::from_fn(|c| {
        // The median brightness of a few thousand bins is good enough for a floor.
        let total = bins.clone().count().max(1);
        let mut values: Vec<f32> = bins
            .clone()
            .step_by(total.div_ceil(20_000))
            .map(|b| b.median[c])
            .filter(|v| *v > 0.0)
            .collect();
        (FLOOR_SHARE * median(&mut values)).max(f32::MIN_POSITIVE)
    })
}

/// Ratio of standard deviation to MAD for normal noise.
pub const SIGMA_PER_MAD: f32 = 1.4826;
