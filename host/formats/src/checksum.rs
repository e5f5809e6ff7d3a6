//! Checksums that tie what a file says of another to the one that it was said of: CRC-32C.

use crate::FileError;
use crc::{CRC_32_ISCSI, Crc, Digest, Table};
use gonia_brdf::{DenseBrdf, Grid};
use gonia_rig::Frame;
use gonia_rig::{Channels, DenseChannels, SampleValues};
use std::fs::File;
use std::io::Read;
use std::path::Path;

static CRC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISCSI);
/// Bytes taken at a time.
const CHUNK: usize = 1 << 20;

/// The checksum of a file's bytes, as eight hexadecimal digits.
///
/// # Errors
/// When the file cannot be read.
pub fn of_file(path: &Path) -> Result<String, FileError> {
    let reading = |error| FileError::reading(path, &error);
    let mut file = File::open(path).map_err(reading)?;
    let mut digest = CRC.digest();
    let mut chunk = vec![0; CHUNK];
    loop {
        match file.read(&mut chunk).map_err(reading)? {
            0 => return Ok(text(digest)),
            n => digest.update(&chunk[..n]),
        }
    }
}

/// The checksum of a BRDF's values, as eight hexadecimal digits: the same in every file that holds
/// them, whatever its header says and however it is compressed.
pub fn of_brdf(brdf: &DenseBrdf) -> String {
    of_planes(brdf.grid(), brdf.planes())
}

/// The same of any channels; of one value it is that of the grey that it is.
pub fn of_channels(file: &DenseChannels) -> String {
    match (&file.channels, &file.planes[..]) {
        (Channels::Single, [plane]) => of_planes(file.grid, [plane; 3]),
        _ => of_planes(file.grid, &file.planes),
    }
}

fn of_planes<'a>(grid: Grid, planes: impl IntoIterator<Item = &'a Vec<f32>>) -> String {
    let mut digest = CRC.digest();
    digest.update(&grid.step_deg().to_le_bytes());
    let mut bytes = Vec::with_capacity(CHUNK);
    for plane in planes {
        for values in plane.chunks(CHUNK / 4) {
            bytes.clear();
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            digest.update(&bytes);
        }
    }
    text(digest)
}

/// The checksum of samples: their places, frames and values, in their order.
pub fn of_samples(samples: &SampleValues) -> String {
    let mut digest = CRC.digest();
    let mut of_channel = |channel: usize, with_places: bool| {
        for sample in samples.of_channels([channel]) {
            if with_places {
                let s = &sample;
                for angle in [s.theta_i_deg, s.phi_i_deg, s.theta_v_deg, s.phi_v_deg] {
                    digest.update(&angle.to_le_bytes());
                }
                digest.update(&s.frame.to_le_bytes());
            }
            digest.update(&sample.rgb[0].to_le_bytes());
        }
    };
    (0..samples.channels().count()).for_each(|channel| of_channel(channel, channel == 0));
    text(digest)
}

/// The checksum of some bytes.
pub fn of_bytes(bytes: &[u8]) -> String {
    let mut digest = CRC.digest();
    digest.update(bytes);
    text(digest)
}

/// The checksum of a frame's size and values.
pub fn of_frame(frame: &Frame) -> String {
    let mut digest = CRC.digest();
    digest.update(&(frame.width as u64).to_le_bytes());
    let mut bytes = Vec::with_capacity(CHUNK);
    for pixels in frame.rgb.chunks(CHUNK / 12) {
        bytes.clear();
        let values = pixels.iter().flatten();
        bytes.extend(values.flat_map(|value| value.to_le_bytes()));
        digest.update(&bytes);
    }
    text(digest)
}

fn text(digest: Digest<'_, u32, Table<16>>) -> String {
    format!("{:08x}", digest.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Grid;

    #[test]
    fn a_files_checksum_is_crc_32c() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        // The check value of the catalogue of parametrised CRC algorithms.
        std::fs::write(&path, "123456789").unwrap();
        assert_eq!(of_file(&path).unwrap(), "e3069283");
    }

    #[test]
    fn one_value_more_or_less_is_another_brdf() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let flat = |first: f32| {
            let mut plane = vec![0.5; grid.n_cells()];
            plane[0] = first;
            DenseBrdf::new(
                grid,
                [plane, vec![0.5; grid.n_cells()], vec![0.5; grid.n_cells()]],
            )
        };
        let [a, b] = [0.5, 0.500_001].map(|first| of_brdf(&flat(first).unwrap()));
        assert_eq!(a, of_brdf(&flat(0.5).unwrap()));
        assert_ne!(a, b);
    }
}
