//! A Zarr table that several processes write: each some polar angles of the light, of some channels.
//!
//! The chunks are those of the export in one piece, so that the folder is the same in the end, byte for byte.

use super::dataset::{VALUES, dataset};
use super::folder::check_new_folder;
use super::zarr::fill;
use super::zarr_read::name_of;
use crate::FileError;
use crate::floats::to_bytes;
use crate::read_at::write_all_at;
use crate::whole_file::{folder_of, temporary};
use gonia_brdf::Grid;
use gonia_rig::{Channels, DenseChannels, Scale};
use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Some polar angles of the light, whose rows come in any order and from any thread. Their files stand under their
/// names once all rows are there ([`ZarrRings::finish`]).
pub struct ZarrRings {
    grid: Grid,
    rings: Range<usize>,
    /// By channel, then ring: the file, and its final name. It is made beside the table's folder, so that one whose
    /// process dies is not in it.
    files: Vec<Vec<(NamedTempFile, PathBuf)>>,
}

impl ZarrRings {
    /// A new table: all but its values.
    ///
    /// # Errors
    /// Something has the name, or the disk is full.
    pub fn begin(
        folder: &Path,
        grid: Grid,
        channels: &Channels,
        scale: Scale,
        provenance: &BTreeMap<String, String>,
    ) -> Result<(), FileError> {
        check_new_folder(folder)?;
        let table = DenseChannels {
            channels: channels.clone(),
            grid,
            planes: Vec::new(),
            scale,
            provenance: provenance.clone(),
        };
        let made = fs::create_dir_all(folder);
        let made = made.and_then(|()| fill(folder, &dataset(&table, None)));
        made.map_err(|error| FileError::writing(folder, &error))
    }

    /// Some polar angles of some channels.
    ///
    /// # Errors
    /// The disk is full, or the table is not there.
    pub fn of(
        folder: &Path,
        grid: Grid,
        rings: Range<usize>,
        channels: &[usize],
    ) -> Result<Self, FileError> {
        let bytes = 4 * (grid.n_phi() * grid.n_directions()) as u64;
        let of_ring = |channel: usize, ring: usize| {
            let name = folder.join(VALUES).join(name_of(channel, ring));
            let made = temporary(folder_of(folder));
            let file = made.and_then(|file| file.as_file().set_len(bytes).map(|()| file));
            Ok((
                file.map_err(|error| FileError::writing(&name, &error))?,
                name,
            ))
        };
        let of_channel =
            |channel: &usize| rings.clone().map(|ring| of_ring(*channel, ring)).collect();
        let files = channels
            .iter()
            .map(of_channel)
            .collect::<Result<_, FileError>>()?;
        Ok(Self { grid, rings, files })
    }

    /// The row of a light, of the channel at a place in the list of channels.
    ///
    /// # Errors
    /// The disk is full.
    pub fn put(&self, channel: usize, light: usize, row: &[f32]) -> Result<(), FileError> {
        let (ring, azimuth) = (light / self.grid.n_phi(), light % self.grid.n_phi());
        let (file, name) = &self.files[channel][ring - self.rings.start];
        let at = 4 * (azimuth * self.grid.n_directions()) as u64;
        let written = write_all_at(file.as_file(), &to_bytes(row), at);
        written.map_err(|error| FileError::writing(name, &error))
    }

    /// All rows are there.
    ///
    /// # Errors
    /// The disk is full.
    pub fn finish(self) -> Result<(), FileError> {
        for (file, name) in self.files.into_iter().flatten() {
            let failed = |error| FileError::writing(&name, &error);
            file.as_file().sync_all().map_err(failed)?;
            file.persist(&name).map_err(|error| failed(error.error))?;
        }
        Ok(())
    }

    /// The first of a table's chunks that is not there yet; `None` where all are.
    pub fn missing(folder: &Path, grid: Grid, channels: &Channels) -> Option<PathBuf> {
        let of_channel = |c| (0..grid.n_theta()).map(move |ring| name_of(c, ring));
        let names = (0..channels.count()).flat_map(of_channel);
        let mut paths = names.map(|name| folder.join(VALUES).join(name));
        paths.find(|path| !path.is_file())
    }
}

#[cfg(test)]
mod tests {
    use super::super::lopsided::tables;
    use super::super::{ExportFormat, How, export_format};
    use super::*;

    #[test]
    fn rings_in_any_order_are_the_export_in_one_piece_byte_for_byte() {
        let dir = tempfile::tempdir().unwrap();
        for (k, (table, _)) in tables().into_iter().enumerate() {
            let [whole, rings] =
                ["whole", "rings"].map(|name| dir.path().join(format!("{k}{name}.zarr")));
            let format: &ExportFormat = export_format(&whole, None).unwrap();
            let How::Table { write, .. } = format.how else {
                panic!("no table")
            };
            write(&whole, &table, None).unwrap();
            let (grid, side) = (table.grid, table.grid.n_directions());
            let provenance = &table.provenance;
            ZarrRings::begin(&rings, grid, &table.channels, table.scale, provenance).unwrap();
            let all: Vec<usize> = (0..table.channels.count()).collect();
            for part in [1..grid.n_theta(), 0..1] {
                let missing = ZarrRings::missing(&rings, grid, &table.channels).unwrap();
                assert!(missing.ends_with("brdf/0.0.0.0.0"), "{missing:?}");
                let writer = ZarrRings::of(&rings, grid, part.clone(), &all).unwrap();
                for light in (part.start * grid.n_phi()..part.end * grid.n_phi()).rev() {
                    for c in &all {
                        let row = &table.planes[*c][light * side..(light + 1) * side];
                        writer.put(*c, light, row).unwrap();
                    }
                }
                writer.finish().unwrap();
            }
            assert_eq!(ZarrRings::missing(&rings, grid, &table.channels), None);
            let files = |folder: &Path| -> BTreeMap<PathBuf, Vec<u8>> {
                let arrays = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
                let all = arrays.flat_map(|path| match path.is_dir() {
                    true => fs::read_dir(path)
                        .unwrap()
                        .map(|e| e.unwrap().path())
                        .collect(),
                    false => vec![path],
                });
                all.map(|path| {
                    let name = path.strip_prefix(folder).unwrap().to_owned();
                    (name, fs::read(path).unwrap())
                })
                .collect()
            };
            assert_eq!(files(&rings), files(&whole));
        }
    }
}
