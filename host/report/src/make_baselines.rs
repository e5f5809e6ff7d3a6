//! The baselines of a measurement's folder: made, compared, written and drawn.

use crate::baselines::{BaselinePictures, draw_baseline, figure};
use crate::files::{DENSE, RIVALS, RIVALS_FIGURE, TRUTH};
use gonia_formats::baselines_toml::BaselineTable;
use gonia_formats::dense::{read_dense, write_dense};
use gonia_formats::samples::{check_scale, read_samples};
use gonia_formats::write_whole_bytes;
use gonia_pipeline::baselines::{BaselineOptions, Made, Measurement};
use gonia_pipeline::fit::write_fit;
use gonia_pipeline::{Error, Progress};
use std::path::Path;

/// The samples behind the dense BRDF.
const SAMPLES: &str = "samples.npy";

/// Makes the baselines of a folder that holds `dense.exr` and `samples.npy` (with frame numbers), on
/// its own grid or on a coarser one of `step_deg`. Writes each as `NAME.exr`, the comparison as
/// `rivals.toml`, and its figure as `rivals.svg`.
///
/// # Errors
/// A file that cannot be read or written, or a baseline that cannot be made.
pub fn make_baselines(
    folder: &Path,
    step_deg: Option<f64>,
    options: &BaselineOptions,
    progress: &Progress<'_>,
) -> Result<BaselineTable, Error> {
    let path = |name: &str| folder.join(name);
    let read = read_samples(&path(SAMPLES))?;
    let dense = read_dense(&path(DENSE))?;
    check_scale(&path(SAMPLES), read.scale, dense.scale)?;
    let truth = match path(TRUTH).exists() {
        true => Some(read_dense(&path(TRUTH))?),
        false => None,
    };
    let measurement = Measurement::new(dense, truth, read.samples, step_deg)?;
    let mut rows: Vec<BaselinePictures> = vec![draw_baseline("dense", measurement.dense())];
    let comparison = measurement.baselines(
        options,
        &mut |row, made| {
            match made {
                Made::Measured => {}
                Made::Filled(name, file) => {
                    if name == "sparse" {
                        rows.push(draw_baseline(&row.name, &file.brdf));
                    }
                    write_dense(&path(&format!("{name}.exr")), file)?;
                }
                Made::Fitted(result, scale) => {
                    rows.push(draw_baseline(&row.name, &result.dense));
                    write_fit(&path(&format!("{}.exr", row.name)), *result, scale)?;
                }
            }
            Ok::<(), Error>(())
        },
        progress,
    )?;
    comparison.write(&path(RIVALS))?;
    write_whole_bytes(
        &path(RIVALS_FIGURE).with_extension("svg"),
        figure(&rows).as_bytes(),
    )?;
    Ok(comparison)
}
