//! How a camera's counts lie in the bytes that it sends.

use crate::sensor::Bayer;

/// A pixel format: one count a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelFormat {
    /// The colour filters, if it has any.
    pub bayer: Option<Bayer>,
    /// Bits of a count.
    pub bits: u32,
    /// How counts lie in bytes.
    packing: Packing,
}

/// How counts lie in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    /// Each in one or two bytes of its own, the lower first.
    Whole,
    /// One after another from the lowest bit on (`…p` of the Pixel Format Naming Convention).
    Stream,
    /// Two in three bytes, the lower bits of both in the middle one (`…Packed` of GigE Vision).
    Pairs,
}

impl PixelFormat {
    /// By the name that GenICam has for it; `None` for any other.
    pub fn named(name: &str) -> Option<Self> {
        let filters = [
            ("Mono", None),
            ("BayerRG", Some(Bayer::Rggb)),
            ("BayerBG", Some(Bayer::Bggr)),
            ("BayerGR", Some(Bayer::Grbg)),
            ("BayerGB", Some(Bayer::Gbrg)),
        ];
        let (bayer, rest) = filters
            .into_iter()
            .find_map(|(prefix, bayer)| Some((bayer, name.strip_prefix(prefix)?)))?;
        let (packing, bits) = match rest {
            "8" => (Packing::Whole, 8),
            "10" => (Packing::Whole, 10),
            "12" => (Packing::Whole, 12),
            "14" => (Packing::Whole, 14),
            "16" => (Packing::Whole, 16),
            "10p" => (Packing::Stream, 10),
            "12p" => (Packing::Stream, 12),
            "14p" => (Packing::Stream, 14),
            "10Packed" => (Packing::Pairs, 10),
            "12Packed" => (Packing::Pairs, 12),
            _ => return None,
        };
        Some(Self {
            bayer,
            bits,
            packing,
        })
    }

    /// Bytes of so many pixels.
    pub fn bytes_of(self, pixels: usize) -> usize {
        let bits = match self.packing {
            Packing::Whole => self.bits.next_multiple_of(8),
            Packing::Stream => self.bits,
            Packing::Pairs => 12,
        };
        (pixels * bits as usize).div_ceil(8)
    }

    /// The most counts there are.
    pub fn white_counts(self) -> u16 {
        (u32::from(u16::MAX) >> (16 - self.bits)) as u16
    }

    /// The counts of so many pixels; `None` where the bytes are not as many as they take.
    pub fn counts(self, bytes: &[u8], pixels: usize) -> Option<Vec<u16>> {
        if bytes.len() != self.bytes_of(pixels) {
            return None;
        }
        let byte = |k: usize| u32::from(bytes.get(k).copied().unwrap_or(0));
        let white = u32::from(self.white_counts());
        let count = |pixel: usize| match self.packing {
            Packing::Whole if self.bits == 8 => byte(pixel),
            Packing::Whole => byte(2 * pixel) | byte(2 * pixel + 1) << 8,
            Packing::Stream => {
                let bit = pixel * self.bits as usize;
                let (k, shift) = (bit / 8, bit % 8);
                ((byte(k) | byte(k + 1) << 8 | byte(k + 2) << 16) >> shift) & white
            }
            Packing::Pairs => {
                let first = pixel / 2 * 3;
                let low_bits = self.bits - 8;
                let low = byte(first + 1) >> (4 * (pixel % 2));
                byte(first + 2 * (pixel % 2)) << low_bits | low & ((1 << low_bits) - 1)
            }
        };
        Some((0..pixels).map(|pixel| count(pixel) as u16).collect())
    }

    /// The bytes that a camera of this format sends for these counts.
    pub fn bytes(self, counts: &[u16]) -> Vec<u8> {
        let mut bytes = vec![0u8; self.bytes_of(counts.len())];
        let mut put = |k: usize, value: u32| {
            if let Some(byte) = bytes.get_mut(k) {
                *byte |= value as u8;
            }
        };
        for (pixel, count) in counts.iter().enumerate() {
            let count = u32::from(*count);
            match self.packing {
                Packing::Whole if self.bits == 8 => put(pixel, count),
                Packing::Whole => {
                    put(2 * pixel, count);
                    put(2 * pixel + 1, count >> 8);
                }
                Packing::Stream => {
                    let bit = pixel * self.bits as usize;
                    let shifted = count << (bit % 8);
                    for k in 0..3 {
                        put(bit / 8 + k, shifted >> (8 * k));
                    }
                }
                Packing::Pairs => {
                    let (first, low_bits) = (pixel / 2 * 3, self.bits - 8);
                    put(first + 2 * (pixel % 2), count >> low_bits);
                    put(
                        first + 1,
                        (count & ((1 << low_bits) - 1)) << (4 * (pixel % 2)),
                    );
                }
            }
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_have_a_pattern_bits_and_bytes() {
        let read =
            |name| PixelFormat::named(name).map(|f| (f.bayer, f.bytes_of(100), f.white_counts()));
        assert_eq!(read("Mono8"), Some((None, 100, 255)));
        assert_eq!(read("BayerGB12"), Some((Some(Bayer::Gbrg), 200, 4095)));
        assert_eq!(read("Mono16"), Some((None, 200, 65_535)));
        assert_eq!(read("BayerRG12p"), Some((Some(Bayer::Rggb), 150, 4095)));
        assert_eq!(read("Mono10p"), Some((None, 125, 1023)));
        assert_eq!(read("Mono10Packed"), Some((None, 150, 1023)));
        for other in [
            "Mono12q",
            "RGB8",
            "BayerRG",
            "Mono9",
            "mono8",
            "Mono14Packed",
            "Mono8p",
        ] {
            assert_eq!(read(other), None, "{other}");
        }
    }

    #[test]
    fn packed_counts_lie_where_the_conventions_say() {
        let two = [
            ("Mono12p", [0xabc, 0x123], vec![0xbc, 0x3a, 0x12]),
            ("Mono12Packed", [0xabc, 0x123], vec![0xab, 0x3c, 0x12]),
            ("Mono10Packed", [0x2ab, 0x155], vec![0xaa, 0x13, 0x55]),
            ("Mono10p", [0x2ab, 0x155], vec![0xab, 0x56, 0x05]),
            ("Mono16", [0xabcd, 0x0102], vec![0xcd, 0xab, 0x02, 0x01]),
        ];
        for (name, counts, bytes) in two {
            let format = PixelFormat::named(name).unwrap();
            assert_eq!(format.bytes(&counts), bytes, "{name}");
            assert_eq!(format.counts(&bytes, 2).unwrap(), counts, "{name}");
        }
    }

    #[test]
    fn every_format_gives_back_an_odd_number_of_counts_and_takes_no_other_number_of_bytes() {
        for bits in [
            "8", "10", "12", "14", "16", "10p", "12p", "14p", "10Packed", "12Packed",
        ] {
            let format = PixelFormat::named(&format!("Mono{bits}")).unwrap();
            let counts: Vec<u16> = (0..37u32)
                .map(|k| (k * 40_503 % (u32::from(format.white_counts()) + 1)) as u16)
                .collect();
            let mut bytes = format.bytes(&counts);
            assert_eq!(format.counts(&bytes, 37).unwrap(), counts, "{bits}");
            bytes.push(0);
            assert_eq!(format.counts(&bytes, 37), None, "{bits}");
        }
    }
}
