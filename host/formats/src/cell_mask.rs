//! One bit a cell of the dense grid: which ones were measured.

use crate::{FileError, npy};
use gonia_brdf::Grid;
use gonia_rig::CellMask;
use std::io::{Read, Write};
use std::path::Path;

const DTYPE: &str = "|u1";

/// Writes a mask as a `.npy` of bytes, one row a light direction, as
/// `numpy.packbits(mask, axis=1, bitorder="little")` makes it.
///
/// # Errors
/// When the file cannot be written.
pub fn write_mask(path: &Path, mask: &CellMask) -> Result<(), FileError> {
    let shape = [mask.grid().n_directions(), CellMask::row_bytes(mask.grid())];
    npy::write(path, DTYPE, &shape, |out| out.write_all(mask.bytes()))
}

/// Reads a mask of `grid`.
///
/// # Errors
/// One line naming the file: not a `.npy` of bytes, cut short, or of another grid.
pub fn read_mask(path: &Path, grid: Grid) -> Result<CellMask, FileError> {
    let mut array = npy::open(path, DTYPE, 1)?;
    let mut mask = CellMask::empty(grid);
    let expected = [grid.n_directions() as u64, CellMask::row_bytes(grid) as u64];
    if array.header.shape != expected {
        return Err(FileError::new(
            path,
            format_args!(
                "has the shape {}, not {}",
                npy::shape_text(&array.header.shape),
                npy::shape_text(&expected)
            ),
            "use the mask and the dense BRDF of the same run",
        ));
    }
    array
        .data
        .read_exact(mask.bytes_mut())
        .map_err(|error| FileError::reading(path, &error))?;
    Ok(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_comes_back_and_counts_by_polar_angle() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.npy");
        let grid = Grid::with_step_deg(30.0).unwrap();
        // The pole pair, and a quarter of the azimuth pairs of 30°/60°.
        let mut cells = vec![0];
        for i in 0..6 {
            for v in 0..6 {
                cells.push(grid.cell(12 + i, 24 + v));
            }
        }
        let mask = CellMask::from_cells(grid, cells.clone());
        write_mask(&path, &mask).unwrap();
        let back = read_mask(&path, grid).unwrap();
        assert_eq!(back, mask);
        assert_eq!(back.count(), 37);
        assert!((0..grid.n_cells()).all(|c| back.contains(c) == cells.contains(&c)));
        let share = back.share_by_polar_angle();
        assert_eq!((share[0][0], share[1][2], share[2][1]), (1.0, 0.25, 0.0));

        let other = Grid::with_step_deg(15.0).unwrap();
        let error = read_mask(&path, other).unwrap_err().to_string();
        assert!(
            error.contains("has the shape 36 × 5, not 144 × 18"),
            "{error}"
        );
    }
}
