//! One bit a cell of the dense grid: which ones were measured.

use gonia_brdf::Grid;

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
            bits: vec![0; grid.n_directions() * Self::row_bytes(grid)],
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

    /// The share of cells in the set by polar angles, `[iθi][iθv]`, each 0 ..= 1. Poles count as one
    /// direction, because samples at a pole belong to its first azimuth.
    pub fn share_by_polar_angle(&self) -> Vec<Vec<f32>> {
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

    /// Eight cells a byte, the first one in the lowest bit; every row of the grid begins a byte, so
    /// that a light direction takes [`CellMask::row_bytes`].
    pub fn bytes(&self) -> &[u8] {
        &self.bits
    }

    /// The bytes, to be read from a file.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.bits
    }

    /// Bytes of one light direction.
    pub fn row_bytes(grid: Grid) -> usize {
        grid.n_directions().div_ceil(8)
    }

    fn place(&self, cell: usize) -> (usize, usize) {
        let (light, view) = self.grid.light_and_view(cell);
        (light * Self::row_bytes(self.grid) + view / 8, view % 8)
    }
}
