//! Dense BRDFs in other programs' formats, and what is lost on the way.

use crate::colours::colours_of;
use crate::error::Error;
use crate::provenance::{SCALE_ASSUMED, scale_assumed};
use gonia_brdf::{DenseBrdf, Direction, Elementary, Pose, Sample};
use gonia_formats::export::{EXPORTS, ExportFormat, ExportSettings, Holds, How, Meaning, Point};
use gonia_formats::foreign::ForeignBrdf;
use gonia_rig::{Channels, DenseChannels, DenseFile, Remark, Scale};
use rayon::prelude::*;
use std::path::Path;

/// Pairs of directions at which a file that was written is compared with its table.
const TESTS: u32 = 20_000;

/// A table that is exported.
pub struct ExportSource<'a> {
    /// The table.
    pub dense: DenseChannels,
    /// The file that it was read from, for messages.
    pub path: &'a Path,
    /// Its standard uncertainties, of the same grid and channels, where they are known.
    pub errors: Option<DenseChannels>,
    /// Takes a relative BRDF for 1/sr after multiplying it.
    pub scale_by: Option<f64>,
    /// Whether a grid that is too coarse for the format is exported, and warned of.
    pub allow_coarse: bool,
}

/// How far a file in another format is from the table that it was made of, as a reader of that format has
/// it: |ln| of the ratio of values at directions in which both are positive.
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
    /// Which directions those are.
    pub places: Places,
}

/// Directions at which a file is compared with its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Places {
    /// Spread over the table's polar angles: what a reader finds anywhere.
    Anywhere,
    /// The file's own.
    OfTheFile,
}

/// Writes a dense BRDF in another program's format, and compares the file, read back, with the table. What is
/// to be said of the material in that format comes with it.
///
/// # Errors
/// The BRDF is relative, the format means 1/sr, and no `scale_by` is given; the grid's step is more than twice the format's,
/// and not `allow_coarse`; there are uncertainties, and the
/// format has no place for them; the file cannot be written or read back.
pub fn export(
    source: ExportSource<'_>,
    path: &Path,
    format: &ExportFormat,
    resolution: usize,
) -> Result<(ExportError, Vec<Remark>), Error> {
    let ExportSource {
        mut dense,
        mut errors,
        path: table,
        scale_by,
        allow_coarse,
    } = source;
    let mut remarks = Vec::new();
    if dense.scale == Scale::Relative {
        match (scale_by, format.means) {
            (Some(factor), _) => {
                scale(&mut dense, factor);
                errors.iter_mut().for_each(|errors| scale(errors, factor));
            }
            (None, Meaning::Stated) => {}
            (None, Meaning::Absolute) => {
                return Err(Error::RelativeExport {
                    format: format.title,
                });
            }
        }
    }
    if errors.is_some() && !format.holds_uncertainties() {
        return Err(Error::NoUncertainties {
            format: format.title,
        });
    }
    let format_deg = (format.step_deg)(resolution);
    remarks.extend(check_step(
        dense.grid.step_deg(),
        format_deg,
        format.title,
        (table, allow_coarse),
    )?);
    let error = match (&format.how, errors) {
        (How::Table { write, read }, errors) => {
            write(path, &dense, errors.as_ref())?;
            of_table(&dense, &read(path)?)
        }
        (How::Points { write, read }, errors) => {
            remarks.extend(write(path, &dense, errors.as_ref(), resolution)?);
            of_points(&dense, &read(path)?)
        }
        (How::Brdf { write, read }, _) => {
            let (dense, settings) = colours(dense, table, format, resolution, &mut remarks)?;
            remarks.extend(write(path, &dense, &settings)?);
            of_brdf(&dense.brdf, read(path)?.as_ref())
        }
        (How::Samples { write, read }, _) => {
            let (dense, settings) = colours(dense, table, format, resolution, &mut remarks)?;
            remarks.extend(write(path, &dense, &settings)?);
            of_samples(&dense.brdf, &read(path)?)
        }
    };
    Ok((error, remarks))
}

/// Whether a file would pretend to know what lies between the nodes of a table.
fn is_too_coarse(step_deg: f64, format_deg: f64) -> bool {
    format_deg > 0.0 && step_deg > 2.0 * format_deg
}

/// What is to be said of a table's step, if anything.
fn check_step(
    step_deg: f64,
    format_deg: f64,
    format: &'static str,
    (table, allow_coarse): (&Path, bool),
) -> Result<Option<Remark>, Error> {
    if !is_too_coarse(step_deg, format_deg) {
        return Ok(None);
    }
    if !allow_coarse {
        return Err(too_coarse(table, step_deg, format_deg, format));
    }
    let text = format_args!(
        "its step of {step_deg} degrees is coarser than the {format_deg} degrees of {format}: the file looks finer than it is"
    );
    let remedy = "fill a finer grid (gonia fill --step) for more than interpolated values";
    Ok(Some(Remark::new(table.display(), text, remedy)))
}

