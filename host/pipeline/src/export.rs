//! Dense BRDFs in other groups' formats, and what is lost on the way.

use crate::error::Error;
use gonia_brdf::{DenseBrdf, Direction, Elementary};
use gonia_formats::foreign::{ExportSettings, ForeignFormat, ForeignWriter};
use gonia_rig::{DenseFile, Scale};
use rayon::prelude::*;
use std::path::Path;

/// Pairs of directions at which a file that was written is compared with its table.
const TESTS: u32 = 20_000;

/// How far a file in another format is from the table that it was made of, as a reader of that format has
/// it: |ln| of the ratio of values, over random directions within the table's polar angles, in which
/// both are positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExportError {
    /// Median of |ln|.
    pub median: f64,
    /// Its 99th percentile.
    pub p99: f64,
    /// Its root mean square.
    pub rms: f64,
    /// Pairs of directions that were compared.
    pub tests: usize,
    /// Pairs at which only the table has a positive value.
    pub lost: usize,
}

/// Writes a dense BRDF in another group's format, and compares the file, read back, with the table.
/// `scale_by` takes a relative BRDF for 1/sr after multiplying it.
///
/// # Errors
/// The BRDF is relative, the format means 1/sr, and no `scale_by` is given; the file cannot be written or
/// read back.
pub fn export(
    mut dense: DenseFile,
    path: &Path,
    (format, writer): (&ForeignFormat, &ForeignWriter),
    settings: &ExportSettings,
    scale_by: Option<f64>,
) -> Result<ExportError, Error> {
    if dense.scale == Scale::Relative {
        let factor = scale_by.ok_or(Error::RelativeExport {
            format: format.name,
        })?;
        dense = scaled(&dense, factor);
    }
    (writer.write)(path, &dense, settings)?;
    let written = (writer.read)(path)?;
    let grid = dense.brdf.grid();
    let last_deg = grid.direction(grid.n_directions() - 1).theta_deg();
    let logs: Vec<Option<f64>> = (0..TESTS)
        .into_par_iter()
        .map(|test| {
            let [light, view] = directions(test, last_deg);
            let table = dense.brdf.lookup(light, view);
            let read = written.eval(light.to_vec3(), view.to_vec3());
            let mean = |values: [f64; 3]| (values[0] + values[1] + values[2]) / 3.0;
            let (table, read) = (mean(table.map(f64::from)), mean(read));
            (table > 0.0 && read > 0.0).then(|| (read / table).natural_log().abs())
        })
        .collect();
    let mut found: Vec<f64> = logs.iter().flatten().copied().collect();
    found.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let at = (share * found.len() as f64) as usize;
        found.get(at).copied().unwrap_or(f64::NAN)
    };
    let squares: f64 = found.iter().map(|ln| ln * ln).sum();
    Ok(ExportError {
        median: quantile(0.5),
        p99: quantile(0.99),
        rms: (squares / found.len() as f64).sqrt(),
        tests: logs.len(),
        lost: logs.len() - found.len(),
    })
}

/// The same BRDF in 1/sr, by a factor that somebody says; the provenance keeps it.
fn scaled(dense: &DenseFile, factor: f64) -> DenseFile {
    let at = |light, view| {
        dense
            .brdf
            .at(light, view)
            .map(|v| (f64::from(v) * factor) as f32)
    };
    let mut provenance = dense.provenance.clone();
    provenance.insert(
        "scale_assumed".into(),
        format!("1/sr after multiplying by {factor}"),
    );
    DenseFile {
        brdf: DenseBrdf::from_fn(dense.brdf.grid(), at),
        scale: Scale::Absolute,
        provenance,
    }
}

/// Two directions spread evenly over the polar angles up to `last_deg` and all azimuths: additive
/// recurrences of a quasi-random sequence in four dimensions (Roberts 2018).
fn directions(test: u32, last_deg: f64) -> [Direction; 2] {
    // The powers of 1/φ₄, φ₄⁵ = φ₄ + 1.
    let part = |by: f64| (0.5 + f64::from(test) * by).fract();
    let [a, b, c, d] = [0.856_674_9, 0.733_891_9, 0.628_706_7, 0.538_597_3].map(part);
    [
        Direction::from_deg(a * last_deg, b * 360.0),
        Direction::from_deg(c * last_deg, d * 360.0),
    ]
}
