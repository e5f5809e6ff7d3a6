//! The values of a patch's pixels, channel by channel, in room that is used again for the next.

/// Values gathered so far.
#[derive(Default)]
pub struct Patch {
    channels: [Vec<f32>; 3],
    len: usize,
}

impl Patch {
    /// Forgets all values.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Adds the pixels of a row: one pass parts the channels.
    pub fn extend(&mut self, pixels: &[[f32; 3]]) {
        let (start, end) = (self.len, self.len + pixels.len());
        for channel in &mut self.channels {
            if channel.len() < end {
                channel.resize(2 * end, 0.0);
            }
        }
        let [r, g, b] = self.channels.each_mut().map(|c| &mut c[start..end]);
        for (((pixel, r), g), b) in pixels.iter().zip(r).zip(g).zip(b) {
            (*r, *g, *b) = (pixel[0], pixel[1], pixel[2]);
        }
        self.len = end;
    }

    /// The values of a channel.
    pub fn channel(&mut self, c: usize) -> &mut [f32] {
        &mut self.channels[c][..self.len]
    }

    /// Whether all values are finite.
    pub fn is_finite(&self) -> bool {
        // All bits of the exponent are set in infinities and in what is no number: one more of it
        // carries into the sign.
        let carry = |v: &f32| (v.to_bits() & 0x7fff_ffff) + 0x0080_0000;
        let bits = |channel: &[f32]| channel.iter().fold(0, |bits, v| bits | carry(v));
        let channels = self.channels.iter().map(|c| &c[..self.len]);
        channels.map(bits).all(|bits| bits >> 31 == 0)
    }

    /// All values.
    pub fn values(&self) -> impl Iterator<Item = f32> {
        self.channels
            .iter()
            .flat_map(|c| c[..self.len].iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_parted_into_channels_and_what_is_not_finite_is_seen() {
        let mut patch = Patch::default();
        for round in 0..2 {
            patch.clear();
            for row in 0..7 {
                let pixels: Vec<[f32; 3]> = (0..5 + row)
                    .map(|i| [0.0, 100.0, 200.0].map(|c| c + (10 * row + i) as f32))
                    .collect();
                patch.extend(&pixels);
            }
            assert_eq!(patch.len(), (5..12).sum::<usize>());
            assert_eq!(patch.channel(2)[5], 210.0, "{round}");
            assert_eq!(patch.channel(0)[4], 4.0);
            assert!(patch.is_finite());
        }
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -f32::NAN] {
            let mut patch = Patch::default();
            patch.extend(&[[1.0; 3], [-f32::MAX, bad, 0.0]]);
            assert!(!patch.is_finite());
            assert_eq!(patch.values().filter(|v| !v.is_finite()).count(), 1);
        }
    }
}
