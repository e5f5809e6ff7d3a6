//! Standard errors of a dense BRDF as an EXR of the same layout: R, G and B in the unit of the
//! values, and a channel `origin` (0 measured, 1 reciprocal, 2 interpolated, 3 extrapolated).

use crate::exr_planes::{ExrPlanes, Plane};
use crate::{FileError, exr_planes};
use exr::prelude::f16;
use gonia_brdf::Grid;
use gonia_brdf::interpolate::ErrorBars;
use gonia_rig::Scale;
use std::collections::BTreeMap;
use std::path::Path;

pub(super) fn write(
    path: &Path,
    grid: Grid,
    bars: ErrorBars,
    scale: Scale,
    provenance: &BTreeMap<String, String>,
) -> Result<(), FileError> {
    let origin = bars.origin.iter().map(|o| f16::from_f32(f32::from(*o)));
    let image = ExrPlanes {
        width: grid.n_directions(),
        height: grid.n_directions(),
        extra: Some(("origin", Plane::F16(origin.collect()))),
        planes: bars.standard_error.map(Plane::F32),
        attributes: exr_planes::own_attributes(scale, provenance),
    };
    exr_planes::write(path, image)?;
    Ok(())
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
        let bars = ErrorBars {
            standard_error: [plane(0), plane(1), plane(2)],
            origin: (0..n).map(|k| (k % 4) as u8).collect(),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("error.exr");
        write(&path, grid, bars, Scale::Relative, &BTreeMap::new()).unwrap();
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
