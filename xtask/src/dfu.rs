//! Files for `dfu-util` and ST's programmer: DfuSe, version 1 (ST's UM0391), with the suffix of the USB DFU
//! standard 1.1.

use crate::load::Part;
use anyhow::{Result, bail};

/// ST's ROM in DFU mode.
const VENDOR: u16 = 0x0483;
const PRODUCT: u16 = 0xDF11;
/// What the suffix calls this format.
const DFUSE: u16 = 0x011A;
const PREFIX_LEN: usize = 11;
const TARGET_LEN: usize = 274;
const SUFFIX_LEN: usize = 16;

/// A file that writes these parts and leaves everything between them alone.
pub fn file(name: &str, parts: &[Part]) -> Result<Vec<u8>> {
    let elements: usize = parts.iter().map(|part| 8 + part.bytes.len()).sum();
    let Some(room) = 255usize.checked_sub(name.len()).filter(|&room| room > 0) else {
        bail!("{name}: longer than 254 bytes");
    };
    let mut file = Vec::new();
    file.extend(b"DfuSe\x01");
    file.extend(number(PREFIX_LEN + TARGET_LEN + elements)?);
    file.push(1);
    // Alternate setting 0: the flash. With a name.
    file.extend(b"Target\x00");
    file.extend(1u32.to_le_bytes());
    file.extend(name.as_bytes());
    file.extend(std::iter::repeat_n(0, room));
    file.extend(number(elements)?);
    file.extend(number(parts.len())?);
    for part in parts {
        file.extend(part.address.to_le_bytes());
        file.extend(number(part.bytes.len())?);
        file.extend(&part.bytes);
    }
    file.extend(0xFFFFu16.to_le_bytes());
    for half in [PRODUCT, VENDOR, DFUSE] {
        file.extend(half.to_le_bytes());
    }
    file.extend(b"UFD");
    file.push(SUFFIX_LEN as u8);
    file.extend(crc(&file).to_le_bytes());
    Ok(file)
}

fn number(value: usize) -> Result<[u8; 4]> {
    Ok(u32::try_from(value)?.to_le_bytes())
}

/// CRC-32 as the suffix has it: not inverted at its end.
fn crc(bytes: &[u8]) -> u32 {
    bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            let shifted = crc >> 1;
            if crc & 1 == 1 {
                shifted ^ 0xEDB8_8320
            } else {
                shifted
            }
        })
    })
}

/// Reads such a file: what it writes, where. Checks every length, the suffix and its CRC.
pub fn parts_of(file: &[u8]) -> Result<Vec<Part>> {
    let Some((body, suffix)) = file.split_last_chunk::<SUFFIX_LEN>() else {
        bail!("shorter than its suffix");
    };
    let crc_is = u32::from_le_bytes([suffix[12], suffix[13], suffix[14], suffix[15]]);
    if &suffix[8..12] != b"UFD\x10" || crc_is != crc(&file[..file.len() - 4]) {
        bail!("no DFU suffix, or its CRC is wrong");
    }
    let word = |at: usize| crate::size::word(body, at);
    let is_dfuse = body.starts_with(b"DfuSe\x01") && body.get(11..17) == Some(b"Target");
    if !is_dfuse || word(6)? as usize != body.len() {
        bail!("no DfuSe file, or its length is wrong");
    }
    let (mut at, count) = (PREFIX_LEN + TARGET_LEN, word(PREFIX_LEN + 270)?);
    let mut parts = Vec::new();
    for _ in 0..count {
        let (address, length) = (word(at)?, word(at + 4)? as usize);
        let Some(bytes) = body.get(at + 8..at + 8 + length) else {
            bail!("an element is cut short");
        };
        at += 8 + length;
        let bytes = bytes.to_vec();
        parts.push(Part { address, bytes });
    }
    if at != body.len() || word(PREFIX_LEN + 266)? as usize != at - PREFIX_LEN - TARGET_LEN {
        bail!("its elements do not fill it");
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::tests::part;

    #[test]
    fn a_file_is_what_the_formats_say_byte_by_byte() {
        let parts = [part(0x0800_0000, &[1, 2, 3, 4]), part(0x0800_C000, &[5])];
        let file = file("a", &parts).unwrap();
        assert_eq!(&file[..11], b"DfuSe\x01\x32\x01\0\0\x01");
        assert_eq!(&file[11..23], b"Target\0\x01\0\0\0a");
        assert_eq!(
            &file[277..293],
            &[21, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 8, 4, 0, 0, 0]
        );
        let suffix = &file[file.len() - 16..];
        assert_eq!(&suffix[..12], b"\xFF\xFF\x11\xDF\x83\x04\x1A\x01UFD\x10");
        assert_eq!(parts_of(&file).unwrap(), parts);
    }

    #[test]
    fn the_crc_is_that_of_the_standard() {
        // CRC-32 of these digits is 0xCBF43926 once it is inverted.
        assert_eq!(!crc(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn any_byte_that_is_changed_or_missing_is_noticed() {
        let file = file("name", &[part(0x0800_8000, b"image")]).unwrap();
        for at in 0..file.len() {
            let mut bent = file.clone();
            bent[at] ^= 4;
            assert!(parts_of(&bent).is_err(), "byte {at}");
            assert!(parts_of(&file[..at]).is_err(), "{at} bytes");
        }
    }
}
