//! Zarr as gonia writes it, read: whole, or cell by cell.

use super::dataset::{PREFIX, VALUES, channels_of, scale_of};
use crate::FileError;
use crate::dense_exr::{check_finite, no_value};
use crate::floats::floats_of;
use crate::format::{CellReader, Content, DenseFormat, Format};
use crate::read_at::read_exact_at;
use gonia_brdf::Grid;
use gonia_rig::{Channels, DenseChannels, Scale};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Zarr: a folder.
pub(crate) static FORMAT: Format = Format {
    name: "Zarr as gonia exports it",
    endings: &["zarr"],
    magic: &[],
    content: Content::Dense(DenseFormat {
        read: |path| {
            let table = read(path)?;
            check_finite(path, &table)?;
            Ok(table)
        },
        open: |path| Ok(Some(Box::new(Cells::open(path)?))),
        write: None,
    }),
};

/// The chunk of a channel at a polar angle of the light.
pub(super) fn name_of(channel: usize, theta: usize) -> String {
    format!("{channel}.{theta}.0.0.0")
}

/// Reads the values.
pub(super) fn read(path: &Path) -> Result<DenseChannels, FileError> {
    read_array(path, VALUES)
}

/// What is said of a table.
struct Head {
    grid: Grid,
    channels: Channels,
    scale: Scale,
    provenance: BTreeMap<String, String>,
}

impl Head {
    fn of(path: &Path, array: &str) -> Result<Self, FileError> {
        let meta: Value = serde_json::from_slice(&bytes(path, ".zmetadata")?)
            .map_err(|_| misfit(path, ".zmetadata"))?;
        let of = |name: &str| meta["metadata"].get(name).cloned().unwrap_or_default();
        let shape = of(&format!("{array}/.zarray"))["shape"].clone();
        let shape: Vec<u64> =
            serde_json::from_value(shape).map_err(|_| misfit(path, "its shape"))?;
        let &[n, n_theta, n_phi, views, _] = &shape[..] else {
            return Err(misfit(path, "its shape"));
        };
        let grid = Grid::from_directions((n_theta.min(1 << 16) * n_phi.min(1 << 16)) as usize)
            .filter(|grid| grid.n_theta() as u64 == n_theta && views == n_theta && n > 0)
            .ok_or_else(|| misfit(path, "its shape"))?;
        let names = names(&bytes(path, "channel/0")?, n as usize);
        let channels = channels_of(&names)
            .filter(|channels| channels.count() as u64 == n)
            .ok_or_else(|| misfit(path, "its list of channels"))?;
        let said = of(".zattrs");
        let facts = said.as_object().into_iter().flatten();
        let provenance = facts.filter_map(|(name, value)| {
            let name = name.strip_prefix(PREFIX)?;
            Some((name.to_owned(), value.as_str()?.to_owned()))
        });
        Ok(Self {
            grid,
            channels,
            provenance: provenance.collect(),
            scale: said["scale"]
                .as_str()
                .and_then(scale_of)
                .ok_or_else(|| misfit(path, "its scale"))?,
        })
    }

    /// Bytes of a chunk: a channel at a polar angle of the light.
    fn chunk(&self) -> usize {
        4 * self.grid.n_phi() * self.grid.n_directions()
    }
}

fn misfit(path: &Path, what: &str) -> FileError {
    FileError::new(
        path,
        format_args!("{what} is not what gonia writes"),
        "give a table of gonia, or export it again",
    )
}

fn bytes(path: &Path, name: &str) -> Result<Vec<u8>, FileError> {
    let file = path.join(name);
    std::fs::read(&file).map_err(|error| FileError::reading(&file, &error))
}

/// `n` names of equally many letters (UCS-4), the rest of each filled with zeros.
fn names(letters: &[u8], n: usize) -> Vec<String> {
    let (words, _) = letters.as_chunks::<4>();
    let name = |letters: &[[u8; 4]]| -> String {
        let letters = letters.iter().map(|w| u32::from_le_bytes(*w));
        let letters = letters.take_while(|l| *l != 0);
        letters.filter_map(char::from_u32).collect()
    };
    let width = (words.len() / n.max(1)).max(1);
    words.chunks(width).map(name).collect()
}

