//! A TMC5160's datagrams (data sheet rev. 1.17, chapter 4): 40 bits by SPI mode 3, highest bit first: the register
//! (highest bit set for a write) and four bytes of data, highest first. What comes back while one is sent is a byte
//! of state and the data of the register that the datagram *before* asked for. There is no checksum.

use super::Garbled;
use crate::hardware::DriverBytes;

/// Bytes of a datagram: the select line is low for so many.
pub const DATAGRAM_LEN: usize = 5;
/// In the register's byte of a write.
pub const WRITE: u8 = 0x80;

/// Asks for a register, and asks again to have it.
pub fn read_twice(register: u8) -> DriverBytes {
    let ask = [register & !WRITE, 0, 0, 0, 0];
    // Ten bytes: they fit.
    ask.into_iter().chain(ask).collect()
}

/// Writes a register.
pub fn write(register: u8, value: u32) -> DriverBytes {
    let [a, b, c, d] = value.to_be_bytes();
    [register | WRITE, a, b, c, d].into_iter().collect()
}

/// The value in what the second of two datagrams brought. A line that rests high is no chip; one that is low reads zeros,
/// which some registers hold.
pub fn value(answer: &[u8]) -> Result<u32, Garbled> {
    match *answer.get(DATAGRAM_LEN..).unwrap_or_default() {
        [0xFF, 0xFF, 0xFF, 0xFF, 0xFF] => Err(Garbled),
        [_, a, b, c, d] => Ok(u32::from_be_bytes([a, b, c, d])),
        _ => Err(Garbled),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::registers::{CHOPCONF, GSTAT};

    #[test]
    fn datagrams_are_laid_out_as_the_data_sheet_has_them() {
        // Its quick configuration guide: SPI send 0xEC000100C3.
        assert_eq!(
            write(CHOPCONF, 0x0001_00C3)[..],
            [0xEC, 0x00, 0x01, 0x00, 0xC3]
        );
        assert_eq!(read_twice(GSTAT)[..], [1, 0, 0, 0, 0, 1, 0, 0, 0, 0]);
    }

    #[test]
    fn the_second_datagram_brings_the_value() {
        let answer = [0x09, 1, 2, 3, 4, 0x09, 0x30, 0, 0, 0x41];
        assert_eq!(value(&answer), Ok(0x3000_0041));
        assert_eq!(value(&answer[..9]), Err(Garbled));
        assert_eq!(value(&[0xFF; 10]), Err(Garbled));
        assert_eq!(value(&[]), Err(Garbled));
    }
}
