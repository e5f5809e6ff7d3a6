//! The header of `.npy` files: plain arrays of plain numbers, in C order.
//!
//! Our own few lines rather than a crate's, because the header comes from outside: a length or a
//! shape that is absurd must cost neither memory nor a panic.

use crate::{FileError, write_whole};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;

/// The longest header that is read; numpy's own are 118 bytes.
const MAX_HEADER: usize = 1 << 16;

/// An array whose header was read and whose rows come next.
pub(super) struct NpyArray {
    pub shape: Vec<u64>,
    pub data: BufReader<File>,
}

/// Opens an array of a type (`<f4`), in C order, whose promised bytes are all there.
pub(super) fn open(path: &Path, dtype: &str, element_bytes: u64) -> Result<NpyArray, FileError> {
    let failed = |error: io::Error| FileError::reading(path, &error);
    let file = File::open(path).map_err(failed)?;
    let file_len = file.metadata().map_err(failed)?.len();
    let mut data = BufReader::with_capacity(1 << 18, file);
    let (header, header_len) = header_text(&mut data).map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData => not_npy(path),
        _ => failed(error),
    })?;

    let found = quoted(value_of(&header, "descr").ok_or_else(|| not_npy(path))?);
    if found != dtype {
        return Err(FileError::new(
            path,
            format_args!("holds {found}, not {dtype}"),
            format_args!("save it as numpy.dtype(\"{dtype}\")"),
        ));
    }
    if !value_of(&header, "fortran_order").is_some_and(|value| value.starts_with("False")) {
        return Err(FileError::new(
            path,
            "is in Fortran order",
            "save numpy.ascontiguousarray of it",
        ));
    }
    let shape = value_of(&header, "shape")
        .and_then(tuple)
        .ok_or_else(|| not_npy(path))?;
    // Checked before anything is allocated.
    let promised = shape
        .iter()
        .try_fold(element_bytes, |bytes, side| bytes.checked_mul(*side))
        .and_then(|bytes| bytes.checked_add(header_len));
    if promised.is_none_or(|bytes| bytes > file_len) {
        return Err(FileError::new(
            path,
            format_args!("is cut short: its header promises {}", shape_text(&shape)),
            "copy or make it again",
        ));
    }
    Ok(NpyArray { shape, data })
}

/// Writes an array whole; `fill` writes its elements.
pub(super) fn write(
    path: &Path,
    dtype: &str,
    shape: &[usize],
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), FileError> {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if sides.len() == 1 { "," } else { "" };
    let mut header = format!(
        "{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({}{comma}), }}",
        sides.join(", ")
    );
    // Magic, version and length take ten bytes; the whole is a multiple of 64 and ends in a newline.
    let padding = 63 - (10 + header.len()) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    write_whole(path, |out| {
        out.write_all(b"\x93NUMPY\x01\x00")?;
        out.write_all(&(header.len() as u16).to_le_bytes())?;
        out.write_all(header.as_bytes())?;
        fill(out)
    })
}

/// A shape as people write it.
pub(super) fn shape_text(shape: &[u64]) -> String {
    let sides: Vec<String> = shape.iter().map(u64::to_string).collect();
    sides.join(" × ")
}

/// The dictionary in front of the data, and the number of bytes up to the data.
fn header_text(reader: &mut impl Read) -> io::Result<(String, u64)> {
    let invalid = || io::Error::from(io::ErrorKind::InvalidData);
    let mut start = [0u8; 8];
    reader.read_exact(&mut start)?;
    if &start[..6] != b"\x93NUMPY" {
        return Err(invalid());
    }
    let (len, before) = if start[6] == 1 {
        let mut len = [0u8; 2];
        reader.read_exact(&mut len)?;
        (usize::from(u16::from_le_bytes(len)), 10)
    } else {
        let mut len = [0u8; 4];
        reader.read_exact(&mut len)?;
        (u32::from_le_bytes(len) as usize, 12)
    };
    if len > MAX_HEADER {
        return Err(invalid());
    }
    let mut text = vec![0u8; len];
    reader.read_exact(&mut text)?;
    let text = String::from_utf8(text).map_err(|_| invalid())?;
    Ok((text, before + len as u64))
}

/// What stands after a key of the dictionary, to its end.
fn value_of<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let after = [format!("'{key}'"), format!("\"{key}\"")]
        .iter()
        .find_map(|quoted| Some(&header[header.find(quoted)? + quoted.len()..]))?;
    Some(after.trim_start().strip_prefix(':')?.trim_start())
}

/// The text between the quotes at the beginning, or up to the comma where there are none.
fn quoted(value: &str) -> &str {
    match value.chars().next() {
        Some(quote @ ('\'' | '"')) => value[1..].split(quote).next().unwrap_or_default(),
        _ => value.split(", '").next().unwrap_or_default(),
    }
}

fn tuple(value: &str) -> Option<Vec<u64>> {
    let inside = value.strip_prefix('(')?.split(')').next()?;
    inside
        .split(',')
        .map(str::trim)
        .filter(|side| !side.is_empty())
        .map(|side| side.parse().ok())
        .collect()
}

fn not_npy(path: &Path) -> FileError {
    FileError::new(path, "is not a .npy file", "save it with numpy.save")
}
