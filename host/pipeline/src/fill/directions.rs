//! A fit of samples that is asked at any directions, without a grid in between.

use super::groups::{groups, spread_over};
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
    /// Fits of some of the channels, each with the numbers of its three.
    groups: Vec<([usize; 3], ScatteredFit)>,
    choice: Choice,
    /// Where the samples lie; empty where values follow from their images by a symmetry too.
    measured: Vec<(Direction, Direction)>,
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
        let mut of_all = groups::<3>(n);
        let groups = if of_all == [spread_over(n)] {
            of_all
                .pop()
                .map(|channels| (channels, fit))
                .into_iter()
                .collect()
        } else {
            let of_group = |channels| (channels, fit.of_channels(&samples.of_channels(channels)));
            of_all.into_iter().map(of_group).collect()
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
        let there = |pair: &(Direction, Direction)| {
            sides.as_ref().map_or(0.5, |of| of.there(pair.0, pair.1))
        };
        let asked: Vec<_> = pairs.iter().flat_map(|(i, v)| places(*i, *v)).collect();
        let mut all = vec![vec![[0.0f32; 2]; self.channels.count()]; pairs.len()];
        for (channels, fit) in &self.groups {
            let found = fit.at_all(&asked);
            let (found, _) = found.as_chunks::<PLACES>();
            for ((about, out), (light, view)) in found.iter().zip(&mut all).zip(pairs) {
                let there = there(&(*light, *view));
                for (c, channel) in channels.iter().enumerate() {
                    let (value, noise) = (about[0].0[c], about[0].1[c]);
                    let known = equation.as_ref().map_or(0.0, |equation| {
                        let shape = shape(&about.map(|(value, _)| value[c]));
                        let (light, view) = (Slant::of(*light), Slant::of(*view));
                        let effects = equation.of_reciprocal((&light, &view), &shape, there);
                        value
                            * effects
                                .u(Part::Direction)
                                .hypotenuse(effects.u(Part::Scale))
                    });
                    out[*channel] = [value as f32, noise.hypotenuse(known) as f32];
                }
            }
        }
        all
    }

    /// The value of each channel at many pairs of light and view, by all threads.
    pub fn at_all(&self, pairs: &[(Direction, Direction)]) -> Vec<Vec<f32>> {
        let mut values = vec![vec![0.0f32; self.channels.count()]; pairs.len()];
        for (channels, fit) in &self.groups {
            for (values, (value, _)) in values.iter_mut().zip(fit.at_all(pairs)) {
                for (channel, value) in channels.iter().zip(value) {
                    values[*channel] = value as f32;
                }
            }
        }
        values
    }
}

fn directions_of(sample: &Sample) -> (Direction, Direction) {
    (
        Direction::from_deg(sample.theta_i_deg.into(), sample.phi_i_deg.into()),
        Direction::from_deg(sample.theta_v_deg.into(), sample.phi_v_deg.into()),
    )
}