pub(super) fn read_array(path: &Path, array: &str) -> Result<DenseChannels, FileError> {
    let head = Head::of(path, array)?;
    let (grid, n) = (head.grid, head.channels.count());
    let mut planes = vec![Vec::with_capacity(grid.n_cells()); n];
    for (c, plane) in planes.iter_mut().enumerate() {
        for theta in 0..grid.n_theta() {
            let name = format!("{array}/{}", name_of(c, theta));
            let ring = bytes(path, &name)?;
            if ring.len() != head.chunk() {
                return Err(misfit(path, &name));
            }
            plane.extend(floats_of(&ring));
        }
    }
    Ok(DenseChannels {
        channels: head.channels,
        grid,
        planes,
        scale: head.scale,
        provenance: head.provenance,
    })
}

/// A table of which a few cells are wanted.
struct Cells {
    head: Head,
    path: PathBuf,
}

impl Cells {
    fn open(path: &Path) -> Result<Self, FileError> {
        let head = Head::of(path, VALUES)?;
        let path = path.to_owned();
        Ok(Self { head, path })
    }
}

impl CellReader for Cells {
    fn grid(&self) -> Grid {
        self.head.grid
    }

    fn channels(&self) -> &Channels {
        &self.head.channels
    }

    fn scale(&self) -> Scale {
        self.head.scale
    }

    fn provenance(&self) -> &BTreeMap<String, String> {
        &self.head.provenance
    }

    fn cell(&self, light: usize, view: usize, channel: usize) -> Result<f32, FileError> {
        let (grid, n_phi) = (self.head.grid, self.head.grid.n_phi());
        let name = format!("{VALUES}/{}", name_of(channel, light / n_phi));
        let path = self.path.join(&name);
        let reading = |error| FileError::reading(&path, &error);
        let file = File::open(&path).map_err(reading)?;
        if file.metadata().map_err(reading)?.len() != self.head.chunk() as u64 {
            return Err(misfit(&self.path, &name));
        }
        let mut value = [0; 4];
        let at = 4 * (light % n_phi * grid.n_directions() + view) as u64;
        read_exact_at(&file, &mut value, at).map_err(reading)?;
        let value = f32::from_le_bytes(value);
        if !value.is_finite() {
            let name = &self.head.channels.names()[channel];
            return Err(no_value(&self.path, grid, name, (light, view), value));
        }
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::super::lopsided::tables;
    use super::super::{How, export_format};
    use crate::dense::{DenseLookup, read_dense_channels};
    use gonia_brdf::Direction;

    #[test]
    fn a_table_is_read_as_any_dense_brdf_whole_and_cell_by_cell() {
        let dir = tempfile::tempdir().unwrap();
        for (k, (table, _)) in tables().into_iter().enumerate() {
            let path = dir.path().join(format!("{k}.zarr"));
            let How::Table { write, .. } = export_format(&path, None).unwrap().how else {
                panic!("no table")
            };
            write(&path, &table, None).unwrap();
            assert_eq!(read_dense_channels(&path).unwrap(), table);
            let mut lookup = DenseLookup::open(&path).unwrap();
            assert_eq!(lookup.scale(), table.scale);
            assert_eq!(lookup.channels(), &table.channels);
            assert_eq!(lookup.provenance(), &table.provenance);
            for (light, view) in [([31.0, 47.0], [55.0, 201.0]), ([0.0, 10.0], [40.0, 359.0])] {
                let [light, view] = [light, view].map(|[t, p]| Direction::from_deg(t, p));
                let found = lookup.lookup(light, view).unwrap();
                assert_eq!(found, table.lookup(light, view));
            }
            std::fs::write(path.join("brdf/0.0.0.0.0"), "cut").unwrap();
            let pole = Direction::from_deg(0.0, 0.0);
            let error = lookup.lookup(pole, pole).unwrap_err().to_string();
            assert!(error.contains("brdf/0.0.0.0.0 is not what"), "{error}");
            std::fs::remove_file(path.join(".zmetadata")).unwrap();
            assert!(read_dense_channels(&path).is_err());
        }
    }
}
