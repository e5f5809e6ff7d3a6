//! Standard errors of a dense BRDF as an EXR of the same layout: its channels in the unit of the
//! values, and a channel `origin` (0 measured, 1 reciprocal, 2 interpolated, 3 extrapolated, 4 by symmetry).

use crate::exr_planes::{ExrPlanes, Plane};
use crate::exr_rows::write_rows;
use crate::format::{ChannelErrors, CombineErrors, ERROR_PARTS};
use crate::{FileError, exr_planes};
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel, f16};
use gonia_brdf::Grid;
use gonia_rig::{Channels, Scale};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

pub(super) fn write(
    path: &Path,
    grid: Grid,
    bars: ChannelErrors,
    combine: Option<&CombineErrors<'_>>,
    scale: Scale,
    provenance: &BTreeMap<String, String>,
) -> Result<(), FileError> {
    let attributes = exr_planes::own_attributes(scale, provenance);
    let side = grid.n_directions();
    if let Some(combine) = combine {
        return write_parts(path, side, &bars, combine, &attributes);
    }
    let ChannelErrors {
        channels,
        standard_error,
        origin,
    } = bars;
    let planes = match <[Vec<f32>; 3]>::try_from(standard_error) {
        Ok(planes) if channels == Channels::Rgb => planes,
        Ok(planes) => return write_rows_of(path, side, &channels, &planes, &origin, &attributes),
        Err(planes) => return write_rows_of(path, side, &channels, &planes, &origin, &attributes),
    };
    let origin = origin.iter().map(|o| f16::from_f32(f32::from(*o)));
    let image = ExrPlanes {
        width: side,
        height: side,
        extra: Some((ORIGIN, Plane::F16(origin.collect()))),
        planes: planes.map(Plane::F32),
        attributes,
    };
    exr_planes::write(path, image)?;
    Ok(())
}

/// The channel of the cells' origins.
const ORIGIN: &str = "origin";

/// Combined errors and their parts, row by row, all in single precision.
fn write_parts(
    path: &Path,
    side: usize,
    bars: &ChannelErrors,
    combine: &CombineErrors<'_>,
    attributes: &BTreeMap<String, String>,
) -> Result<(), FileError> {
    let mut names = bars.channels.names();
    names.extend(ERROR_PARTS.map(str::to_owned));
    names.push(ORIGIN.to_owned());
    let numbers: Vec<usize> = (0..names.len()).collect();
    let short = || std::io::Error::other("a plane is smaller than the grid");
    write_rows(path, side, &names, attributes, |writer| {
        (0..side).into_par_iter().try_for_each(|light| {
            let here = light * side..(light + 1) * side;
            let noise: Vec<&[f32]> = bars
                .standard_error
                .iter()
                .filter_map(|plane| plane.get(here.clone()))
                .collect();
            if noise.len() != bars.standard_error.len() {
                return Err(short());
            }
            let origin = bars.origin.get(here).ok_or_else(short)?;
            let origin: Vec<f32> = origin.iter().map(|o| f32::from(*o)).collect();
            let row = combine(light, &noise);
            let values = row.combined.iter().chain(&row.parts).chain([&origin]);
            let values: Vec<&[f32]> = values.map(Vec::as_slice).collect();
            if values.len() != names.len() || values.iter().any(|v| v.len() != side) {
                return Err(short());
            }
            writer.write(light, &numbers, &values)
        })
    })
}

/// Other channels than colours, the origins in single precision too.
fn write_rows_of(
    path: &Path,
    side: usize,
    channels: &Channels,
    planes: &[Vec<f32>],
    origin: &[u8],
    attributes: &BTreeMap<String, String>,
) -> Result<(), FileError> {
    let mut names = channels.names();
    names.push(ORIGIN.to_owned());
    write_rows(path, side, &names, attributes, |writer| {
        let channels: Vec<usize> = (0..names.len()).collect();
        let mut origins = Vec::with_capacity(side);
        for (light, row) in origin.chunks_exact(side).enumerate() {
            origins.clear();
            origins.extend(row.iter().map(|o| f32::from(*o)));
            let mut rows: Vec<&[f32]> = planes
                .iter()
                .filter_map(|plane| plane.get(light * side..(light + 1) * side))
                .collect();
            rows.push(&origins);
            if rows.len() < names.len() {
                return Err(std::io::Error::other("a plane is smaller than the grid"));
            }
            writer.write(light, &channels, &rows)?;
        }
        Ok(())
    })
}

