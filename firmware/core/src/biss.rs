//! A reading by BiSS-C (point to point, single-cycle data), as the public protocol description has it.
//!
//! The line rests high. The ring answers the first clocks by ones; then zeros while it fetches its position (the
//! acknowledgement: one bit or several); a one that starts the word; a zero (the bit for control data); the
//! position, most significant first; the error and the warning bit, both low where they say something; and six
//! bits of CRC over position, error and warning, by the polynomial x⁶ + x + 1, inverted. Data change with the
//! clock's rising edge and are read at the falling one, which is the SPI's mode of SSI (`ssi`). 328 kHz is far
//! below what these rings follow, and no clock stays away as long as their timeout of some 12 µs.

use crate::hardware::{EncoderLost, EncoderWord};

/// Bits of the CRC.
const CRC_BITS: u32 = 6;
/// x⁶ + x + 1 without its highest term.
const POLYNOMIAL: u64 = 0b00_0011;
/// Bits around position and CRC: start, control data, error, warning.
const AROUND_BITS: u32 = 4;
/// Bits that may come before the word's start: ones at rest, and the acknowledgement. At 328 kHz 48 µs, where
/// the slowest rings fetch for 20.
const LEAD_BITS: u32 = 16;

/// Bytes of a word with so many bits of position, however late it starts.
pub(crate) fn bytes(bits: u32) -> usize {
    (LEAD_BITS + AROUND_BITS + bits + CRC_BITS).div_ceil(8) as usize
}

/// A word of so many bytes, first bit highest.
pub(crate) fn decode(word: u64, bits: u32, bytes: usize) -> Result<EncoderWord, EncoderLost> {
    let rest = word.leading_ones();
    // Beyond the bytes that were read there are zeros: a word that has not started has no one.
    let acknowledged = word.checked_shl(rest).unwrap_or(0);
    let lead = rest + acknowledged.leading_zeros();
    let needed = AROUND_BITS + bits + CRC_BITS;
    // A ring that still holds the line low after its last word is not ready.
    if rest == 0 || acknowledged == 0 || lead + needed > 8 * bytes as u32 {
        return Err(EncoderLost::Silent);
    }
    let word = word << lead;
    let control = word >> 62 & 1;
    let checked = word << 2 >> (64 - bits - 2);
    let crc = word << (4 + bits) >> (64 - CRC_BITS);
    if control != 0 || crc != inverted_crc(checked, bits + 2) {
        return Err(EncoderLost::Silent);
    }
    if checked >> 1 & 1 == 0 {
        return Err(EncoderLost::Invalid);
    }
    Ok(EncoderWord {
        counts: (checked >> 2) as u32,
        warns: checked & 1 == 0,
        index: None,
    })
}

/// The CRC of so many bits, as it is sent.
fn inverted_crc(data: u64, bits: u32) -> u64 {
    let mask = (1 << CRC_BITS) - 1;
    let crc = (0..bits).rev().fold(0, |crc: u64, i| {
        let feedback = (crc >> (CRC_BITS - 1) ^ data >> i) & 1;
        (crc << 1 & mask) ^ (feedback * POLYNOMIAL)
    });
    crc ^ mask
}

/// What a ring with this position puts on the line, first bit highest, after so many bits at rest and of
/// acknowledgement.
#[cfg(test)]
pub(crate) fn encode(counts: u32, bits: u32, is_valid: bool, warns: bool, lead: (u32, u32)) -> u64 {
    let (rest, acknowledgement) = lead;
    let checked = u64::from(counts) << 2 | u64::from(is_valid) << 1 | u64::from(!warns);
    let word = 0b10 << (bits + 2) | checked;
    let word = word << CRC_BITS | inverted_crc(checked, bits + 2);
    let ones = (1u64 << rest) - 1;
    let used = 2 + bits + 2 + CRC_BITS;
    let word = word << (64 - used) >> (rest + acknowledgement);
    // The line rests high again behind the word.
    let behind = u64::MAX >> (rest + acknowledgement + used).min(63);
    ones << (64 - rest) | word | behind
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOST: Result<EncoderWord, EncoderLost> = Err(EncoderLost::Silent);

    fn read(word: u64, bits: u32) -> Result<EncoderWord, EncoderLost> {
        let used = bytes(bits);
        decode(word & u64::MAX << (64 - 8 * used), bits, used)
    }

    #[test]
    fn the_crc_is_that_of_published_examples() {
        // Worked by hand, by long division: 1 over x⁶ + x + 1 leaves x⁶ mod p = x + 1.
        assert_eq!(inverted_crc(1, 1), 0b11_1111 ^ 0b00_0011);
        // 10: x·x⁶ = x⁷ leaves x² + x. 1000001: x⁶·x⁶ + x⁶ = (x + 1)² + x + 1 = x² + x.
        assert_eq!(inverted_crc(0b10, 2), 0b11_1111 ^ 0b00_0110);
        assert_eq!(inverted_crc(0b100_0001, 7), 0b11_1111 ^ 0b00_0110);
    }

    #[test]
    fn a_position_of_any_length_is_read_however_late_it_starts() {
        for bits in 10..=26 {
            for counts in [0, 1, 0x15_5555 & ((1 << bits) - 1), (1 << bits) - 1] {
                for lead in [(1, 1), (2, 1), (1, 8), (3, 13)] {
                    let word = encode(counts, bits, true, false, lead);
                    assert_eq!(read(word, bits), Ok(counts.into()), "{bits} bits, {lead:?}");
                }
            }
        }
    }

    #[test]
    fn every_flipped_bit_or_pair_within_the_checked_word_is_found() {
        let lead = (2, 5);
        for bits in [18, 20, 26] {
            let word = encode(0x2_9A5C, bits, true, false, lead);
            let first = lead.0 + lead.1 + 2;
            let checked = first..first + bits + 2 + CRC_BITS;
            for i in checked.clone() {
                let bent = word ^ 1 << (63 - i);
                assert_eq!(read(bent, bits), LOST, "bit {i}");
                for j in i + 1..checked.end {
                    let bent = bent ^ 1 << (63 - j);
                    assert_eq!(read(bent, bits), LOST, "bits {i}, {j}");
                }
            }
        }
    }

    #[test]
    fn no_ring_a_shorted_line_and_a_ring_in_error_are_told_from_a_position() {
        let busy = encode(77, 18, true, false, (2, 1)) << 2;
        let mute = [u64::MAX, 0, 1 << 63, u64::MAX << 40, u64::MAX >> 40, busy];
        for word in mute {
            assert_eq!(read(word, 18), LOST, "{word:#x}");
        }
        let error = encode(77, 18, false, false, (2, 1));
        assert_eq!(read(error, 18), Err(EncoderLost::Invalid));
        // A word that starts so late that its end is not read.
        let late = encode(77, 18, true, false, (2, 21));
        assert_eq!(read(late, 18), LOST);
    }

    #[test]
    fn a_warning_is_told_and_leaves_the_position_as_it_is() {
        let word = encode(77, 18, true, true, (2, 1));
        let expected = EncoderWord {
            warns: true,
            ..77.into()
        };
        assert_eq!(read(word, 18), Ok(expected));
    }
}
