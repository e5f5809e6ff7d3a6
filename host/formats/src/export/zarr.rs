//! Zarr of version 2: a folder of arrays in chunks, each a file of plain little-endian numbers.
//!
//! A chunk of the values is a channel at a polar angle of the light. `.zmetadata` holds all that is said of the
//! arrays once more, so that readers open one file.

use super::dataset::{AXES, Array, Data, Dataset, dataset};
use super::folder::write_whole_folder;
use super::zarr_read::{name_of, read};
use super::{ExportFormat, Holds, How, Meaning};
use crate::FileError;
use gonia_rig::DenseChannels;
use serde_json::{Map, Value, json};
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

#[cfg(test)]
mod tests {
    use super::super::dataset::{UNCERTAINTY, VALUES};
    use super::super::zarr_read::read_array;
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
