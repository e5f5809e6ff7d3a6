//! NetCDF-3 with 64-bit offsets (CDF-2), as the classic format's specification has it: big-endian, every name and
//! value padded to four bytes.

use super::dataset::{AXES, Array, Data, Dataset, PREFIX, VALUES, channels_of, dataset, scale_of};
use super::{ExportFormat, Holds, How, Meaning};
use crate::{FileError, write_whole};
use gonia_brdf::Grid;
use gonia_rig::DenseChannels;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "netcdf",
    title: "NetCDF-3 (CDF-2)",
    ending: "nc",
    readers: "xarray, netCDF4",
    means: Meaning::Stated,
    holds: Holds::Any,
    angles: "the table's, and its uncertainties (`--error`)",
    provenance: Some("attributes `gonia.…`"),
    is_folder: false,
    resolution: None,
    step_deg: |_| 0.0,
    how: How::Table { write, read },
};

const MAGIC: [u8; 4] = *b"CDF\x02";
const DIMENSIONS: u32 = 0x0a;
const VARIABLES: u32 = 0x0b;
const ATTRIBUTES: u32 = 0x0c;
const CHAR: u32 = 2;
const FLOAT: u32 = 5;
const DOUBLE: u32 = 6;
/// Axis of the letters of a channel's name.
const LETTERS: &str = "letter";
/// A variable of this many bytes or more does not fit, but for the last one.
const MOST: u64 = u32::MAX as u64 - 3;

fn write(
    path: &Path,
    dense: &DenseChannels,
    errors: Option<&DenseChannels>,
) -> Result<(), FileError> {
    let data = dataset(dense, errors);
    let n = data.arrays.len();
    let too_large = |array: &Array<'_>| size_of(array, data.shape) >= MOST;
    if data.arrays[..n - 1].iter().any(too_large) {
        return Err(FileError::new(
            path,
            "cannot hold the uncertainties beside the values: an array of NetCDF-3 ends at 4 GiB",
            "give --format zarr, or leave --error out",
        ));
    }
    write_whole(path, |out| {
        let header = header(&data);
        out.write_all(&header)?;
        data.arrays
            .iter()
            .try_for_each(|array| put_data(out, array))
    })
}

/// Bytes of an array, without its padding.
fn size_of(array: &Array<'_>, shape: [usize; 5]) -> u64 {
    match &array.data {
        Data::Doubles(values) => 8 * values.len() as u64,
        Data::Texts(names) => (names.len() * longest(names)) as u64,
        Data::Planes(_) => shape.iter().map(|n| *n as u64).product::<u64>() * 4,
    }
}

fn longest(names: &[String]) -> usize {
    names.iter().map(String::len).max().unwrap_or(1)
}

/// The header, with the places of the arrays behind it.
fn header(data: &Dataset<'_>) -> Vec<u8> {
    let length = header_from(data, 0).len() as u64;
    header_from(data, length)
}

fn header_from(data: &Dataset<'_>, length: u64) -> Vec<u8> {
    let mut out = MAGIC.to_vec();
    put_u32(&mut out, 0);
    let letters = data.arrays.iter().find_map(|array| match &array.data {
        Data::Texts(names) => Some(longest(names)),
        _ => None,
    });
    put_list(&mut out, DIMENSIONS, AXES.len() + 1);
    let lengths = data.shape.into_iter().chain(letters);
    for (name, n) in AXES.into_iter().chain([LETTERS]).zip(lengths) {
        put_text(&mut out, name);
        put_u32(&mut out, n as u32);
    }
    put_attributes(&mut out, &data.attributes);
    put_list(&mut out, VARIABLES, data.arrays.len());
    let mut begin = length;
    for array in &data.arrays {
        put_text(&mut out, array.name);
        let texts = [LETTERS];
        let (kind, more) = match &array.data {
            Data::Doubles(_) => (DOUBLE, &[][..]),
            Data::Texts(_) => (CHAR, &texts[..]),
            Data::Planes(_) => (FLOAT, &[][..]),
        };
        put_u32(&mut out, (array.axes.len() + more.len()) as u32);
        for axis in array.axes.iter().chain(more) {
            let at = AXES.iter().position(|name| name == axis);
            put_u32(&mut out, at.unwrap_or(AXES.len()) as u32);
        }
        put_attributes(&mut out, &array.attributes);
        put_u32(&mut out, kind);
        let size = size_of(array, data.shape).next_multiple_of(4);
        put_u32(&mut out, u32::try_from(size).unwrap_or(u32::MAX));
        out.extend(begin.to_be_bytes());
        begin += size;
    }
    out
}

fn put_u32(out: &mut Vec<u8>, value: u32) {
    out.extend(value.to_be_bytes());
}

/// The head of a list, which an empty one has of zeros.
fn put_list(out: &mut Vec<u8>, kind: u32, n: usize) {
    put_u32(out, if n == 0 { 0 } else { kind });
    put_u32(out, n as u32);
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    put_u32(out, text.len() as u32);
    out.extend(text.bytes());
    out.resize(out.len().next_multiple_of(4), 0);
}

fn put_attributes(out: &mut Vec<u8>, attributes: &[(String, String)]) {
    put_list(out, ATTRIBUTES, attributes.len());
    for (name, value) in attributes {
        // The one character that no name may hold.
        put_text(out, &name.replace('/', "_"));
        put_u32(out, CHAR);
        put_text(out, value);
    }
}

