//! Few samples, at scattered places: kriging in double precision, evaluated at any directions.
//!
//! Where the blocks of [`interpolate`](crate::interpolate) share one system among thousands of cells, here each
//! place has a system through the data nearest to it, so that effort goes where the data are. The symmetry of the
//! material, the coordinates, the kernel and its nugget are chosen by cross-validation. All arithmetic is in
//! double precision and in one order: the same numbers on every processor.

mod cells;
mod choose;
mod data;
mod left_out;
mod local;
mod merge;
mod mirror;
mod narrow;
mod nugget;
mod patches;
mod places;
mod planes;
mod quadratic;
mod residual;
mod searches;
mod table;
#[cfg(test)]
mod tests;
mod tree;
mod trial;
mod tune;
mod wide;

pub use choose::{Choice, Reason};

use crate::dense::DenseBrdf;
use crate::direction::{Direction, Vec3};
use crate::elementary::Elementary;
use crate::grid::Grid;
use crate::interpolate::Coordinates;
use crate::interpolate::coordinates::Pair;
use crate::sample::Sample;
use crate::symmetry::{MirrorPlane, Symmetry, SymmetryKind};
use choose::Asked;
use data::{Data, Datum};
use local::{Local, Predicted};
use merge::Merged;
use places::{Places, exchanged};
use rayon::prelude::*;
use std::ops::Range;
use table::Table;

/// More places than this are not few.
pub const FEW: usize = 100_000;
/// Fewer places than this say nothing.
pub const PLACES_MIN: usize = 8;
/// Frames that hold more places than this, on average, are images of many samples.
const IMAGE: usize = 8;

/// Data in a system where noise is most of what there is.
const NEIGHBOURS_MOST: usize = 96;

/// How values correlate by their distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScatteredKernel {
    /// exp(−r): rough, as sharp peaks between few data are.
    Exponential,
    /// Matérn's with ν = 3/2: smooth.
    Matern32,
}

impl ScatteredKernel {
    fn scale(self) -> f64 {
        match self {
            ScatteredKernel::Exponential => 1.0,
            ScatteredKernel::Matern32 => 3f64.sqrt(),
        }
    }

    fn name(self) -> &'static str {
        match self {
            ScatteredKernel::Exponential => "exponential",
            ScatteredKernel::Matern32 => "matern32",
        }
    }
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The symmetry about the normal.
    pub symmetry: Symmetry,
    /// Whether a datum counts with light and view exchanged too. Where data contradict it, what is fitted
    /// at a place and at its reciprocal one is averaged by the certainty of either.
    pub reciprocal_data: bool,
    /// Where distances are taken.
    pub coordinates: Coordinates,
    /// How values correlate by their distance.
    pub kernel: ScatteredKernel,
    /// Data in a system.
    pub neighbours: usize,
    /// Range of the kernel in radii of the neighbourhood.
    pub range: f64,
    /// Variance of the noise of one sample over that of the values in a neighbourhood.
    pub nugget: f64,
    /// Variance of the noise of one sample's logarithm, which adds to that by how little the values in a neighbourhood
    /// spread; 0 where it is not known.
    pub noise_variance: f64,
    /// Neighbouring places that are merged into one datum, at most.
    pub merged: usize,
    /// Share of what looks like noise that may be a dependence on what the settings leave out, and is an error then.
    pub hidden: f64,
}

impl Settings {
    /// What cross-validation begins with.
    pub const DEFAULT: Settings = Settings {
        symmetry: Symmetry::None,
        reciprocal_data: true,
        coordinates: Coordinates::sum_difference(1.0),
        kernel: ScatteredKernel::Matern32,
        neighbours: 64,
        range: 8.0,
        nugget: 1e-4,
        noise_variance: 0.0,
        merged: 1,
        hidden: 0.0,
    };

    /// What is taken of data that are too few for cross-validation: straight from one to the next, and nothing
    /// beyond them. Isotropic: ten samples bear three angles better than four.
    pub const FEW: Settings = Settings {
        symmetry: Symmetry::Isotropic,
        coordinates: Coordinates::half_difference(0.3),
        kernel: ScatteredKernel::Exponential,
        nugget: 1e-2,
        ..Settings::DEFAULT
    };

    /// The same with another nugget: little of a signal is left in noise, and more data average it.
    fn with_nugget(self, nugget: f64) -> Self {
        let neighbours = if nugget > 0.05 {
            NEIGHBOURS_MOST
        } else {
            Self::DEFAULT.neighbours
        };
        Self {
            nugget,
            neighbours,
            ..self
        }
    }
}

