//! `.npy` files: what stands in front of the elements, and writing.
//!
//! Our own few lines rather than a crate's, because the header comes from outside: a length or a
//! shape that is absurd must cost neither memory nor a panic.

use crate::npy_literal::Literal;
use crate::{FileError, write_whole};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;

/// The longest header that is read; numpy's own are 118 bytes.
const MAX_HEADER: usize = 1 << 16;

/// What stands in front of an array's elements.
pub(super) struct NpyHeader {
    /// The type of its elements, as numpy describes it.
    pub descr: Literal,
    /// Whether the first index runs fastest.
    pub fortran_order: bool,
    pub shape: Vec<u64>,
    /// Its own bytes.
    bytes: u64,
}

impl NpyHeader {
    /// Reads it; an error of the kind `InvalidData` where there is none.
    pub fn read(reader: &mut impl Read) -> io::Result<Self> {
        let (text, bytes) = header_text(reader)?;
        let parsed = || {
            let header = Literal::parse(&text)?;
            let Some(Literal::Truth(fortran_order)) = header.get("fortran_order") else {
                return None;
            };
            let Some(Literal::Sequence(sides)) = header.get("shape") else {
                return None;
            };
            let side = |side: &Literal| match side {
                Literal::Number(side) => Some(*side),
                _ => None,
            };
            Some(Self {
                descr: header.get("descr")?.clone(),
                fortran_order: *fortran_order,
                shape: sides.iter().map(side).collect::<Option<_>>()?,
                bytes,
            })
        };
        parsed().ok_or_else(|| io::ErrorKind::InvalidData.into())
    }

    /// Whether a file of this length holds all elements that the header promises. Asked before any
    /// memory is.
    pub fn fits(&self, element_bytes: usize, file_len: u64) -> bool {
        let promised = self
            .shape
            .iter()
            .try_fold(element_bytes as u64, |bytes, side| bytes.checked_mul(*side))
            .and_then(|bytes| bytes.checked_add(self.bytes));
        promised.is_some_and(|bytes| bytes <= file_len)
    }
}

/// An array whose header was read and whose elements come next.
pub(super) struct NpyFile {
    pub header: NpyHeader,
    /// The length of the file.
    pub len: u64,
    pub data: BufReader<File>,
}

impl NpyFile {
    /// Opens an array of any type.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let failed = |error: io::Error| FileError::reading(path, &error);
        let file = File::open(path).map_err(failed)?;
        let len = file.metadata().map_err(failed)?.len();
        let mut data = BufReader::with_capacity(1 << 18, file);
        let header = NpyHeader::read(&mut data).map_err(|error| wrong_header(path, &error))?;
        Ok(Self { header, len, data })
    }
}

/// Opens an array of a type (`|u1`), in C order, whose promised bytes are all there.
pub(super) fn open(path: &Path, dtype: &str, element_bytes: usize) -> Result<NpyFile, FileError> {
    let array = NpyFile::open(path)?;
    let header = &array.header;
    if header.descr != Literal::Text(dtype.to_owned()) {
        return Err(FileError::new(
            path,
            format_args!("holds {}, not {dtype}", header.descr),
            format_args!("save it as numpy.dtype(\"{dtype}\")"),
        ));
    }
    if header.fortran_order {
        return Err(FileError::new(
            path,
            "is in Fortran order",
            "save numpy.ascontiguousarray of it",
        ));
    }
    if !header.fits(element_bytes, array.len) {
        return Err(cut_short(path, &header.shape));
    }
    Ok(array)
}

/// A file that ends before the last element.
pub(super) fn cut_short(path: &Path, shape: &[u64]) -> FileError {
    FileError::new(
        path,
        format_args!("is cut short: its header promises {}", shape_text(shape)),
        "copy or make it again",
    )
}

/// What kept a header from being read.
pub(super) fn wrong_header(path: &Path, error: &io::Error) -> FileError {
    match error.kind() {
        io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData => {
            FileError::new(path, "is not a .npy file", "save it with numpy.save")
        }
        _ => FileError::reading(path, error),
    }
}

/// Writes an array whole; `fill` writes its elements.
pub(super) fn write(
    path: &Path,
    dtype: &str,
    shape: &[usize],
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), FileError> {
    write_elements(path, &format!("'{dtype}'"), shape, fill)
}

/// Writes a list of records whole; `fields` is the list of their names and types as numpy has it.
pub(super) fn write_records(
    path: &Path,
    fields: &str,
    rows: usize,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), FileError> {
    write_elements(path, fields, &[rows], fill)
}

fn write_elements(
    path: &Path,
    descr: &str,
    shape: &[usize],
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), FileError> {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if sides.len() == 1 { "," } else { "" };
    let mut header = format!(
        "{{'descr': {descr}, 'fortran_order': False, 'shape': ({}{comma}), }}",
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
    // UTF-8 from version 3 on, Latin-1 before.
    let text = String::from_utf8(text)
        .unwrap_or_else(|error| error.as_bytes().iter().copied().map(char::from).collect());
    Ok((text, before + len as u64))
}
