//! A reading by SSI.
//!
//! The data line rests high. The first falling edge of the clock latches the position; each rising
//! edge puts out a bit, most significant first, which is read at the falling edge after it (SPI
//! mode 2). The bits are one that is high, the position, the error bit (low: the position is not valid), the
//! warning bit, and to the next whole byte some that say nothing. RLS AksIM-2 rings ordered with SSI are of
//! this kind; compare with the data sheet of yours. They follow a clock of 500 kHz, and 50 m of cable one of
//! 400 kHz.

use crate::hardware::EncoderLost;

/// Bits around the position: the first one, error and warning.
const AROUND_BITS: u32 = 3;

/// Bytes of a word with so many bits of position.
pub(crate) fn bytes(bits: u32) -> usize {
    (AROUND_BITS + bits).div_ceil(8) as usize
}

/// The position in a word of so many bytes, first bit highest. A line that is cut or shorted reads all ones or
/// all zeros, and neither is a position.
pub(crate) fn decode(word: u64, bits: u32, bytes: usize) -> Result<u32, EncoderLost> {
    let (rest, valid) = (word >> 63, word >> (62 - bits) & 1);
    if rest == 0 || valid == 0 || word.leading_ones() as usize == 8 * bytes {
        return Err(EncoderLost);
    }
    Ok((word << 1 >> (64 - bits)) as u32)
}
