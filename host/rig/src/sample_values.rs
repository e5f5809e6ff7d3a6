//! Samples of colours, or of what else their channels are.

use crate::{ChannelSamples, Channels, Oddities, keep_sound};
use gonia_brdf::Sample;
use std::borrow::Cow;

/// Samples of red, green and blue, which are most, as they lie in memory; or of other channels.
#[derive(Clone, Debug, PartialEq)]
pub enum SampleValues {
    /// Of red, green and blue.
    Rgb(Vec<Sample>),
    /// Of other channels.
    Channels(ChannelSamples),
}

impl SampleValues {
    /// What the values are of.
    pub fn channels(&self) -> &Channels {
        match self {
            Self::Rgb(_) => &Channels::Rgb,
            Self::Channels(samples) => &samples.channels,
        }
    }

    /// How many samples.
    pub fn len(&self) -> usize {
        match self {
            Self::Rgb(samples) => samples.len(),
            Self::Channels(samples) => samples.places.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The samples with three of their channels; those that are not there count as not finite.
    pub fn three(&self, channels: [usize; 3]) -> Cow<'_, [Sample]> {
        match self {
            Self::Rgb(samples) if channels == [0, 1, 2] => Cow::Borrowed(samples),
            _ => Cow::Owned(self.of_channels(channels)),
        }
    }

    /// The samples with some of their channels: see [`ChannelSamples::of_channels`].
    pub fn of_channels<const N: usize>(&self, channels: [usize; N]) -> Vec<Sample<N>> {
        match self {
            Self::Rgb(samples) => {
                let with = |s: &Sample| {
                    let values = channels.map(|c| s.rgb.get(c).copied().unwrap_or(f32::NAN));
                    s.with_values(values)
                };
                samples.iter().map(with).collect()
            }
            Self::Channels(samples) => samples.of_channels(channels),
        }
    }

    /// [`keep_sound`] of all channels at once: a sample that is not sound in one of them is left out.
    pub fn keep_sound(&mut self) -> Oddities {
        match self {
            Self::Rgb(samples) => keep_sound(samples),
            Self::Channels(samples) => samples.keep_sound(),
        }
    }

    /// The frame numbers, to be changed.
    pub fn frames_mut(&mut self) -> Box<dyn Iterator<Item = &mut u32> + '_> {
        match self {
            Self::Rgb(samples) => Box::new(samples.iter_mut().map(|s| &mut s.frame)),
            Self::Channels(samples) => Box::new(samples.places.iter_mut().map(|s| &mut s.frame)),
        }
    }

    /// Appends samples, and leaves none of them; `false`, and nothing is done, where their channels are others.
    pub fn append(&mut self, more: &mut Self) -> bool {
        match (self, more) {
            (Self::Rgb(all), Self::Rgb(more)) => all.append(more),
            (Self::Channels(all), Self::Channels(more)) if all.channels == more.channels => {
                all.places.append(&mut more.places);
                all.values.append(&mut more.values);
            }
            _ => return false,
        }
        true
    }
}

impl From<Vec<Sample>> for SampleValues {
    fn from(samples: Vec<Sample>) -> Self {
        Self::Rgb(samples)
    }
}

impl From<ChannelSamples> for SampleValues {
    fn from(samples: ChannelSamples) -> Self {
        Self::Channels(samples)
    }
}
