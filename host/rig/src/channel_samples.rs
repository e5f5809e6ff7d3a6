//! Samples of any number of channels.

use crate::{Channels, Oddities, keep_sound};
use gonia_brdf::Sample;

/// Samples whose channels are known at run time only.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ChannelSamples {
    /// What the values are of.
    pub channels: Channels,
    /// Directions and frame of each sample.
    pub places: Vec<Sample<0>>,
    /// Their values, sample by sample: as many to a sample as there are channels.
    pub values: Vec<f32>,
}

impl ChannelSamples {
    /// The samples with some of their channels; those that are not there count as not finite.
    pub fn of_channels<const N: usize>(&self, channels: [usize; N]) -> Vec<Sample<N>> {
        let rows = self.values.chunks_exact(self.channels.count());
        let with = |(place, row): (&Sample<0>, &[f32])| {
            let values = channels.map(|c| row.get(c).copied().unwrap_or(f32::NAN));
            place.with_values(values)
        };
        self.places.iter().zip(rows).map(with).collect()
    }

    /// [`keep_sound`] of all channels at once: a sample that is not sound in one of them is left out.
    pub fn keep_sound(&mut self) -> Oddities {
        let n = self.channels.count();
        // A value that is not finite speaks for its sample; a frame is its number here.
        let rows = self.values.chunks_exact(n);
        let mut judged: Vec<Sample<1>> = (0..)
            .zip(self.places.iter().zip(rows))
            .map(|(number, (place, row))| {
                let odd = row.iter().find(|v| !v.is_finite());
                place
                    .with_values([odd.copied().unwrap_or_default()])
                    .in_frame(number)
            })
            .collect();
        let odd = keep_sound(&mut judged);
        let kept = judged.len() < self.places.len();
        for (k, sample) in judged.iter().enumerate() {
            let number = sample.frame as usize;
            let frame = self.places[number].frame;
            self.places[k] = sample.with_values([]).in_frame(frame);
            if kept {
                self.values.copy_within(number * n..(number + 1) * n, k * n);
            }
        }
        self.places.truncate(judged.len());
        self.values.truncate(judged.len() * n);
        odd
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;

    #[test]
    fn what_is_odd_in_one_channel_leaves_the_sample_out_and_the_others_keep_their_own_values() {
        let light = Direction::from_deg(30.0, 10.0);
        let place = |k: u32| Sample::new(light, light, []).in_frame(7 + k);
        let (channels, _) = Channels::bands(&[400.0, 500.0]).unwrap();
        let mut samples = ChannelSamples {
            channels,
            places: (0..4).map(place).collect(),
            values: vec![1.0, 2.0, 3.0, f32::NAN, 5.0, 6.0, 7.0, 8.0],
        };
        samples.places[2].theta_v_deg = -30.0;
        let odd = samples.keep_sound();
        assert_eq!((odd.not_finite.count, odd.signed.count), (1, 1));
        let kept = samples.of_channels([1, 0]);
        let rows: Vec<_> = kept.iter().map(|s| (s.frame, s.phi_v_deg, s.rgb)).collect();
        assert_eq!(
            rows,
            [
                (7, 10.0, [2.0, 1.0]),
                (9, 190.0, [6.0, 5.0]),
                (10, 10.0, [8.0, 7.0])
            ]
        );
    }
}
