//! Binning: samples that share a cell become one value, their median (paper, Section III).

use crate::direction::{Direction, Vec3};
use crate::grid::Grid;
use crate::sample::Sample;
use rayon::prelude::*;

/// A filled cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// The cell, see [`Grid::cell`].
    pub cell: u32,
    /// Number of samples.
    pub count: u32,
    /// Their frame when all came from the same one, else [`Sample::NO_FRAME`].
    pub frame: u32,
    /// Median per channel.
    pub median: [f32; 3],
    /// Median absolute deviation from the median, per channel; 0 for a single sample.
    pub mad: [f32; 3],
    /// Mean of the light directions, a unit vector. The samples sit off the node, and a value
    /// belongs to where it was measured.
    pub light: [f32; 3],
    /// Mean of the view directions, a unit vector.
    pub view: [f32; 3],
}

/// All filled cells of a grid, in ascending order of the cell.
#[derive(Clone, Debug)]
pub struct Bins {
    grid: Grid,
    bins: Vec<Bin>,
    outside: usize,
}

impl Bins {
    /// Bins samples to their nearest nodes. Samples beyond the grid's last elevation, and samples
    /// with a value or an angle that is not finite, are counted as outside.
    pub fn new(grid: Grid, samples: &[Sample]) -> Self {
        const OUTSIDE: u64 = u64::MAX;
        // Cell and sample number in one word: one sort groups the cells and keeps the order of
        // samples within a cell, so that the result does not depend on the number of threads.
        let mut keys: Vec<u64> = samples
            .par_iter()
            .enumerate()
            .map(|(number, s)| match cell_of(grid, s) {
                Some(cell) => ((cell as u64) << 32) | number as u64,
                None => OUTSIDE,
            })
            .collect();
        keys.par_sort_unstable();
        let inside = keys.partition_point(|k| *k != OUTSIDE);
        let outside = keys.len() - inside;
        keys.truncate(inside);

        let same_cell = |a: &u64, b: &u64| a >> 32 == b >> 32;
        let pieces = split_between_cells(&keys, 4 * rayon::current_num_threads());
        let bins = pieces
            .par_iter()
            .map(|piece| {
                let mut scratch = Vec::new();
                piece
                    .chunk_by(same_cell)
                    .map(|group| summarize(group, samples, &mut scratch))
                    .collect::<Vec<_>>()
            })
            .collect::<Vec<_>>()
            .concat();
        Self {
            grid,
            bins,
            outside,
        }
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The filled cells.
    pub fn bins(&self) -> &[Bin] {
        &self.bins
    }

    /// How many samples fell outside the grid.
    pub fn outside(&self) -> usize {
        self.outside
    }
}

fn cell_of(grid: Grid, s: &Sample) -> Option<usize> {
    if !s.rgb.iter().all(|v| v.is_finite()) {
        return None;
    }
    let light = grid.nearest(s.theta_i_deg.into(), s.phi_i_deg.into())?;
    let view = grid.nearest(s.theta_v_deg.into(), s.phi_v_deg.into())?;
    Some(grid.cell(light, view))
}

/// Cuts sorted keys into about `n` pieces, never inside a cell.
fn split_between_cells(keys: &[u64], n: usize) -> Vec<&[u64]> {
    let mut pieces = Vec::with_capacity(n + 1);
    let mut rest = keys;
    let size = keys.len() / n + 1;
    while !rest.is_empty() {
        let at = size.min(rest.len());
        let cell = rest[at - 1] >> 32;
        let end = at + rest[at..].partition_point(|k| k >> 32 == cell);
        let (piece, tail) = rest.split_at(end);
        pieces.push(piece);
        rest = tail;
    }
    pieces
}

fn summarize(group: &[u64], samples: &[Sample], scratch: &mut Vec<f32>) -> Bin {
    let sample = |key: &u64| &samples[(*key & 0xffff_ffff) as usize];
    let first = sample(&group[0]);
    let mut light: Vec3 = [0.0; 3];
    let mut view: Vec3 = [0.0; 3];
    let mut frame = first.frame;
    for key in group {
        let s = sample(key);
        let l = Direction::from_deg(s.theta_i_deg.into(), s.phi_i_deg.into()).to_vec3();
        let v = Direction::from_deg(s.theta_v_deg.into(), s.phi_v_deg.into()).to_vec3();
        for k in 0..3 {
            light[k] += l[k];
            view[k] += v[k];
        }
        if s.frame != frame {
            frame = Sample::NO_FRAME;
        }
    }
    let mut value = [0.0; 3];
    let mut mad = [0.0; 3];
    for c in 0..3 {
        scratch.clear();
        scratch.extend(group.iter().map(|key| sample(key).rgb[c]));
        value[c] = median(scratch);
        let centre = value[c];
        scratch.iter_mut().for_each(|v| *v = (*v - centre).abs());
        mad[c] = median(scratch);
    }
    Bin {
        cell: (group[0] >> 32) as u32,
        count: group.len() as u32,
        frame,
        median: value,
        mad,
        light: unit_f32(light),
        view: unit_f32(view),
    }
}

fn unit_f32(v: Vec3) -> [f32; 3] {
    crate::direction::normalize(v).map(|x| x as f32)
}

/// The median of finite values, which are reordered; of an even number the mean of the middle two.
/// 0 of none.
pub fn median(values: &mut [f32]) -> f32 {
    let n = values.len();
    if n == 0 {
        return 0.0;
    }
    let (below, middle, _) = values.select_nth_unstable_by(n / 2, f32::total_cmp);
    let middle = *middle;
    if n % 2 == 1 {
        middle
    } else {
        let lower = below.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        0.5 * (lower + middle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(theta_i: f32, phi_i: f32, value: f32, frame: u32) -> Sample {
        Sample {
            theta_i_deg: theta_i,
            phi_i_deg: phi_i,
            theta_v_deg: 30.0,
            phi_v_deg: 90.0,
            rgb: [value, 2.0 * value, 3.0 * value],
            frame,
        }
    }

    #[test]
    fn a_bin_holds_median_spread_count_and_mean_direction() {
        let bins = Bins::new(
            Grid::PAPER,
            &[
                sample(40.5, 359.5, 1.0, 3),
                sample(40.5, 0.5, 9.0, 3),
                sample(39.5, 0.0, 2.0, 3),
                sample(88.0, 0.0, 1.0, 3),
                sample(40.0, 0.0, f32::NAN, 3),
            ],
        );
        assert_eq!(bins.outside(), 2);
        assert_eq!(bins.bins().len(), 1);
        let bin = bins.bins()[0];
        let grid = Grid::PAPER;
        assert_eq!(bin.cell as usize, grid.cell(20 * 180, 15 * 180 + 45));
        assert_eq!((bin.count, bin.frame), (3, 3));
        assert_eq!(bin.median, [2.0, 4.0, 6.0]);
        assert_eq!(bin.mad, [1.0, 2.0, 3.0]);
        let mean = Direction::from_vec3(bin.light.map(f64::from));
        assert!((mean.theta_deg() - 40.17).abs() < 0.01, "{mean:?}");
        assert!(mean.phi_deg() < 1e-3 || mean.phi_deg() > 359.999);
    }

    #[test]
    fn a_bin_of_two_frames_names_neither() {
        let bins = Bins::new(
            Grid::PAPER,
            &[sample(40.0, 0.0, 1.0, 1), sample(40.0, 0.0, 1.0, 2)],
        );
        assert_eq!(bins.bins()[0].frame, Sample::NO_FRAME);
    }

    #[test]
    fn bins_come_in_order_whatever_the_pieces() {
        let samples: Vec<Sample> = (0..5000)
            .map(|k| sample((k * 7 % 86) as f32, (k * 13 % 360) as f32, k as f32, k))
            .collect();
        let bins = Bins::new(Grid::PAPER, &samples);
        assert!(bins.bins().windows(2).all(|w| w[0].cell < w[1].cell));
        let total: u32 = bins.bins().iter().map(|b| b.count).sum();
        assert_eq!(total, 5000);
    }

    #[test]
    fn medians_of_even_odd_and_none() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(&mut []), 0.0);
    }
}
