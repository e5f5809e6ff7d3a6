//! One bit a cell of the dense grid: which ones were measured.

use super::{FileError, npy};
use gonia_brdf::Grid;
use std::io::{Read, Write};
use std::path::Path;

const DTYPE: &str = "|u1";

/// A set of cells of a grid, in the order of [`Grid::cell`]. The paper's grid takes 7.8 MB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellMask {
    grid: Grid,
    /// Eight cells a byte, the first one in the lowest bit; every row of the grid begins a byte.
    bits: Vec<u8>,
}

impl CellMask {
    /// No cell.
    pub fn empty(grid: Grid) -> Self {
        Self {
            grid,
            bits: vec![0; grid.n_directions() * row_bytes(grid)],
        }
    }

    /// The cells (numbered as by [`Grid::cell`]) of an iterator. Numbers beyond the grid are
    /// passed over.
    pub fn from_cells(grid: Grid, cells: impl IntoIterator<Item = usize>) -> Self {
        let mut mask = Self::empty(grid);
        for cell in cells {
            if cell < grid.n_cells() {
                let (byte, bit) = mask.place(cell);
                mask.bits[byte] |= 1 << bit;
            }
        }
        mask
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// Whether a cell is in the set.
    pub fn contains(&self, cell: usize) -> bool {
        let (byte, bit) = self.place(cell);
        self.bits.get(byte).is_some_and(|bits| bits >> bit & 1 == 1)
    }

    /// The number of cells in the set.
    pub fn count(&self) -> usize {
        self.bits
            .iter()
            .map(|byte| byte.count_ones() as usize)
            .sum()
    }

    /// The share of cells in the set by elevations, `[iθi][iθv]`, each 0 ..= 1. Poles count as one
    /// direction, because samples at a pole belong to its first azimuth.
    pub fn share_by_elevation(&self) -> Vec<Vec<f32>> {
        let grid = self.grid;
        let azimuths = |i_theta: usize| if i_theta == 0 { 1 } else { grid.n_phi() };
        (0..grid.n_theta())
            .map(|i| {
                (0..grid.n_theta())
                    .map(|v| {
                        let mut count = 0usize;
                        for pi in 0..azimuths(i) {
                            let light = i * grid.n_phi() + pi;
                            for pv in 0..azimuths(v) {
                                let cell = grid.cell(light, v * grid.n_phi() + pv);
                                count += usize::from(self.contains(cell));
                            }
                        }
                        count as f32 / (azimuths(i) * azimuths(v)) as f32
                    })
                    .collect()
            })
            .collect()
    }

    fn place(&self, cell: usize) -> (usize, usize) {
        let (light, view) = self.grid.light_and_view(cell);
        (light * row_bytes(self.grid) + view / 8, view % 8)
    }
}

fn row_bytes(grid: Grid) -> usize {
    grid.n_directions().div_ceil(8)
}

/// Writes a mask as a `.npy` of bytes, one row a light direction, as
/// `numpy.packbits(mask, axis=1, bitorder="little")` makes it.
///
/// # Errors
/// When the file cannot be written.
pub fn write_mask(path: &Path, mask: &CellMask) -> Result<(), FileError> {
    let shape = [mask.grid.n_directions(), row_bytes(mask.grid)];
    npy::write(path, DTYPE, &shape, |out| out.write_all(&mask.bits))
}

/// Reads a mask of `grid`.
///
/// # Errors
/// One line naming the file: not a `.npy` of bytes, cut short, or of another grid.
pub fn read_mask(path: &Path, grid: Grid) -> Result<CellMask, FileError> {
    let mut array = npy::open(path, DTYPE, 1)?;
    let mut mask = CellMask::empty(grid);
    let expected = [grid.n_directions() as u64, row_bytes(grid) as u64];
    if array.shape != expected {
        return Err(FileError::new(
            path,
            format_args!(
                "has the shape {}, not {}",
                npy::shape_text(&array.shape),
                npy::shape_text(&expected)
            ),
            "use the mask and the dense BRDF of the same run",
        ));
    }
    array
        .data
        .read_exact(&mut mask.bits)
        .map_err(|error| FileError::reading(path, &error))?;
    Ok(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_comes_back_and_counts_by_elevation() {
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
        let share = back.share_by_elevation();
        assert_eq!((share[0][0], share[1][2], share[2][1]), (1.0, 0.25, 0.0));

        let other = Grid::with_step_deg(15.0).unwrap();
        let error = read_mask(&path, other).unwrap_err().to_string();
        assert!(
            error.contains("has the shape 36 × 5, not 144 × 18"),
            "{error}"
        );
    }
}
