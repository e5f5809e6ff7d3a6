//! Standard errors of a dense BRDF as an EXR of the same layout: its channels in the unit of the
//! values, and a channel `origin` (0 measured, 1 reciprocal, 2 interpolated, 3 extrapolated).

use crate::exr_planes::{ExrPlanes, Plane};
use crate::exr_rows::write_rows;
use crate::format::ChannelErrors;
use crate::{FileError, exr_planes};
use exr::prelude::f16;
use gonia_brdf::Grid;
use gonia_rig::{Channels, Scale};
use std::collections::BTreeMap;
use std::path::Path;

pub(super) fn write(
    path: &Path,
    grid: Grid,
    bars: ChannelErrors,
    scale: Scale,
    provenance: &BTreeMap<String, String>,
) -> Result<(), FileError> {
    let attributes = exr_planes::own_attributes(scale, provenance);
    let side = grid.n_directions();
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

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{ReadChannels, ReadLayers};

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
        write(&path, grid, bars, Scale::Relative, &BTreeMap::new()).unwrap();
        let bands = ChannelErrors {
            channels: Channels::Bands(vec![400.0, 1000.0]),
            standard_error: vec![plane(0), plane(1)],
            origin: (0..n).map(|k| (k % 4) as u8).collect(),
        };
        let of_bands = folder.path().join("bands.exr");
        write(&of_bands, grid, bands, Scale::Relative, &BTreeMap::new()).unwrap();
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
    }
}
