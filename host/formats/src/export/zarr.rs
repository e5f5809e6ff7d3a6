//! Zarr of version 2: a folder of arrays in chunks, each a file of plain little-endian numbers.
//!
//! A chunk of the values is a channel at a polar angle of the light. `.zmetadata` holds all that is said of the
//! arrays once more, so that readers open one file.

use super::dataset::{AXES, Array, Data, Dataset, PREFIX, VALUES, channels_of, dataset, scale_of};
use super::folder::write_whole_folder;
use super::{ExportFormat, Holds, How, Meaning};
use crate::FileError;
use gonia_brdf::Grid;
use gonia_rig::DenseChannels;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "zarr",
    title: "Zarr, version 2",
    ending: "zarr",
    readers: "xarray, zarr-python; a folder",
    means: Meaning::Stated,
    holds: Holds::Any,
    angles: "the table's, and its uncertainties (`--error`)",
    provenance: Some("attributes `gonia.…`"),
    is_folder: true,
    resolution: None,
    step_deg: |_| 0.0,
    how: How::Table { write, read },
};

fn write(
    path: &Path,
    dense: &DenseChannels,
    errors: Option<&DenseChannels>,
) -> Result<(), FileError> {
    let data = dataset(dense, errors);
    write_whole_folder(path, |folder| fill(folder, &data))
}

/// Writes a table into a folder that is there. Of a table without planes all but its values is written.
pub(super) fn fill(folder: &Path, data: &Dataset<'_>) -> io::Result<()> {
    let mut all = Map::new();
    let mut put = |name: String, value: Value| {
        std::fs::write(folder.join(&name), format!("{value:#}\n"))?;
        all.insert(name, value);
        io::Result::Ok(())
    };
    put(".zgroup".into(), json!({ "zarr_format": 2 }))?;
    put(".zattrs".into(), attributes(&data.attributes, None))?;
    for array in &data.arrays {
        std::fs::create_dir(folder.join(array.name))?;
        put(format!("{}/.zarray", array.name), head(array, data.shape))?;
        let said = attributes(&array.attributes, Some(array.axes));
        put(format!("{}/.zattrs", array.name), said)?;
        chunks(&folder.join(array.name), array, data.shape)?;
    }
    let consolidated = json!({ "metadata": all, "zarr_consolidated_format": 1 });
    std::fs::write(folder.join(".zmetadata"), format!("{consolidated:#}\n"))
}

fn attributes(attributes: &[(String, String)], axes: Option<&[&str]>) -> Value {
    let mut map: Map<String, Value> = attributes
        .iter()
        .map(|(name, value)| (name.clone(), json!(value)))
        .collect();
    if let Some(axes) = axes {
        map.insert("_ARRAY_DIMENSIONS".into(), json!(axes));
    }
    Value::Object(map)
}

fn head(array: &Array<'_>, shape: [usize; 5]) -> Value {
    let of_axis = |axis: &&str| AXES.iter().zip(shape).find(|(name, _)| *name == axis);
    let sides: Vec<usize> = array
        .axes
        .iter()
        .filter_map(of_axis)
        .map(|(_, n)| n)
        .collect();
    let (kind, chunk, empty) = match &array.data {
        Data::Doubles(_) => ("<f8".to_owned(), sides.clone(), json!("NaN")),
        Data::Texts(names) => (format!("<U{}", longest(names)), sides.clone(), json!("")),
        Data::Planes(_) => {
            let [_, _, rest @ ..] = shape;
            (
                "<f4".to_owned(),
                [&[1, 1], &rest[..]].concat(),
                json!("NaN"),
            )
        }
    };
    json!({
        "zarr_format": 2, "shape": sides, "chunks": chunk, "dtype": kind, "fill_value": empty,
        "order": "C", "compressor": null, "filters": null,
    })
}

fn longest(names: &[String]) -> usize {
    names
        .iter()
        .map(|name| name.chars().count())
        .max()
        .unwrap_or(1)
}

fn chunks(folder: &Path, array: &Array<'_>, shape: [usize; 5]) -> io::Result<()> {
    match &array.data {
        Data::Doubles(values) => {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            std::fs::write(folder.join("0"), bytes)
        }
        Data::Texts(names) => {
            let width = longest(names);
            let mut bytes = Vec::new();
            for name in names {
                let letters = name.chars().map(u32::from).chain(std::iter::repeat(0));
                bytes.extend(letters.take(width).flat_map(u32::to_le_bytes));
            }
            std::fs::write(folder.join("0"), bytes)
        }
        Data::Planes(planes) => {
            for (c, plane) in planes.iter().enumerate() {
                for (t, ring) in plane.chunks(plane.len() / shape[1]).enumerate() {
                    let bytes: Vec<u8> = ring.iter().flat_map(|v| v.to_le_bytes()).collect();
                    std::fs::write(folder.join(name_of(c, t)), bytes)?;
                }
            }
            Ok(())
        }
    }
}