/// The cells' origins of a file of standard errors, in the grid's order; `None` where it holds none.
///
/// # Errors
/// A file that is no EXR or cannot be read.
pub(super) fn read_origins(path: &Path) -> Result<Option<Vec<u8>>, FileError> {
    let names = MetaData::read_from_file(path, false).map_err(|error| reading(path, &error))?;
    let has_origins = names.headers.iter().any(|header| {
        let mut channels = header.channels.list.iter();
        channels.any(|channel| channel.name.eq(ORIGIN))
    });
    if !has_origins {
        return Ok(None);
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required(ORIGIN)
        .collect_pixels(
            |size, _| (size.width(), vec![0; size.area()]),
            |(width, origins): &mut (usize, Vec<u8>), place, (origin,): (f32,)| {
                origins[place.y() * *width + place.x()] = origin as u8;
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .map_err(|error| reading(path, &error))?;
    Ok(Some(image.layer_data.channel_data.pixels.1))
}

fn reading(path: &Path, error: &exr::error::Error) -> FileError {
    FileError::new(
        path,
        format_args!("cannot be read as OpenEXR ({error})"),
        "make it again (gonia fill --error)",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_and_origin_stand_where_their_cells_are() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let n = grid.n_cells();
        let plane = |c: usize| (0..n).map(|k| (k + c) as f32).collect::<Vec<f32>>();
        let bars = ChannelErrors {
            channels: Channels::Rgb,
            standard_error: vec![plane(0), plane(1), plane(2)],
            origin: (0..n).map(|k| (k % 4) as u8).collect(),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("error.exr");
        write(&path, grid, bars, None, Scale::Relative, &BTreeMap::new()).unwrap();
        let bands = ChannelErrors {
            channels: Channels::Bands(vec![400.0, 1000.0]),
            standard_error: vec![plane(0), plane(1)],
            origin: (0..n).map(|k| (k % 4) as u8).collect(),
        };
        let of_bands = folder.path().join("bands.exr");
        write(
            &of_bands,
            grid,
            bands,
            None,
            Scale::Relative,
            &BTreeMap::new(),
        )
        .unwrap();
        let read = crate::dense::read_dense_channels(&of_bands).unwrap();
        assert_eq!(read.channels, Channels::Bands(vec![400.0, 1000.0]));
        assert_eq!(read.planes, [plane(0), plane(1)]);
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(&path)
            .unwrap();
        let channels = &image.layer_data.channel_data.list;
        let value = |name: &str, k: usize| {
            let channel = channels.iter().find(|c| c.name.eq(name)).unwrap();
            channel.sample_data.value_by_flat_index(k).to_f32()
        };
        for k in [0, 1, 17, n - 1] {
            assert_eq!(value("G", k), (k + 1) as f32);
            assert_eq!(value("origin", k), (k % 4) as f32);
        }
        let expected: Vec<u8> = (0..n).map(|k| (k % 4) as u8).collect();
        for path in [&path, &of_bands] {
            assert_eq!(read_origins(path).unwrap(), Some(expected.clone()));
        }
        let values = folder.path().join("dense.exr");
        crate::dense::write_dense_channels(&values, &read).unwrap();
        assert_eq!(read_origins(&values).unwrap(), None);
    }

    #[test]
    fn combined_errors_and_their_parts_stand_by_their_names_and_are_read_as_errors() {
        use crate::format::ErrorRow;
        let grid = Grid::with_step_deg(30.0).unwrap();
        let (n, side) = (grid.n_cells(), grid.n_directions());
        let bars = ChannelErrors {
            channels: Channels::Rgb,
            standard_error: vec![vec![1.0; n], vec![2.0; n], vec![3.0; n]],
            origin: vec![2; n],
        };
        let combine = |light: usize, noise: &[&[f32]]| ErrorRow {
            combined: noise
                .iter()
                .map(|row| row.iter().map(|u| u + light as f32).collect())
                .collect(),
            parts: [0.25f32, 0.5, 0.75].map(|share| vec![share; side]),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("error.exr");
        write(
            &path,
            grid,
            bars,
            Some(&combine),
            Scale::Relative,
            &BTreeMap::new(),
        )
        .unwrap();
        let read = crate::dense::read_dense_channels(&path).unwrap();
        assert_eq!(read.channels, Channels::Rgb);
        assert_eq!(read.planes[2][3 * side + 1], 6.0);
        let mut lookup = crate::dense::DenseLookup::open(&path).unwrap();
        let (light, view) = (grid.direction(14), grid.direction(2));
        assert_eq!(lookup.lookup(light, view).unwrap(), [15.0, 16.0, 17.0]);
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(&path)
            .unwrap();
        let names: Vec<String> = image
            .layer_data
            .channel_data
            .list
            .iter()
            .map(|c| c.name.to_string())
            .collect();
        assert_eq!(
            names,
            ["B", "G", "R", "direction", "noise", "origin", "scale"]
        );
    }
}
