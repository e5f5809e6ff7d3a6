//! A TMC2209's datagrams (data sheet rev. 1.09, chapter 4): a byte for synchronisation, by which the chip finds the
//! baud, its address, the register (highest bit set for a write), four bytes of data, highest first, and a CRC.

use super::Garbled;
use crate::hardware::DriverBytes;

const SYNC: u8 = 0x05;
/// An answer is addressed to the master.
const MASTER: u8 = 0xFF;
/// In the register's byte of a write.
const WRITE: u8 = 0x80;
/// Bytes of an answer.
pub const ANSWER_LEN: usize = 8;

/// The CRC over bytes that are sent lowest bit first: x⁸ + x² + x + 1 (section 4.2).
pub fn crc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc, |crc: u8, bit| {
            let differs = crc >> 7 ^ (byte >> bit & 1);
            (crc << 1) ^ (differs * 0x07)
        })
    })
}

/// Asks for a register.
pub fn read(address: u8, register: u8) -> DriverBytes {
    with_crc(&[SYNC, address, register & !WRITE])
}

/// Writes a register. There is no answer; the register IFCNT counts.
pub fn write(address: u8, register: u8, value: u32) -> DriverBytes {
    datagram(address, register | WRITE, value)
}

/// What a chip answers: for one that is simulated.
pub fn answer(register: u8, value: u32) -> DriverBytes {
    datagram(MASTER, register, value)
}

fn datagram(address: u8, register: u8, value: u32) -> DriverBytes {
    let [a, b, c, d] = value.to_be_bytes();
    with_crc(&[SYNC, address, register, a, b, c, d])
}

fn with_crc(bytes: &[u8]) -> DriverBytes {
    // Seven bytes at most: they fit, and so does the CRC.
    bytes.iter().copied().chain([crc(bytes)]).collect()
}

/// The register's value in an answer.
pub fn value(register: u8, answer: &[u8]) -> Result<u32, Garbled> {
    match *answer {
        [SYNC, MASTER, of, a, b, c, d, check]
            if of == register && check == crc(&answer[..ANSWER_LEN - 1]) =>
        {
            Ok(u32::from_be_bytes([a, b, c, d]))
        }
        _ => Err(Garbled),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::registers::{GCONF, IHOLD_IRUN, IOIN_2209};

    /// The remainder of a long division of the bits in the order in which they are sent, eight zeros behind them,
    /// by 1 0000 0111.
    fn by_division(bytes: &[u8]) -> u8 {
        let bits = bytes
            .iter()
            .flat_map(|byte| (0..8).map(move |bit| byte >> bit & 1));
        let mut rest = 0u16;
        for bit in bits.chain([0; 8]) {
            rest = rest << 1 | u16::from(bit);
            if rest & 0x100 != 0 {
                rest ^= 0x107;
            }
        }
        rest as u8
    }

    #[test]
    fn the_crc_is_the_remainder_of_the_data_sheets_division() {
        for bytes in [
            &[0x05, 0x00, 0x06][..],
            &[0x05, 0x03, 0x80, 0, 0, 1, 0xC4],
            &[0x05, 0xFF, 0x6F, 0xC0, 0x01, 0, 0],
        ] {
            assert_eq!(crc(bytes), by_division(bytes), "{bytes:02x?}");
        }
        // Published by many users of the chip: the request for GCONF of address 0 ends with 0x48.
        assert_eq!(read(0, GCONF)[..], [0x05, 0, 0, 0x48]);
    }

    #[test]
    fn datagrams_are_laid_out_as_the_data_sheet_has_them() {
        let request = write(2, IHOLD_IRUN, 0x0008_1F10);
        assert_eq!(request[..7], [0x05, 2, 0x90, 0x00, 0x08, 0x1F, 0x10]);
        assert_eq!(request[7], by_division(&request[..7]));
        let answer = answer(IOIN_2209, 0x2100_0041);
        assert_eq!(answer[..7], [0x05, 0xFF, 0x06, 0x21, 0, 0, 0x41]);
        assert_eq!(value(IOIN_2209, &answer), Ok(0x2100_0041));
    }

    #[test]
    fn every_flipped_bit_every_shorter_answer_and_another_register_are_found() {
        let good = answer(IOIN_2209, 0x2100_0041);
        for i in 0..8 * ANSWER_LEN {
            let mut bent = good.clone();
            bent[i / 8] ^= 1 << (i % 8);
            assert_eq!(value(IOIN_2209, &bent), Err(Garbled), "bit {i}");
        }
        for length in 0..ANSWER_LEN {
            assert_eq!(value(IOIN_2209, &good[..length]), Err(Garbled));
        }
        assert_eq!(value(GCONF, &good), Err(Garbled));
        // The request's own echo is no answer.
        assert_eq!(value(GCONF, &write(0, GCONF, 1)), Err(Garbled));
    }
}