/// Why such a table is not exported, with the formats that take it.
fn too_coarse(table: &Path, step_deg: f64, format_deg: f64, format: &'static str) -> Error {
    let fits = |other: &&&ExportFormat| {
        let default = other.resolution.as_ref().map_or(0, |of| of.default);
        !is_too_coarse(step_deg, (other.step_deg)(default))
    };
    let names: Vec<&str> = EXPORTS
        .iter()
        .filter(fits)
        .map(|other| other.name)
        .collect();
    let formats = if names.is_empty() {
        String::new()
    } else {
        format!("give --format {}, ", names.join(", "))
    };
    Error::TooCoarse {
        path: table.display().to_string(),
        step_deg,
        format_deg,
        format,
        formats,
    }
}

/// The table as the colours, or the one value, that a format holds.
fn colours(
    dense: DenseChannels,
    path: &Path,
    format: &ExportFormat,
    resolution: usize,
    remarks: &mut Vec<Remark>,
) -> Result<(DenseFile, ExportSettings), Error> {
    let is_single = dense.channels == Channels::Single;
    let (mut dense, said) = colours_of(dense, path).ok_or(Error::UnequalPlanes)?;
    remarks.extend(said);
    if format.holds == Holds::One && !is_single {
        let grid = dense.brdf.grid();
        let brdf = DenseBrdf::from_fn(grid, |light, view| {
            [gonia_render::color::luminance(dense.brdf.at(light, view)); 3]
        });
        dense.brdf = brdf;
    }
    let is_one_value = match format.holds {
        Holds::Colours => false,
        Holds::One => true,
        Holds::ColoursOrOne | Holds::Any => is_single,
    };
    let settings = ExportSettings {
        resolution,
        is_one_value,
    };
    Ok((dense, settings))
}

/// The same BRDF in 1/sr, by a factor that somebody says; the provenance keeps it.
fn scale(dense: &mut DenseChannels, factor: f64) {
    let by = |value: &mut f32| *value = (f64::from(*value) * factor) as f32;
    dense.planes.iter_mut().flatten().for_each(by);
    dense.scale = Scale::Absolute;
    let said = scale_assumed(factor);
    dense.provenance.insert(SCALE_ASSUMED.into(), said);
}

fn of_brdf(table: &DenseBrdf, written: &dyn ForeignBrdf) -> ExportError {
    let grid = table.grid();
    let last_deg = grid.direction(grid.n_directions() - 1).theta_deg();
    let of_test = |test| {
        let [light, view] = directions(test, last_deg);
        let read = written.eval(light.to_vec3(), view.to_vec3());
        ln(table, light, view, read)
    };
    let logs = (0..TESTS).into_par_iter().map(of_test).collect();
    figures(logs, Places::Anywhere)
}

fn of_samples(table: &DenseBrdf, written: &[Sample]) -> ExportError {
    let of_sample = |sample: &Sample| {
        let angles = [
            sample.theta_i_deg,
            sample.phi_i_deg,
            sample.theta_v_deg,
            sample.phi_v_deg,
        ];
        let Pose { light, view } = Pose::from_deg(angles.map(f64::from));
        ln(table, light, view, sample.rgb.map(f64::from))
    };
    figures(
        written.par_iter().map(of_sample).collect(),
        Places::OfTheFile,
    )
}

fn of_points(table: &DenseChannels, written: &[Point]) -> ExportError {
    let of_point = |point: &Point| {
        let node = |d: Direction| table.grid.nearest(d.theta_deg(), d.phi_deg());
        let cell = table.grid.cell(node(point.light)?, node(point.view)?);
        let value = f64::from(*table.planes.get(point.channel)?.get(cell)?);
        let are_positive = value > 0.0 && point.value > 0.0;
        are_positive.then(|| (point.value / value).natural_log().abs())
    };
    figures(
        written.par_iter().map(of_point).collect(),
        Places::OfTheFile,
    )
}

fn of_table(table: &DenseChannels, written: &DenseChannels) -> ExportError {
    let pairs = table.planes.iter().zip(&written.planes);
    let cells = pairs.flat_map(|(table, read)| table.iter().zip(read));
    let of_cell = |(table, read): (&f32, &f32)| match table.to_bits() == read.to_bits() {
        true => Some(0.0),
        false if *table > 0.0 && *read > 0.0 => Some(f64::from(read / table).natural_log().abs()),
        false => None,
    };
    figures(cells.map(of_cell).collect(), Places::OfTheFile)
}

/// |ln| of the mean of channels against the table's, where both are positive.
fn ln(table: &DenseBrdf, light: Direction, view: Direction, read: [f64; 3]) -> Option<f64> {
    let mean = |values: [f64; 3]| (values[0] + values[1] + values[2]) / 3.0;
    let table = mean(table.lookup(light, view).map(f64::from));
    let read = mean(read);
    (table > 0.0 && read > 0.0).then(|| (read / table).natural_log().abs())
}

fn figures(logs: Vec<Option<f64>>, places: Places) -> ExportError {
    let mut found: Vec<f64> = logs.iter().flatten().copied().collect();
    found.par_sort_unstable_by(f64::total_cmp);
    let quantile = |share: f64| {
        let at = (share * found.len() as f64) as usize;
        found.get(at).copied().unwrap_or(f64::NAN)
    };
    let squares: f64 = found.iter().map(|ln| ln * ln).sum();
    ExportError {
        median: quantile(0.5),
        p99: quantile(0.99),
        rms: (squares / found.len() as f64).sqrt(),
        tests: logs.len(),
        lost: logs.len() - found.len(),
        places,
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