impl std::fmt::Display for Settings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "kriging at each place, symmetry {}, {} data{}{}, {}, kernel {}, range {} radii, nugget {:.1e}{}",
            self.symmetry,
            self.neighbours,
            match self.merged {
                0 | 1 => String::new(),
                merged => format!(" of up to {merged} samples"),
            },
            if self.reciprocal_data {
                ""
            } else {
                " not exchanged"
            },
            self.coordinates,
            self.kernel.name(),
            self.range,
            self.nugget,
            match self.noise_variance {
                0.0 => String::new(),
                variance => format!(" and noise of {:.2} %", 100.0 * variance.sqrt()),
            },
        )
    }
}

/// What is kriged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Response {
    /// Logarithms.
    Logarithm,
    /// Values as they are: noise about a small signal has no logarithm, and must average out.
    Linear,
}

/// So many channels are colours.
const COLOURS: usize = 3;
/// The signal is within the noise where the median is less than this many times the most negative value.
const WITHIN_NOISE: f64 = 4.0;

impl Response {
    /// Of each channel. Colours are of one kind; of bands one may be dark where others are not.
    fn of<const N: usize>(here: &[&Datum<N>]) -> [Self; N] {
        let within_noise = |c: usize| {
            let values = here.iter().map(|d| d.value[c]);
            let lowest = values.clone().fold(f64::INFINITY, f64::min);
            // Without a negative one nothing needs sorting.
            lowest < 0.0 && {
                let mut values: Vec<f64> = values.collect();
                values.sort_by(f64::total_cmp);
                values[values.len() / 2] < -WITHIN_NOISE * lowest
            }
        };
        let within: [bool; N] = std::array::from_fn(within_noise);
        let any = N <= COLOURS && within.contains(&true);
        within.map(|within| match within || any {
            true => Response::Linear,
            false => Response::Logarithm,
        })
    }
}

/// A BRDF fitted to few samples, to be evaluated anywhere.
pub struct ScatteredFit<const N: usize = 3> {
    /// Places with a sample.
    measured: usize,
    data: Vec<Datum<N>>,
    places: Places,
    choice: Choice,
}

/// Whether samples are few, and scattered: not the images of a camera, which see many directions at once.
pub fn is_few<const N: usize>(samples: &[Sample<N>]) -> bool {
    samples.len() <= 8 * FEW && !are_images(samples) && data::count_places(samples) <= FEW
}

/// Whether samples are the images of a camera, by their frames' numbers: more than a few samples a frame.
pub fn are_images<const N: usize>(samples: &[Sample<N>]) -> bool {
    let mut frames: Vec<u32> = samples.iter().map(|s| s.frame).collect();
    frames.retain(|frame| *frame != Sample::NO_FRAME);
    let framed = frames.len();
    frames.sort_unstable();
    frames.dedup();
    framed > IMAGE * frames.len()
}

impl ScatteredFit {
    /// Fits samples, with a given symmetry or, without one, with what they show. `None` of too few.
    pub fn new(samples: &[Sample], symmetry: Option<SymmetryKind>) -> Option<Self> {
        let asked = symmetry.map(|kind| Asked { kind, plane: None });
        Self::asked(samples, asked)
    }

    /// Fits samples with a symmetry about a plane that is known. `None` of too few.
    pub fn about_plane(samples: &[Sample], kind: SymmetryKind, plane: MirrorPlane) -> Option<Self> {
        let plane = Some(plane);
        Self::asked(samples, Some(Asked { kind, plane }))
    }

    fn asked(samples: &[Sample], asked: Option<Asked>) -> Option<Self> {
        let data = Data::new(samples);
        if data.places.len() < PLACES_MIN {
            return None;
        }
        let choice = choose::choose(&data, asked);
        Some(Self::chosen(&data, choice))
    }

    /// Fits with settings that are known. `None` of too few.
    pub fn with_settings(samples: &[Sample], settings: Settings) -> Option<Self> {
        let data = Data::new(samples);
        (data.places.len() >= PLACES_MIN).then(|| Self::chosen(&data, Choice::of(settings)))
    }
}

impl<const N: usize> ScatteredFit<N> {
    fn chosen(data: &Data<N>, choice: Choice) -> Self {
        let merged = Merged::new(data, &choice.settings).data;
        Self {
            measured: data.places.len(),
            places: Places::new(&merged, &choice.settings),
            data: merged,
            choice,
        }
    }

    /// The same fit of other channels of these samples, which share what does not depend on values: neighbourhoods,
    /// covariances and their factors.
    #[must_use]
    pub fn of_channels<const M: usize>(&self, samples: &[Sample<M>]) -> ScatteredFit<M> {
        ScatteredFit::chosen(&Data::new(samples), self.choice.clone())
    }

    /// The settings, and why these.
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// Number of places with a sample.
    pub fn places(&self) -> usize {
        self.measured
    }

