//! Intel HEX: text that every programmer reads.

use crate::load::Part;
use std::fmt::Write;

/// Bytes of a line.
const LINE: usize = 16;

/// These parts as a file, with an address of 32 bits before each 64 kB.
pub fn file(parts: &[Part]) -> String {
    let mut text = String::new();
    let mut high = None;
    for part in parts {
        let mut address = part.address;
        let mut left = part.bytes.as_slice();
        while !left.is_empty() {
            if high != Some(address >> 16) {
                high = Some(address >> 16);
                line(&mut text, 0, 4, &((address >> 16) as u16).to_be_bytes());
            }
            // No line goes on into the next 64 kB.
            let room = 0x1_0000 - (address & 0xFFFF) as usize;
            let (bytes, rest) = left.split_at(left.len().min(LINE).min(room));
            line(&mut text, address as u16, 0, bytes);
            address = address.wrapping_add(bytes.len() as u32);
            left = rest;
        }
    }
    line(&mut text, 0, 1, &[]);
    text
}

fn line(text: &mut String, address: u16, kind: u8, bytes: &[u8]) {
    let [high, low] = address.to_be_bytes();
    let head = [bytes.len() as u8, high, low, kind];
    let sum = head
        .iter()
        .chain(bytes)
        .fold(0u8, |sum, &byte| sum.wrapping_add(byte));
    text.push(':');
    for byte in head.iter().chain(bytes).chain([&sum.wrapping_neg()]) {
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02X}");
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::tests::part;

    #[test]
    fn a_file_is_what_the_format_says() {
        let text = file(&[
            part(0x0800_FFFE, &[1, 2, 3]),
            part(0x0801_0100, &[0xFF; 17]),
        ]);
        let expected = ":020000040800F2\n:02FFFE000102FE\n:020000040801F1\n:0100000003FC\n\
            :10010000FFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFF\n:01011000FFEF\n:00000001FF\n";
        assert_eq!(text, expected);
    }
}
