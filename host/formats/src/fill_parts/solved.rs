//! What the pairs of a patch give, as bytes, all little-endian: `GSP1`; the number of channels (u32); how many pairs,
//! corners and cells there are (u64); of each pair 1 where its cells follow from its corners, else 0; logarithms at the
//! corners, and those of the other cells (f32, channel by channel).

use super::bytes::Bytes;
use crate::floats::{floats_of, write_bytes};
use crate::read_at::read_exact_at;
use crate::{FileError, write_whole};
use gonia_brdf::interpolate::AtCorners;
use std::fs::File;
use std::io::{Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 4] = b"GSP1";
const HEAD: usize = 4 + 4 + 3 * 8;

/// Writes what a patch gives.
///
/// # Errors
/// The disk is full.
pub fn write_solved<const N: usize>(
    path: &Path,
    at_corners: &AtCorners<N>,
    cells: &[[f32; N]],
) -> Result<(), FileError> {
    write_whole(path, |out| {
        out.write_all(MAGIC)?;
        out.write_all(&(N as u32).to_le_bytes())?;
        for count in [
            at_corners.smooth.len(),
            at_corners.values.len(),
            cells.len(),
        ] {
            out.write_all(&(count as u64).to_le_bytes())?;
        }
        let smooth: Vec<u8> = at_corners.smooth.iter().map(|is| u8::from(*is)).collect();
        out.write_all(&smooth)?;
        write_bytes(at_corners.values.as_flattened(), |_, b| out.write_all(b))?;
        write_bytes(cells.as_flattened(), |_, b| out.write_all(b))
    })
}

/// A patch of which the cells are still on the disk.
#[derive(Debug)]
pub struct SolvedPatch<const N: usize> {
    path: PathBuf,
    file: File,
    /// Where its cells begin, bytes.
    cells_at: u64,
    cells: usize,
}

/// Opens what a patch has given: at the corners, and the cells.
///
/// # Errors
/// It cannot be read, or is nothing of such channels.
pub fn read_solved<const N: usize>(
    path: &Path,
) -> Result<(AtCorners<N>, SolvedPatch<N>), FileError> {
    let reading = |error| FileError::reading(path, &error);
    let odd = || {
        let problem = format_args!("holds no solved patch of {N} channels");
        FileError::new(path, problem, "fill again, in another folder")
    };
    let mut file = File::open(path).map_err(reading)?;
    let length = file.metadata().map_err(reading)?.len();
    let mut head = [0; HEAD];
    file.read_exact(&mut head).map_err(reading)?;
    let counts = |bytes: &mut Bytes<'_>| {
        let is_ours = bytes.take(4)? == MAGIC && bytes.u32()? as usize == N;
        let counts = [bytes.count()?, bytes.count()?, bytes.count()?];
        is_ours.then_some(counts)
    };
    let [pairs, corners, cells] = counts(&mut Bytes(&head)).ok_or_else(odd)?;
    // In floating point nothing overflows, and files are far from where it is not exact.
    let wanted = HEAD as f64 + pairs as f64 + 4.0 * N as f64 * (corners as f64 + cells as f64);
    if length as f64 != wanted {
        return Err(odd());
    }
    let mut smooth = vec![0; pairs];
    file.read_exact(&mut smooth).map_err(reading)?;
    let mut values = vec![0; 4 * N * corners];
    file.read_exact(&mut values).map_err(reading)?;
    let values: Vec<f32> = floats_of(&values).collect();
    let at_corners = AtCorners {
        values: values.as_chunks::<N>().0.to_vec(),
        smooth: smooth.iter().map(|is| *is != 0).collect(),
    };
    let patch = SolvedPatch {
        path: path.to_owned(),
        file,
        cells_at: (HEAD + pairs + 4 * N * corners) as u64,
        cells,
    };
    Ok((at_corners, patch))
}

impl<const N: usize> SolvedPatch<N> {
    /// Appends some of its cells to `into`.
    ///
    /// # Errors
    /// The disk fails, or there are not so many.
    pub fn cells(&self, range: Range<usize>, into: &mut Vec<[f32; N]>) -> Result<(), FileError> {
        if range.end > self.cells {
            let problem = format_args!("holds {} cells, of which {range:?} are wanted", self.cells);
            let remedy = "fill again, in another folder";
            return Err(FileError::new(&self.path, problem, remedy));
        }
        let mut bytes = vec![0; 4 * N * range.len()];
        let at = self.cells_at + (4 * N * range.start) as u64;
        let read = read_exact_at(&self.file, &mut bytes, at);
        read.map_err(|error| FileError::reading(&self.path, &error))?;
        let floats: Vec<f32> = floats_of(&bytes).collect();
        into.extend_from_slice(floats.as_chunks::<N>().0);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_and_cells_come_back_and_a_cut_file_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("00000");
        let at_corners = AtCorners {
            values: vec![[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]],
            smooth: vec![true, false],
        };
        let cells = [[7.0, 8.0], [9.0, 10.0]];
        write_solved(&path, &at_corners, &cells).unwrap();
        let (read, patch) = read_solved::<2>(&path).unwrap();
        assert_eq!(read, at_corners);
        let mut found = Vec::new();
        patch.cells(1..2, &mut found).unwrap();
        patch.cells(0..1, &mut found).unwrap();
        assert_eq!(found, [cells[1], cells[0]]);
        let error = patch.cells(1..3, &mut found).unwrap_err().to_string();
        assert!(error.contains("2 cells"), "{error}");
        assert!(read_solved::<1>(&path).is_err());
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 4]).unwrap();
        let error = read_solved::<2>(&path).unwrap_err().to_string();
        assert!(error.contains("no solved patch of 2 channels"), "{error}");
    }
}
