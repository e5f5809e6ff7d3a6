//! The container of RGL's files: named fields of numbers, little-endian, each at an offset of its own.
//!
//! `tensor_file\0`, version 1.0, the number of fields; of each its name, dimensions, type, offset and shape.

use crate::{FileError, write_whole};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

/// What every such file begins with.
pub const MAGIC: &[u8] = b"tensor_file\0";
const BYTES: u8 = 1;
const FLOATS: u8 = 10;
/// Data are aligned to this many bytes.
const ALIGNED: usize = 8;

/// One field.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Its size along each dimension, the slowest first.
    pub shape: Vec<usize>,
    /// Its numbers.
    pub data: Data,
}

/// The numbers of a field.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// Text, or a flag.
    Bytes(Vec<u8>),
    /// 32-bit floats.
    Floats(Vec<f32>),
    /// Of a type that is not used here: how many bytes one number takes.
    Other(usize),
}

impl Field {
    /// A field of floats.
    pub fn of_floats(shape: &[usize], floats: Vec<f32>) -> Self {
        Self {
            shape: shape.to_vec(),
            data: Data::Floats(floats),
        }
    }

    /// A field of bytes.
    pub fn of_bytes(bytes: &[u8]) -> Self {
        Self {
            shape: vec![bytes.len()],
            data: Data::Bytes(bytes.to_vec()),
        }
    }
}

/// Reads all fields of a file.
///
/// # Errors
/// When it cannot be read, or is cut short.
pub fn read_tensor_file(path: &Path) -> Result<BTreeMap<String, Field>, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    fields_of(&bytes).ok_or_else(|| {
        FileError::new(
            path,
            "is no whole tensor file: a field is cut short, or claims more than there is",
            "copy the file again",
        )
    })
}

fn fields_of(bytes: &[u8]) -> Option<BTreeMap<String, Field>> {
    let mut header = Bytes(bytes.strip_prefix(MAGIC)?);
    let [_major, _minor] = header.take()?;
    let count = u32::from_le_bytes(header.take()?);
    let mut fields = BTreeMap::new();
    for _ in 0..count {
        let length = u16::from_le_bytes(header.take()?);
        let name = String::from_utf8_lossy(header.slice(length.into())?).into_owned();
        let dimensions = u16::from_le_bytes(header.take()?);
        let [kind] = header.take()?;
        let offset = usize::try_from(u64::from_le_bytes(header.take()?)).ok()?;
        let mut shape = Vec::new();
        for _ in 0..dimensions {
            shape.push(usize::try_from(u64::from_le_bytes(header.take()?)).ok()?);
        }
        let numbers = shape
            .iter()
            .try_fold(1usize, |n, side| n.checked_mul(*side))?;
        let size = size_of_kind(kind)?;
        let data = bytes.get(offset..)?.get(..numbers.checked_mul(size)?)?;
        let data = match kind {
            BYTES => Data::Bytes(data.to_vec()),
            FLOATS => {
                let (words, _) = data.as_chunks::<4>();
                Data::Floats(words.iter().map(|w| f32::from_le_bytes(*w)).collect())
            }
            _ => Data::Other(size),
        };
        fields.insert(name, Field { shape, data });
    }
    Some(fields)
}

/// Bytes of a number: 1 u8, 2 i8, 3 u16 … 8 i64, 9 f16, 10 f32, 11 f64.
fn size_of_kind(kind: u8) -> Option<usize> {
    Some(match kind {
        1 | 2 => 1,
        3 | 4 | 9 => 2,
        5 | 6 | 10 => 4,
        7 | 8 | 11 => 8,
        _ => return None,
    })
}

/// Writes fields whole, in the order of their names.
///
/// # Errors
/// When the file cannot be written.
pub fn write_tensor_file(path: &Path, fields: &BTreeMap<String, Field>) -> Result<(), FileError> {
    let head =
        |(name, field): (&String, &Field)| 2 + name.len() + 2 + 1 + 8 + 8 * field.shape.len();
    let mut offset = MAGIC.len() + 2 + 4 + fields.iter().map(head).sum::<usize>();
    let mut offsets = Vec::new();
    for field in fields.values() {
        offset = offset.next_multiple_of(ALIGNED);
        offsets.push(offset);
        offset += match &field.data {
            Data::Bytes(bytes) => bytes.len(),
            Data::Floats(floats) => 4 * floats.len(),
            Data::Other(_) => 0,
        };
    }
    write_whole(path, |out| {
        let mut written = 0;
        let mut put = |out: &mut dyn Write, bytes: &[u8]| {
            written += bytes.len();
            out.write_all(bytes)?;
            Ok::<usize, std::io::Error>(written)
        };
        put(out, MAGIC)?;
        put(out, &[1, 0])?;
        put(out, &(fields.len() as u32).to_le_bytes())?;
        for ((name, field), offset) in fields.iter().zip(&offsets) {
            put(out, &(name.len() as u16).to_le_bytes())?;
            put(out, name.as_bytes())?;
            put(out, &(field.shape.len() as u16).to_le_bytes())?;
            put(out, &[kind_of(field)])?;
            put(out, &(*offset as u64).to_le_bytes())?;
            for side in &field.shape {
                put(out, &(*side as u64).to_le_bytes())?;
            }
        }
        for ((_, field), offset) in fields.iter().zip(&offsets) {
            let at = put(out, &[])?;
            put(out, &vec![0; offset - at])?;
            match &field.data {
                Data::Bytes(bytes) => {
                    put(out, bytes)?;
                }
                Data::Floats(floats) => {
                    for float in floats {
                        put(out, &float.to_le_bytes())?;
                    }
                }
                Data::Other(_) => {}
            }
        }
        Ok(())
    })
}

fn kind_of(field: &Field) -> u8 {
    match field.data {
        Data::Floats(_) => FLOATS,
        Data::Bytes(_) | Data::Other(_) => BYTES,
    }
}

/// What is left to read.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*head)
    }

    fn slice(&mut self, length: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(head)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_come_back_and_cut_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.bsdf");
        let floats = (0..6).map(|k| k as f32).collect();
        let fields = BTreeMap::from([
            ("description".to_owned(), Field::of_bytes(b"velvet")),
            ("rgb".to_owned(), Field::of_floats(&[2, 1, 3], floats)),
        ]);
        write_tensor_file(&path, &fields).unwrap();
        assert_eq!(read_tensor_file(&path).unwrap(), fields);
        let bytes = std::fs::read(&path).unwrap();
        for length in 0..bytes.len() {
            assert_eq!(fields_of(&bytes[..length]), None, "{length}");
        }
        // A field that claims 2^64 numbers.
        let mut claims = bytes.clone();
        let shape = MAGIC.len() + 6 + 2 + 11 + 2 + 1 + 8;
        claims[shape..shape + 8].fill(0xff);
        assert_eq!(fields_of(&claims), None);
    }
}
