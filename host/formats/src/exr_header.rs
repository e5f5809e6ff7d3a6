//! The order of attributes in the header of an EXR.
//!
//! The `exr` crate keeps a file's own attributes in a hash map and writes them in its order, which
//! differs from run to run. A header of one image is a magic number, a version, then attributes
//! (name, zero byte, type, zero byte, length as 4 bytes, value) and a zero byte. Sorting them by name
//! keeps the header's length, and with it every offset of the file.

use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};

/// Bytes of the magic number and the version.
const BEFORE: u64 = 8;
/// Bytes read at first; doubled until they hold the header.
const FIRST_READ: usize = 1 << 14;

/// Sorts the attributes of a file of one image that has its header already; the place for the next
/// byte stays where it is.
///
/// # Errors
/// When the file cannot be read or written.
pub(super) fn sort_attributes(out: &mut BufWriter<File>) -> io::Result<()> {
    out.flush()?;
    let file = out.get_mut();
    let end = file.stream_position()?;
    let mut bytes = Vec::new();
    let mut wanted = FIRST_READ;
    let sorted = loop {
        file.seek(SeekFrom::Start(BEFORE + bytes.len() as u64))?;
        let missing = (wanted - bytes.len()) as u64;
        let n = Read::by_ref(file).take(missing).read_to_end(&mut bytes)?;
        match sorted(&bytes) {
            Some(sorted) => break sorted,
            None if n == 0 => return Err(io::ErrorKind::InvalidData.into()),
            None => wanted *= 2,
        }
    };
    file.seek(SeekFrom::Start(BEFORE))?;
    file.write_all(&sorted)?;
    file.seek(SeekFrom::Start(end))?;
    Ok(())
}

/// The attributes at the beginning of some bytes, sorted by name; `None` when they go on beyond.
fn sorted(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut rest = bytes;
    let mut attributes = Vec::new();
    while *rest.first()? != 0 {
        let name = rest.iter().position(|byte| *byte == 0)?;
        let kind = name + 1 + rest[name + 1..].iter().position(|byte| *byte == 0)?;
        let (length, _) = rest.get(kind + 1..)?.split_first_chunk::<4>()?;
        let size = kind + 5 + u32::from_le_bytes(*length) as usize;
        let (attribute, after) = rest.split_at_checked(size)?;
        attributes.push((&attribute[..name], attribute));
        rest = after;
    }
    attributes.sort();
    Some(
        attributes
            .into_iter()
            .flat_map(|(_, a)| a)
            .copied()
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_are_sorted_and_a_header_cut_short_is_not() {
        let attribute = |name: &str, value: &str| {
            let mut bytes = format!("{name}\0string\0").into_bytes();
            bytes.extend((value.len() as u32).to_le_bytes());
            bytes.extend(value.bytes());
            bytes
        };
        let (a, b) = (attribute("a", "seven\0"), attribute("bc", ""));
        let header = [&b[..], &a, &[0], b"pixels"].concat();
        assert_eq!(sorted(&header), Some([&a[..], &b].concat()));
        for end in 0..a.len() + b.len() {
            assert_eq!(sorted(&header[..end]), None, "{end}");
        }
    }
}
