//! Bins as bytes, all little-endian: `GBN2`; the number of channels and of polar angles (u32); how many samples are
//! outside (u64); the variance of a sample's logarithm (f32; NaN where it is unknown); and of each bin cell (u64), count and
//! frame (u32), then medians, deviations, and the mean directions of light and view (f32).

use super::bytes::Bytes;
use crate::{FileError, write_whole};
use gonia_brdf::{Bin, Bins, Grid};
use std::io::Write;
use std::path::Path;

const MAGIC: &[u8; 4] = b"GBN2";

/// Writes bins.
///
/// # Errors
/// The disk is full.
pub fn write_bins<const N: usize>(path: &Path, bins: &Bins<N>) -> Result<(), FileError> {
    write_whole(path, |out| {
        out.write_all(MAGIC)?;
        for count in [N, bins.grid().n_theta()] {
            out.write_all(&(count as u32).to_le_bytes())?;
        }
        out.write_all(&(bins.outside() as u64).to_le_bytes())?;
        let variance = bins.noise_variance().unwrap_or(f32::NAN);
        out.write_all(&variance.to_le_bytes())?;
        for bin in bins.bins() {
            out.write_all(&bin.cell.to_le_bytes())?;
            for word in [bin.count, bin.frame] {
                out.write_all(&word.to_le_bytes())?;
            }
            let places = bin.light.iter().chain(&bin.view);
            for float in bin.median.iter().chain(&bin.mad).chain(places) {
                out.write_all(&float.to_le_bytes())?;
            }
        }
        Ok(())
    })
}

/// Reads the bins of a grid.
///
/// # Errors
/// It cannot be read, or is none of such bins.
pub fn read_bins<const N: usize>(path: &Path, grid: Grid) -> Result<Bins<N>, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    let bins = bins_of(&mut Bytes(&bytes), grid);
    bins.ok_or_else(|| {
        let problem = format_args!("holds no bins of {N} channels on this grid");
        FileError::new(path, problem, "fill again, in another folder")
    })
}

fn bins_of<const N: usize>(bytes: &mut Bytes<'_>, grid: Grid) -> Option<Bins<N>> {
    let is_head = bytes.take(4)? == MAGIC
        && bytes.u32()? as usize == N
        && bytes.u32()? as usize == grid.n_theta();
    if !is_head {
        return None;
    }
    let outside = bytes.count()?;
    let [variance] = bytes.floats()?;
    let mut bins = Vec::with_capacity(bytes.0.len() / (4 * (10 + 2 * N)));
    while !bytes.0.is_empty() {
        bins.push(Bin {
            cell: bytes.count()? as u64,
            count: bytes.u32()?,
            frame: bytes.u32()?,
            median: bytes.floats()?,
            mad: bytes.floats()?,
            light: bytes.floats()?,
            view: bytes.floats()?,
        });
    }
    let variance = (!variance.is_nan()).then_some(variance);
    Bins::from_parts(grid, bins, outside, variance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::{Direction, Sample};

    #[test]
    fn bins_come_back_bit_for_bit_and_nothing_else_is_taken_for_them() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("bins-0");
        let grid = Grid::with_step_deg(15.0).unwrap();
        let samples: Vec<Sample> = (0..400)
            .map(|k| {
                let at = |a: f64, to: f64| (f64::from(k) * a) % 1.0 * to;
                let light = Direction::from_deg(at(0.819_173, 84.0), at(0.671_044, 360.0));
                let view = Direction::from_deg(at(0.549_7, 84.0), at(0.450_3, 360.0));
                Sample::new(light, view, [0.1, 0.2, 0.3]).in_frame(k)
            })
            .collect();
        let bins = Bins::new(grid, &samples);
        write_bins(&path, &bins).unwrap();
        let read: Bins = read_bins(&path, grid).unwrap();
        assert_eq!(read.bins(), bins.bins());
        assert_eq!(read.noise_variance(), bins.noise_variance());
        assert_eq!(read.outside(), bins.outside());
        assert!(read_bins::<1>(&path, grid).is_err());
        assert!(read_bins::<3>(&path, Grid::with_step_deg(10.0).unwrap()).is_err());
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        let error = read_bins::<3>(&path, grid).unwrap_err().to_string();
        assert!(error.contains("no bins of 3 channels"), "{error}");
    }
}