fn put_data(out: &mut impl Write, array: &Array<'_>) -> io::Result<()> {
    match &array.data {
        Data::Doubles(values) => {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
            out.write_all(&bytes)
        }
        Data::Texts(names) => {
            let width = longest(names);
            let mut bytes = Vec::new();
            for name in names {
                bytes.extend(name.bytes().chain(std::iter::repeat(0)).take(width));
            }
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            out.write_all(&bytes)
        }
        Data::Planes(planes) => planes.iter().try_for_each(|plane| {
            plane.chunks(1 << 16).try_for_each(|part| {
                let bytes: Vec<u8> = part.iter().flat_map(|v| v.to_be_bytes()).collect();
                out.write_all(&bytes)
            })
        }),
    }
}

/// Reads the values of what [`write`] writes.
fn read(path: &Path) -> Result<DenseChannels, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    decoded(&bytes, VALUES).ok_or_else(|| {
        FileError::new(
            path,
            "is not what gonia writes as NetCDF",
            "give a table of gonia, or export it again",
        )
    })
}

/// A variable's place in a file.
struct Place {
    axes: Vec<usize>,
    begin: usize,
}

fn decoded(bytes: &[u8], wanted: &str) -> Option<DenseChannels> {
    let mut rest = Bytes(bytes);
    if rest.take::<4>()? != MAGIC || rest.u32()? != 0 || rest.u32()? != DIMENSIONS {
        return None;
    }
    let mut dimensions = Vec::new();
    for _ in 0..rest.u32()? {
        rest.text()?;
        dimensions.push(rest.u32()? as usize);
    }
    let said = rest.attributes()?;
    let mut places = BTreeMap::new();
    let (VARIABLES, n) = (rest.u32()?, rest.u32()?) else {
        return None;
    };
    for _ in 0..n {
        let name = rest.text()?;
        let n = rest.u32()?;
        let axes: Option<Vec<usize>> = (0..n).map(|_| Some(rest.u32()? as usize)).collect();
        rest.attributes()?;
        let (_kind, _size) = (rest.u32()?, rest.u32()?);
        let begin = usize::try_from(u64::from_be_bytes(rest.take()?)).ok()?;
        places.insert(name, Place { axes: axes?, begin });
    }
    let shape_of = |place: &Place| -> Option<Vec<usize>> {
        let length = |axis: &usize| dimensions.get(*axis).copied();
        place.axes.iter().map(length).collect()
    };
    let (values, names) = (places.get(wanted)?, places.get("channel")?);
    let [n, n_theta, n_phi, _, _] = <[usize; 5]>::try_from(shape_of(values)?).ok()?;
    let grid = Grid::from_directions(n_theta.checked_mul(n_phi)?)?;
    let width = *shape_of(names)?.get(1)?;
    let letters = bytes.get(names.begin..)?.get(..n.checked_mul(width)?)?;
    let name_of = |letters: &[u8]| {
        let text = String::from_utf8_lossy(letters).into_owned();
        text.trim_end_matches('\0').to_owned()
    };
    let names: Vec<String> = letters.chunks(width.max(1)).map(name_of).collect();
    let channels = channels_of(&names)?;
    let cells = grid.n_cells();
    let data = bytes.get(values.begin..)?.get(..4 * n * cells)?;
    let (words, _) = data.as_chunks::<4>();
    let plane = |part: &[[u8; 4]]| part.iter().map(|w| f32::from_be_bytes(*w)).collect();
    let provenance = said
        .iter()
        .filter_map(|(name, value)| Some((name.strip_prefix(PREFIX)?.to_owned(), value.clone())));
    Some(DenseChannels {
        planes: words.chunks(cells).map(plane).collect(),
        channels,
        grid,
        scale: scale_of(said.get("scale")?)?,
        provenance: provenance.collect(),
    })
}

/// What is left to read.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*head)
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_be_bytes(self.take()?))
    }

    fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let (text, rest) = self.0.split_at_checked(length)?;
        self.0 = rest.get(length.next_multiple_of(4) - length..)?;
        String::from_utf8(text.to_vec()).ok()
    }

    fn attributes(&mut self) -> Option<BTreeMap<String, String>> {
        let (kind, n) = (self.u32()?, self.u32()?);
        if kind != ATTRIBUTES && (kind, n) != (0, 0) {
            return None;
        }
        let attribute = |rest: &mut Self| {
            let name = rest.text()?;
            (rest.u32()? == CHAR).then_some(())?;
            Some((name, rest.text()?))
        };
        (0..n).map(|_| attribute(self)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::dataset::UNCERTAINTY;
    use super::*;
    use crate::export::lopsided::tables;

    #[test]
    fn every_channel_and_its_uncertainty_come_back_bit_for_bit_and_cut_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.nc");
        for (table, errors) in tables() {
            write(&path, &table, Some(&errors)).unwrap();
            assert_eq!(read(&path).unwrap(), table);
            let bytes = std::fs::read(&path).unwrap();
            assert_eq!(decoded(&bytes, UNCERTAINTY).unwrap().planes, errors.planes);
            // The values come last, big-endian.
            let last = table.planes.last().unwrap().last().unwrap();
            assert!(bytes.ends_with(&last.to_be_bytes()));
            assert_eq!(bytes.len() % 4, 0);
            for length in (0..3000).chain([bytes.len() - 1]) {
                assert_eq!(decoded(&bytes[..length], VALUES), None, "{length}");
            }
            write(&path, &table, Some(&errors)).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), bytes);
            write(&path, &table, None).unwrap();
            assert_eq!(read(&path).unwrap(), table);
        }
    }
}
