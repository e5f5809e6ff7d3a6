//! A fit of samples that is asked at any directions, without a grid in between.

use super::groups::{groups, spread_over, stand_for_themselves};
use crate::Error;
use crate::budget::{Equation, PLACES, Part, SidesOfSamples, Slant, places, shape};
use crate::warnings;
use gonia_brdf::interpolate::FillError;
use gonia_brdf::scattered::{Choice, Reason, ScatteredFit};
use gonia_brdf::{Direction, Elementary, MirrorPlane, Sample, Symmetry, SymmetryKind};
use gonia_rig::{Budget, Channels, Remark, SampleValues};

/// More samples than this are not asked without a grid.
const SAMPLES_AT_MOST: usize = 1_000_000;

/// A fit of samples of any channels, which has a value at any directions.
pub struct FitOfSamples {
    channels: Channels,
    groups: Groups,
    choice: Choice,
    /// Where the samples lie; empty where values follow from their images by a symmetry too.
    measured: Vec<Pair>,
}

/// A pair of light and view.
type Pair = (Direction, Direction);
/// The measurement equation, and of each pair the share of its data that lie there and not at the reciprocal pair.
type Sided<'a> = (&'a Equation, &'a [f64]);
/// A fit of some of the channels, with their numbers.
type Group<const N: usize> = ([usize; N], ScatteredFit<N>);

/// Fits of as many channels as share a factorisation.
enum Groups {
    OfThree(Vec<Group<3>>),
    OfMany(Vec<Group<31>>),
}

fn at_all<const N: usize>((channels, fit): &Group<N>, pairs: &[Pair], values: &mut [Vec<f32>]) {
    for (values, (value, _)) in values.iter_mut().zip(fit.at_all(pairs)) {
        for (channel, value) in channels.iter().zip(value) {
            values[*channel] = value as f32;
        }
    }
}

impl FitOfSamples {
    /// Fits samples, and says what is to be said of them. One symmetry is taken for all channels: the one asked
    /// for, or what the samples show.
    ///
    /// # Errors
    /// Samples that contradict what they are taken for, or too few or too many of them.
    pub fn new(
        samples: impl Into<SampleValues>,
        symmetry: Option<SymmetryKind>,
    ) -> Result<(Self, Vec<Remark>), Error> {
        Self::fitted(samples.into(), |samples| {
            ScatteredFit::new(samples, symmetry)
        })
    }

    /// The same about a plane of symmetry that is known.
    ///
    /// # Errors
    /// As of [`Self::new`].
    pub fn about_plane(
        samples: impl Into<SampleValues>,
        kind: SymmetryKind,
        plane: MirrorPlane,
    ) -> Result<(Self, Vec<Remark>), Error> {
        Self::fitted(samples.into(), |samples| {
            ScatteredFit::about_plane(samples, kind, plane)
        })
    }

    fn fitted(
        mut samples: SampleValues,
        fit: impl Fn(&[Sample]) -> Option<ScatteredFit>,
    ) -> Result<(Self, Vec<Remark>), Error> {
        let mut remarks = warnings::of_oddities(&samples.keep_sound());
        let n = samples.channels().count();
        let spread = samples.three(spread_over(n));
        remarks.extend(warnings::of_samples(&spread)?);
        if spread.len() > SAMPLES_AT_MOST {
            return Err(Error::Contradicted {
                what: format!(
                    "{} samples are more than the {SAMPLES_AT_MOST} that can be asked without a grid",
                    spread.len()
                ),
                remedy: "make a dense BRDF of them with gonia fill, and query that".into(),
            });
        }
        let too_few = FillError::TooFewBins(spread.len());
        let fit = fit(&spread).ok_or(too_few)?;
        let choice = fit.choice().clone();
        remarks.extend(warnings::remarks_on_symmetry(&fit));
        if choice.reason == Reason::Assumed {
            remarks.push(warnings::remark_on_assumed_isotropy());
        }
        let measured = match choice.settings.symmetry {
            Symmetry::None => spread.iter().map(directions_of).collect(),
            _ => Vec::new(),
        };
        let groups = match n {
            _ if stand_for_themselves(n) => Groups::OfThree(vec![(spread_over(n), fit)]),
            10.. => Groups::OfMany(fits_of(&fit, &samples)),
            _ => Groups::OfThree(fits_of(&fit, &samples)),
        };
        let fit = Self {
            channels: samples.channels().clone(),
            groups,
            choice,
            measured,
        };
        Ok((fit, remarks))
    }

