//! An absolute ring encoder with SSI: clock and data over RS-422, read by an SPI.
//!
//! The data line rests high. The first falling edge of the clock latches the position; each rising
//! edge puts out a bit, most significant first, which is read at the falling edge after it (SPI
//! mode 2). The bits are one that is high, the position, the error bit (low: the position is not valid), the
//! warning bit, and to the next whole byte some that say nothing. RLS AksIM-2 rings ordered with SSI are of
//! this kind; compare with the data sheet of yours. They follow a clock of 500 kHz, and 50 m of cable one of
//! 400 kHz.

use embedded_hal::spi::SpiBus;

use crate::hardware::EncoderLost;

/// Bits of the finest ring.
const MOST_BITS: u32 = 26;
/// Bits around the position: the first one, error and warning.
const AROUND_BITS: u32 = 3;
/// The encoder needs this long after a word before it latches anew, µs.
const PAUSE_US: u64 = 50;

/// One encoder on its SPI.
#[derive(Debug)]
pub struct SsiEncoder<S> {
    spi: S,
    last: Result<u32, EncoderLost>,
    read_us: Option<u64>,
}

impl<S: SpiBus> SsiEncoder<S> {
    /// An encoder that has not been read.
    pub const fn new(spi: S) -> Self {
        Self {
            spi,
            last: Err(EncoderLost),
            read_us: None,
        }
    }

    /// The position in counts, of which `turn` are a turn: a power of two, at most 2²⁶. Within the encoder's
    /// pause the last one, which is not older than it.
    pub fn counts(&mut self, now_us: u64, turn: u32) -> Result<u32, EncoderLost> {
        if self.read_us.is_none_or(|at| now_us >= at + PAUSE_US) {
            let bits = turn.max(2).ilog2().min(MOST_BITS);
            let mut word = [0u8; 4];
            let used = (AROUND_BITS + bits).div_ceil(8) as usize;
            let read = self.spi.read(&mut word[..used]);
            let decoded = decode(u32::from_be_bytes(word), bits, used);
            self.last = read.map_err(|_| EncoderLost).and(decoded);
            self.read_us = Some(now_us);
        }
        self.last
    }
}

/// A line that is cut or shorted reads all ones or all zeros, and neither is a position.
fn decode(word: u32, bits: u32, bytes: usize) -> Result<u32, EncoderLost> {
    let (rest, valid) = (word >> 31, word >> (30 - bits) & 1);
    if rest == 0 || valid == 0 || word.leading_ones() as usize == 8 * bytes {
        return Err(EncoderLost);
    }
    Ok(word << 1 >> (32 - bits))
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use embedded_hal::spi::ErrorType;

    use super::*;

    /// Answers with words one after the other.
    struct Line<'a>(&'a [u32]);

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

    fn encoder(words: &[u32]) -> SsiEncoder<Line<'_>> {
        SsiEncoder::new(Line(words))
    }

    #[test]
    fn a_position_is_told_from_a_bad_one_and_from_no_encoder() {
        let good = |counts: u32| 1 << 31 | counts << 13 | 1 << 12;
        let words = [
            good(0),
            good(0x2_5A5A),
            good(0x3_FFFF),
            good(77) & !(1 << 12),
            0,
            0xFFFF_FF00,
        ];
        let mut encoder = encoder(&words);
        let readings = [0, 1, 2, 3, 4, 5].map(|i| encoder.counts(i * 1000, 1 << 18));
        let lost = Err(EncoderLost);
        assert_eq!(
            readings,
            [Ok(0), Ok(0x2_5A5A), Ok(0x3_FFFF), lost, lost, lost]
        );
    }

    #[test]
    fn within_its_pause_the_encoder_is_left_alone() {
        let word = |counts: u32| 1 << 31 | counts << 13 | 1 << 12;
        let words = [word(5), word(6)];
        let mut encoder = encoder(&words);
        assert_eq!(
            [100, 149, 150].map(|at| encoder.counts(at, 1 << 18)),
            [Ok(5), Ok(5), Ok(6)]
        );
    }

    #[test]
    fn a_ring_has_as_many_bits_as_the_settings_say() {
        for bits in 10..=26 {
            let highest = (1 << bits) - 1;
            let word = |counts: u32| 1 << 31 | counts << (31 - bits) | 1 << (30 - bits);
            let words = [word(1), word(highest), word(highest) & !(1 << (30 - bits))];
            let mut encoder = encoder(&words);
            assert_eq!(
                [0, 1000, 2000].map(|at| encoder.counts(at, 1 << bits)),
                [Ok(1), Ok(highest), Err(EncoderLost)],
                "{bits} bits"
            );
        }
    }
}