/// The chunk of a channel at a polar angle of the light.
pub(super) fn name_of(channel: usize, theta: usize) -> String {
    format!("{channel}.{theta}.0.0.0")
}

/// Reads the values of what [`write`] writes.
fn read(path: &Path) -> Result<DenseChannels, FileError> {
    read_array(path, VALUES)
}

fn read_array(path: &Path, array: &str) -> Result<DenseChannels, FileError> {
    let misfit = |what: &str| {
        FileError::new(
            path,
            format_args!("{what} is not what gonia writes"),
            "give a table of gonia, or export it again",
        )
    };
    let bytes = |name: &str| {
        let file = path.join(name);
        std::fs::read(&file).map_err(|error| FileError::reading(&file, &error))
    };
    let meta: Value =
        serde_json::from_slice(&bytes(".zmetadata")?).map_err(|_| misfit(".zmetadata"))?;
    let of = |name: &str| meta["metadata"].get(name).cloned().unwrap_or_default();
    let shape: Vec<u64> = serde_json::from_value(of(&format!("{array}/.zarray"))["shape"].clone())
        .map_err(|_| misfit("its shape"))?;
    let &[n, n_theta, n_phi, views, _] = &shape[..] else {
        return Err(misfit("its shape"));
    };
    let grid = Grid::from_directions((n_theta.min(1 << 16) * n_phi.min(1 << 16)) as usize)
        .filter(|grid| grid.n_theta() as u64 == n_theta && views == n_theta && n > 0)
        .ok_or_else(|| misfit("its shape"))?;
    let letters = bytes("channel/0")?;
    let (words, _) = letters.as_chunks::<4>();
    let width = (words.len() / n as usize).max(1);
    let name_of_letters = |letters: &[[u8; 4]]| -> String {
        let letters = letters.iter().map(|w| u32::from_le_bytes(*w));
        letters
            .take_while(|l| *l != 0)
            .filter_map(char::from_u32)
            .collect()
    };
    let names: Vec<String> = words.chunks(width).map(name_of_letters).collect();
    let channels = channels_of(&names)
        .filter(|channels| channels.count() as u64 == n)
        .ok_or_else(|| misfit("its list of channels"))?;
    let mut planes = vec![Vec::with_capacity(grid.n_cells()); n as usize];
    for (c, plane) in planes.iter_mut().enumerate() {
        for theta in 0..grid.n_theta() {
            let name = format!("{array}/{}", name_of(c, theta));
            let ring = bytes(&name)?;
            let (words, rest) = ring.as_chunks::<4>();
            if words.len() != grid.n_phi() * grid.n_directions() || !rest.is_empty() {
                return Err(misfit(&name));
            }
            plane.extend(words.iter().map(|w| f32::from_le_bytes(*w)));
        }
    }
    let said = of(".zattrs");
    let facts = said.as_object().into_iter().flatten();
    let provenance: BTreeMap<String, String> = facts
        .filter_map(|(name, value)| {
            let name = name.strip_prefix(PREFIX)?;
            Some((name.to_owned(), value.as_str()?.to_owned()))
        })
        .collect();
    Ok(DenseChannels {
        channels,
        grid,
        planes,
        scale: said["scale"]
            .as_str()
            .and_then(scale_of)
            .ok_or_else(|| misfit("its scale"))?,
        provenance,
    })
}

#[cfg(test)]
mod tests {
    use super::super::dataset::UNCERTAINTY;
    use super::*;
    use crate::export::lopsided::tables;

    #[test]
    fn every_channel_and_its_uncertainty_come_back_bit_for_bit() {
        let dir = tempfile::tempdir().unwrap();
        for (k, (table, errors)) in tables().into_iter().enumerate() {
            let path = dir.path().join(format!("{k}.zarr"));
            write(&path, &table, Some(&errors)).unwrap();
            assert_eq!(read(&path).unwrap(), table);
            let read = read_array(&path, UNCERTAINTY).unwrap();
            assert_eq!(read.planes, errors.planes);
            // By the format's description: a chunk at (channel, theta_i), C order, little-endian.
            let last = table.channels.count() - 1;
            let chunk = std::fs::read(path.join(format!("brdf/{last}.2.0.0.0"))).unwrap();
            let [light, view] = [(2, 3), (1, 5)].map(|(t, p)| t * table.grid.n_phi() + p);
            let at = 4 * (3 * table.grid.n_directions() + view);
            let found = f32::from_le_bytes(chunk[at..at + 4].try_into().unwrap());
            assert_eq!(found, table.planes[last][table.grid.cell(light, view)]);
            std::fs::write(path.join("brdf/0.0.0.0.0"), "cut").unwrap();
            let error = read_array(&path, VALUES).unwrap_err().to_string();
            assert!(error.contains("export it again"), "{error}");
            std::fs::write(path.join(".zmetadata"), "{}").unwrap();
            assert!(read_array(&path, VALUES).is_err());
        }
    }
}