    /// The value at a pair of directions per channel, positive and reciprocal, and its standard error.
    pub fn at(&self, light: Direction, view: Direction) -> ([f64; N], [f64; N]) {
        let predicted = self.predicted(light.to_vec3(), view.to_vec3());
        let factor = self.choice.error_factor;
        let error = std::array::from_fn(|c| factor * predicted.relative[c] * predicted.value[c]);
        (predicted.value, error)
    }

    /// [`Self::at`] many pairs of light and view, by all threads.
    pub fn at_all(&self, pairs: &[(Direction, Direction)]) -> Vec<([f64; N], [f64; N])> {
        let at = |(light, view): &(Direction, Direction)| self.at(*light, *view);
        pairs.par_iter().map(at).collect()
    }

    /// The values of all cells of a grid and their standard errors per channel. Positive, finite, exactly
    /// reciprocal, one value a pole.
    pub fn dense(&self, grid: Grid, with_errors: bool) -> (DenseBrdf<N>, Option<[Vec<f32>; N]>) {
        if self.choice.settings.symmetry.is_isotropic() {
            self.dense_by_table(grid, with_errors)
        } else {
            self.dense_by_cells(grid, with_errors)
        }
    }

    /// The values of [`Self::dense`] of so many rings of lights (of one polar angle) at a time, or more where one is too
    /// few: `take` gets the rings and the cells of their lights, a plane a channel, or one plane for all channels that are
    /// alike.
    ///
    /// # Errors
    /// What `take` returns.
    pub fn by_rings<E>(
        &self,
        grid: Grid,
        at_a_time: usize,
        mut take: impl FnMut(Range<usize>, &[Vec<f32>]) -> Result<(), E>,
    ) -> Result<(), E> {
        let is_isotropic = self.choice.settings.symmetry.is_isotropic();
        let table = is_isotropic.then(|| Table::new(self, grid, false));
        for rings in patches::bands(grid, at_a_time) {
            let planes = match &table {
                Some(table) => table.spread(rings.clone(), self.channels(), |p, c| p.value[c]),
                None => self.planes_by_cells(grid, rings.clone(), false).0,
            };
            take(rings, &planes)?;
        }
        Ok(())
    }

    /// How many channels differ: one where all are alike.
    fn channels(&self) -> usize {
        let is_grey = |v: &[f64; N]| v.iter().all(|x| *x == v[0]);
        match self.data.iter().all(|d| is_grey(&d.value)) {
            true => 1,
            false => N,
        }
    }

    fn predicted(&self, light: Vec3, view: Vec3) -> Predicted<N> {
        let settings = &self.choice.settings;
        let place = settings.coordinates.pair(light, view);
        let here = self.predicted_at(place);
        if settings.reciprocal_data {
            return here;
        }
        preferred(&here, &self.predicted_at(exchanged(place)))
    }

    fn predicted_at(&self, place: Pair) -> Predicted<N> {
        let settings = &self.choice.settings;
        let near = self
            .places
            .around(place, settings.neighbours, settings, |_| true);
        Local::fit(&self.data, &near, settings).map_or(Predicted::NOTHING, |local| local.at(&place))
    }
}

/// A place's own prediction where data lie near it, and that of the reciprocal place where they lie nearer
/// to that one: what data say that contradict reciprocity.
fn preferred<const N: usize>(own: &Predicted<N>, reciprocal: &Predicted<N>) -> Predicted<N> {
    let variance = |p: &Predicted<N>| p.relative.iter().map(|r| r * r).sum::<f64>().max(1e-30);
    let ratio = (variance(own) / (NEARER * variance(reciprocal))).powi(4);
    let share = if ratio.is_finite() {
        ratio / (1.0 + ratio)
    } else {
        1.0
    };
    let mut mean = *own;
    for c in 0..N {
        let logs = [own, reciprocal].map(|p| p.value[c].natural_log());
        mean.value[c] = ((1.0 - share) * logs[0] + share * logs[1]).exponential();
        mean.relative[c] =
            (1.0 - share) * own.relative[c].min(1e6) + share * reciprocal.relative[c].min(1e6);
    }
    mean
}

/// The reciprocal place is preferred where its variance is less by more than this.
const NEARER: f64 = 4.0;

/// The mean of two of one value, weighted by their certainty.
fn averaged<const N: usize>(a: &Predicted<N>, b: &Predicted<N>) -> Predicted<N> {
    let mut mean = *a;
    for c in 0..N {
        let [wa, wb] = [a, b].map(|p| 1.0 / p.relative[c].powi(2).max(1e-18));
        let share = wb / (wa + wb);
        let log = (1.0 - share) * a.value[c].natural_log() + share * b.value[c].natural_log();
        mean.value[c] = log.exponential();
        mean.relative[c] = 1.0 / (wa + wb).sqrt();
    }
    mean
}
