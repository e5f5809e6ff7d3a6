//! An absolute ring encoder: clock and data over RS-422, read by an SPI in mode 2 (clock high at rest, data read
//! at its first edge, the falling one).

use embedded_hal::spi::SpiBus;

use crate::hardware::{EncoderKind, EncoderLost, EncoderSetup, EncoderWord};
use crate::{biss, ssi};

/// Bits of the finest ring.
const MOST_BITS: u32 = 26;
/// The encoder needs this long after a word before it latches anew, µs.
const PAUSE_US: u64 = 50;

/// A word, its bits of position, and its bytes.
type Decode = fn(u64, u32, usize) -> Result<EncoderWord, EncoderLost>;

/// One encoder on its SPI.
#[derive(Debug)]
pub struct SpiEncoder<S> {
    spi: S,
    last: Result<EncoderWord, EncoderLost>,
    read_us: Option<u64>,
}

impl<S: SpiBus> SpiEncoder<S> {
    /// An encoder that has not been read.
    pub const fn new(spi: S) -> Self {
        Self {
            spi,
            last: Err(EncoderLost::Silent),
            read_us: None,
        }
    }

    /// The position in counts, of which `setup.turn` are a turn: a power of two, at most 2²⁶. Within the
    /// encoder's pause the last one, which is not older than it.
    pub fn word(&mut self, now_us: u64, setup: EncoderSetup) -> Result<EncoderWord, EncoderLost> {
        if self.read_us.is_none_or(|at| now_us >= at + PAUSE_US) {
            self.last = self.read(setup);
            self.read_us = Some(now_us);
        }
        self.last
    }

    fn read(&mut self, setup: EncoderSetup) -> Result<EncoderWord, EncoderLost> {
        let bits = setup.turn.max(2).ilog2().min(MOST_BITS);
        let (used, decode): (usize, Decode) = match setup.kind {
            EncoderKind::Ssi => (ssi::bytes(bits), ssi::decode),
            EncoderKind::BissC => (biss::bytes(bits), biss::decode),
            EncoderKind::Quadrature => return Err(EncoderLost::Silent),
        };
        let mut word = [0u8; 8];
        let read = self
            .spi
            .read(word.get_mut(..used).ok_or(EncoderLost::Silent)?);
        read.map_err(|_| EncoderLost::Silent)?;
        decode(u64::from_be_bytes(word), bits, used)
    }
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use embedded_hal::spi::ErrorType;

    use super::*;

    /// Answers with words one after the other.
    struct Line<'a>(&'a [u64]);

    impl ErrorType for Line<'_> {
        type Error = Infallible;
    }

    impl SpiBus for Line<'_> {
        fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
            let (word, rest) = self.0.split_first().unwrap();
            self.0 = rest;
            words.copy_from_slice(&word.to_be_bytes()[..words.len()]);
            Ok(())
        }
        fn write(&mut self, _: &[u8]) -> Result<(), Infallible> {
            Ok(())
        }
        fn transfer(&mut self, _: &mut [u8], _: &[u8]) -> Result<(), Infallible> {
            Ok(())
        }
        fn transfer_in_place(&mut self, _: &mut [u8]) -> Result<(), Infallible> {
            Ok(())
        }
        fn flush(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }

    fn encoder(words: &[u64]) -> SpiEncoder<Line<'_>> {
        SpiEncoder::new(Line(words))
    }

    fn ok(counts: u32) -> Result<EncoderWord, EncoderLost> {
        Ok(counts.into())
    }

    fn ring(kind: EncoderKind, bits: u32) -> EncoderSetup {
        EncoderSetup {
            kind,
            turn: 1 << bits,
        }
    }

    /// What a ring of SSI puts on the line, first bit highest.
    fn ssi_word(counts: u64, bits: u32) -> u64 {
        1 << 63 | counts << (63 - bits) | 0b11 << (61 - bits)
    }

    #[test]
    fn a_position_is_told_from_a_bad_one_and_from_no_encoder() {
        let good = |counts| ssi_word(counts, 18);
        let words = [
            good(0),
            good(0x2_5A5A),
            good(0x3_FFFF),
            good(77) & !(1 << 44),
            0,
            0xFFFF_FF00_0000_0000,
        ];
        let mut encoder = encoder(&words);
        let readings =
            [0, 1, 2, 3, 4, 5].map(|i| encoder.word(i * 1000, ring(EncoderKind::Ssi, 18)));
        let lost = Err(EncoderLost::Silent);
        let invalid = Err(EncoderLost::Invalid);
        assert_eq!(
            readings,
            [ok(0), ok(0x2_5A5A), ok(0x3_FFFF), invalid, lost, lost]
        );
    }

    #[test]
    fn a_warning_is_told_and_leaves_the_position_as_it_is() {
        let words = [ssi_word(77, 18) & !(1 << 43)];
        let expected = EncoderWord {
            warns: true,
            ..77.into()
        };
        let word = encoder(&words).word(0, ring(EncoderKind::Ssi, 18));
        assert_eq!(word, Ok(expected));
    }

    #[test]
    fn within_its_pause_the_encoder_is_left_alone() {
        let words = [ssi_word(5, 18), ssi_word(6, 18)];
        let mut encoder = encoder(&words);
        assert_eq!(
            [100, 149, 150].map(|at| encoder.word(at, ring(EncoderKind::Ssi, 18))),
            [ok(5), ok(5), ok(6)]
        );
    }

    #[test]
    fn a_ring_has_as_many_bits_as_the_settings_say() {
        for bits in 10..=26 {
            let highest = (1 << bits) - 1;
            let word = |counts| ssi_word(counts, bits);
            let words = [word(1), word(highest), word(highest) & !(1 << (62 - bits))];
            let mut encoder = encoder(&words);
            assert_eq!(
                [0, 1000, 2000].map(|at| encoder.word(at, ring(EncoderKind::Ssi, bits))),
                [ok(1), ok(highest as u32), Err(EncoderLost::Invalid)],
                "{bits} bits"
            );
        }
    }

    #[test]
    fn the_setting_says_how_a_word_is_read() {
        let word = biss::encode(0x2_5A5A, 18, true, false, (2, 3));
        let words = [word, word];
        let mut encoder = encoder(&words);
        assert_eq!(encoder.word(0, ring(EncoderKind::BissC, 18)), ok(0x2_5A5A));
        // The acknowledgement stands where SSI has its first bits.
        assert_ne!(encoder.word(1000, ring(EncoderKind::Ssi, 18)), ok(0x2_5A5A));
    }
}
