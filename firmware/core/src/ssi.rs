//! A reading by SSI.
//!
//! The data line rests high. The first falling edge of the clock latches the position; each rising
//! edge puts out a bit, most significant first, which is read at the falling edge after it (SPI
//! mode 2). The bits are one that is high, the position, the error bit (low: the position is not valid), the
//! warning bit (low: near its limits), and to the next whole byte some that say nothing. RLS AksIM-2 rings ordered with SSI are of
//! this kind; compare with the data sheet of yours. They follow a clock of 500 kHz, and 50 m of cable one of
//! 400 kHz.

use crate::hardware::{EncoderLost, EncoderWord};

/// Bits around the position: the first one, error and warning; and one behind them, which is low until the ring
/// has had its pause, so that the highest position is never all ones.
const AROUND_BITS: u32 = 4;

/// Bytes of a word with so many bits of position.
pub(crate) fn bytes(bits: u32) -> usize {
    (AROUND_BITS + bits).div_ceil(8) as usize
}

/// A word of so many bytes, first bit highest. A line that is cut or shorted reads all ones or all zeros, and neither
/// is a position.
pub(crate) fn decode(word: u64, bits: u32, bytes: usize) -> Result<EncoderWord, EncoderLost> {
    let (rest, valid, quiet) = (word >> 63, word >> (62 - bits) & 1, word >> (61 - bits) & 1);
    if rest == 0 || word.leading_ones() as usize == 8 * bytes {
        return Err(EncoderLost::Silent);
    }
    if valid == 0 {
        return Err(EncoderLost::Invalid);
    }
    Ok(EncoderWord {
        counts: (word << 1 >> (64 - bits)) as u32,
        warns: quiet == 0,
        index: None,
    })
}