    /// What the values are of.
    pub fn channels(&self) -> &Channels {
        &self.channels
    }

    /// The settings, and why these.
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// The value of each channel at many pairs of light and view with its standard uncertainty (k = 1), in the same
    /// unit: of noise and interpolation, and of what a budget knows.
    pub fn with_uncertainty(
        &self,
        pairs: &[(Direction, Direction)],
        budget: Option<&Budget>,
    ) -> Vec<Vec<[f32; 2]>> {
        let equation = budget.map(Equation::new);
        let sides = equation
            .as_ref()
            .and_then(|_| SidesOfSamples::of(self.measured.iter().copied()));
        let there = |pair: &Pair| sides.as_ref().map_or(0.5, |of| of.there(pair.0, pair.1));
        let asked: Vec<_> = pairs.iter().flat_map(|(i, v)| places(*i, *v)).collect();
        let mut all = vec![vec![[0.0f32; 2]; self.channels.count()]; pairs.len()];
        let there: Vec<f64> = pairs.iter().map(there).collect();
        let given = (
            pairs,
            &asked[..],
            equation.as_ref().map(|e| (e, &there[..])),
        );
        match &self.groups {
            Groups::OfThree(groups) => groups.iter().for_each(|g| known(g, given, &mut all)),
            Groups::OfMany(groups) => groups.iter().for_each(|g| known(g, given, &mut all)),
        }
        all
    }

    /// The value of each channel at many pairs of light and view, by all threads.
    pub fn at_all(&self, pairs: &[(Direction, Direction)]) -> Vec<Vec<f32>> {
        let mut values = vec![vec![0.0f32; self.channels.count()]; pairs.len()];
        match &self.groups {
            Groups::OfThree(groups) => groups.iter().for_each(|g| at_all(g, pairs, &mut values)),
            Groups::OfMany(groups) => groups.iter().for_each(|g| at_all(g, pairs, &mut values)),
        }
        values
    }
}

/// Values and standard uncertainties of a group's channels at pairs, by those at the places around them.
fn known<const N: usize>(
    (channels, fit): &Group<N>,
    (pairs, asked, equation): (&[Pair], &[Pair], Option<Sided<'_>>),
    all: &mut [Vec<[f32; 2]>],
) {
    let found = fit.at_all(asked);
    let (found, _) = found.as_chunks::<PLACES>();
    for (k, ((about, out), (light, view))) in found.iter().zip(all).zip(pairs).enumerate() {
        for (c, channel) in channels.iter().enumerate() {
            let (value, noise) = (about[0].0[c], about[0].1[c]);
            let known = equation.map_or(0.0, |(equation, there)| {
                let shape = shape(&about.map(|(value, _)| value[c]));
                let (light, view) = (Slant::of(*light), Slant::of(*view));
                let effects = equation.of_reciprocal((&light, &view), &shape, there[k]);
                let scale = effects.u(Part::Scale);
                value * effects.u(Part::Direction).hypotenuse(scale)
            });
            out[*channel] = [value as f32, noise.hypotenuse(known) as f32];
        }
    }
}

/// The fit of all channels, group by group.
fn fits_of<const N: usize>(fit: &ScatteredFit, samples: &SampleValues) -> Vec<Group<N>> {
    let of_group = |channels| (channels, fit.of_channels(&samples.of_channels(channels)));
    groups(samples.channels().count())
        .into_iter()
        .map(of_group)
        .collect()
}

fn directions_of(sample: &Sample) -> Pair {
    (
        Direction::from_deg(sample.theta_i_deg.into(), sample.phi_i_deg.into()),
        Direction::from_deg(sample.theta_v_deg.into(), sample.phi_v_deg.into()),
    )
}
