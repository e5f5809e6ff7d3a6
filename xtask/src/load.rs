//! What of an ELF file goes into a chip's flash, and where.

use crate::size::{half, word};
use anyhow::{Context, Result, bail};

/// A run of bytes at an address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Of its first byte.
    pub address: u32,
    /// As they lie in flash.
    pub bytes: Vec<u8>,
}

impl Part {
    /// The address behind its last byte.
    pub fn end(&self) -> u64 {
        u64::from(self.address) + self.bytes.len() as u64
    }
}

const LOAD: u32 = 1;

/// The loaded parts of a 32-bit little-endian ELF file, by their load addresses, in order.
pub fn parts(elf: &[u8]) -> Result<Vec<Part>> {
    if elf.get(..6) != Some(&[0x7F, b'E', b'L', b'F', 1, 1]) {
        bail!("no ELF header of 32 bits, little endian");
    }
    let (table, entry, count) = (word(elf, 28)? as usize, half(elf, 42)?, half(elf, 44)?);
    let mut parts = Vec::new();
    for i in 0..usize::from(count) {
        let at = table + i * usize::from(entry);
        let (kind, offset) = (word(elf, at)?, word(elf, at + 4)? as usize);
        let (address, length) = (word(elf, at + 12)?, word(elf, at + 16)? as usize);
        if kind != LOAD || length == 0 {
            continue;
        }
        let bytes = offset
            .checked_add(length)
            .and_then(|end| elf.get(offset..end));
        let bytes = bytes.context("cut short")?.to_vec();
        parts.push(Part { address, bytes });
    }
    parts.sort_by_key(|part| part.address);
    Ok(joined(parts))
}

/// Parts that follow each other within a word become one.
fn joined(parts: Vec<Part>) -> Vec<Part> {
    let mut joined: Vec<Part> = Vec::new();
    for part in parts {
        match joined.last_mut() {
            Some(last) if u64::from(part.address).wrapping_sub(last.end()) < 8 => {
                let gap = (u64::from(part.address) - last.end()) as usize;
                last.bytes.extend(std::iter::repeat_n(0xFF, gap));
                last.bytes.extend(part.bytes);
            }
            _ => joined.push(part),
        }
    }
    joined
}

/// All parts as one run, erased flash (0xFF) between them.
pub fn flat(parts: &[Part]) -> Result<Part> {
    let first = parts.first().context("nothing to load")?;
    let mut whole = Part {
        address: first.address,
        bytes: Vec::new(),
    };
    for part in parts {
        let gap = u64::from(part.address).checked_sub(whole.end());
        let gap = gap.context("two parts at one address")? as usize;
        whole.bytes.extend(std::iter::repeat_n(0xFF, gap));
        whole.bytes.extend(&part.bytes);
    }
    Ok(whole)
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// An ELF file with these parts.
    pub fn elf(parts: &[Part]) -> Vec<u8> {
        let mut elf = vec![0x7F, b'E', b'L', b'F', 1, 1];
        elf.resize(52, 0);
        elf[28..32].copy_from_slice(&52u32.to_le_bytes());
        elf[42..44].copy_from_slice(&32u16.to_le_bytes());
        elf[44..46].copy_from_slice(&(parts.len() as u16).to_le_bytes());
        let mut offset = 52 + 32 * parts.len();
        for part in parts {
            let length = part.bytes.len() as u32;
            // The address at which it runs is another one.
            for word in [
                LOAD,
                offset as u32,
                0x2000_0000,
                part.address,
                length,
                length,
                5,
                4,
            ] {
                elf.extend(word.to_le_bytes());
            }
            offset += part.bytes.len();
        }
        for part in parts {
            elf.extend(&part.bytes);
        }
        elf
    }

    pub fn part(address: u32, bytes: &[u8]) -> Part {
        Part {
            address,
            bytes: bytes.to_vec(),
        }
    }

    #[test]
    fn parts_come_by_their_load_addresses_and_neighbours_are_joined() {
        let written = [part(0x0800_C000, b"code"), part(0x0800_0000, b"table")];
        let read = parts(&elf(&written)).unwrap();
        assert_eq!(read, [written[1].clone(), written[0].clone()]);
        let near = [part(100, b"ab"), part(104, b"cd")];
        assert_eq!(parts(&elf(&near)).unwrap(), [part(100, b"ab\xFF\xFFcd")]);
        let whole = flat(&read).unwrap();
        assert_eq!((whole.address, whole.bytes.len()), (0x0800_0000, 0xC004));
        assert_eq!(&whole.bytes[..8], b"table\xFF\xFF\xFF");
        assert!(flat(&[part(4, b"abc"), part(6, b"d")]).is_err());
    }

    #[test]
    fn a_file_that_is_cut_short_is_refused() {
        let whole = elf(&[part(0, b"abcd")]);
        for length in 0..whole.len() {
            assert!(parts(&whole[..length]).is_err(), "{length} bytes");
        }
    }
}
