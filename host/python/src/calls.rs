//! What is done with samples and dense BRDFs.

use crate::arrays::Values;
use crate::dense::{Dense, Uncertainty};
use crate::run::{run, run_silently};
use crate::samples::Samples;
use crate::to_py;
use gonia_brdf::fit::{FitSettings, StandardFamily};
use gonia_brdf::interpolate::Preset;
use gonia_brdf::{Brdf, SymmetryKind};
use gonia_formats::dense::ChannelErrors;
use gonia_formats::export::export_format;
use gonia_formats::rig_toml::write_rig;
use gonia_formats::{CaptureFolder, FileError};
use gonia_pipeline::budget::{budget_in, combine_errors};
use gonia_pipeline::export::{ExportSource, export as export_file};
use gonia_pipeline::fit::{cells_of_dense, cells_of_samples, fit_model};
use gonia_pipeline::process::Processed;
use gonia_pipeline::{
    Error, FillOptions, FitOfSamples, Options, Side, Table, calibrate as calibrate_rig, colours_of,
    compare as compare_tables, fill as fill_samples, samples_of_folder,
};
use gonia_render::{Light, Picture, Tabulated};
use gonia_rig::{DenseChannels, DenseFile, Rig, SampleValues, Scale};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Adds the functions.
pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(process, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(fill, module)?)?;
    module.add_function(wrap_pyfunction!(query_samples, module)?)?;
    module.add_function(wrap_pyfunction!(compare, module)?)?;
    module.add_function(wrap_pyfunction!(fit, module)?)?;
    module.add_function(wrap_pyfunction!(export, module)?)?;
    module.add_function(wrap_pyfunction!(render, module)?)?;
    module.add_function(wrap_pyfunction!(set_threads, module)?)
}

pub(crate) fn texts(remarks: &[gonia_rig::Remark]) -> Vec<String> {
    remarks.iter().map(ToString::to_string).collect()
}

/// Samples of a capture folder's frames.
#[pyfunction]
fn process(py: Python<'_>, folder: PathBuf, progress: Option<Py<PyAny>>) -> PyResult<Samples> {
    let (processed, rig) = run(py, progress, |progress| {
        let rig = CaptureFolder::open(&folder)?.rig().clone();
        Ok::<_, Error>((samples_of_folder(&folder, progress)?, rig))
    })?;
    Ok(samples_of(processed, &rig, &folder))
}

/// Samples of a folder's frames, with where they are from.
pub(crate) fn samples_of(processed: Processed, rig: &Rig, folder: &Path) -> Samples {
    let facts = [("frames".to_owned(), folder.display().to_string())];
    let note = processed.note(rig, facts.into());
    Samples {
        remarks: texts(&processed.remarks),
        values: SampleValues::Rgb(processed.samples),
        scale: note.scale,
        provenance: note.provenance,
    }
}

/// The rig of a capture folder as its frames show it: every number with its uncertainty, and the rig written where
/// `output` says.
#[pyfunction]
fn calibrate<'py>(
    py: Python<'py>,
    folder: PathBuf,
    output: Option<PathBuf>,
    date: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let mut found = run(py, progress, |progress| {
        let folder = CaptureFolder::open(&folder).map_err(|error| error.to_string())?;
        calibrate_rig(folder.rig(), &folder, progress).map_err(|error| error.to_string())
    })?;
    if let Some(calibration) = &mut found.rig.calibration {
        calibration.date = date;
    }
    if let Some(output) = output {
        write_rig(&output, &found.rig).map_err(to_py)?;
    }
    let numbers = PyDict::new(py);
    for number in &found.numbers {
        let of = PyDict::new(py);
        of.set_item("nominal", number.nominal)?;
        of.set_item("found", number.found)?;
        of.set_item("u", number.u)?;
        numbers.set_item(number.name, of)?;
    }
    let told = PyDict::new(py);
    told.set_item("numbers", numbers)?;
    told.set_item("frames", found.frames)?;
    told.set_item("lines_px", found.lines_px)?;
    told.set_item("light_u_deg", found.direction_u[0].p95)?;
    told.set_item("view_u_deg", found.direction_u[1].p95)?;
    told.set_item("remarks", texts(&found.remarks))?;
    Ok(told)
}

/// How a grid is filled, as Python says it.
#[derive(FromPyObject)]
pub(crate) struct Filling {
    #[pyo3(item)]
    step: f64,
    #[pyo3(item)]
    error: bool,
    #[pyo3(item)]
    symmetry: String,
    #[pyo3(item)]
    plane: Option<f64>,
    #[pyo3(item)]
    preset: String,
}

impl Filling {
    pub(crate) fn options(&self) -> PyResult<FillOptions> {
        let preset = match self.preset.as_str() {
            "preview" => Preset::Preview,
            "fast" => Preset::Fast,
            "default" => Preset::Default,
            "best" => Preset::Best,
            other => {
                return Err(to_py(format!(
                    "preset \"{other}\": give \"preview\", \"fast\", \"default\" or \"best\""
                )));
            }
        };
        Ok(FillOptions {
            preset,
            with_errors: self.error,
            symmetry: symmetry_of(&self.symmetry)?,
            plane_deg: self.plane,
            ..FillOptions::with_step_deg(self.step)
        })
    }
}

fn symmetry_of(name: &str) -> PyResult<Option<SymmetryKind>> {
    Ok(match name {
        "auto" => None,
        "none" => Some(SymmetryKind::None),
        "isotropic" => Some(SymmetryKind::Isotropic),
        "bilateral" => Some(SymmetryKind::Bilateral),
        "half-turn" => Some(SymmetryKind::HalfTurn),
        "half-turn-bilateral" => Some(SymmetryKind::HalfTurnBilateral),
        other => {
            return Err(to_py(format!(
                "symmetry \"{other}\": give \"auto\", \"none\", \"isotropic\", \"bilateral\", \"half-turn\" or \"half-turn-bilateral\""
            )));
        }
    })
}

/// Interpolates samples to every cell of a grid.
#[pyfunction]
fn fill(
    py: Python<'_>,
    samples: &Samples,
    how: Filling,
    progress: Option<Py<PyAny>>,
) -> PyResult<Dense> {
    let options = how.options()?;
    let values = samples.values.clone();
    if !options.fits_memory(values.channels()).map_err(to_py)? {
        return Err(to_py(format!(
            "step {}: this grid does not fit memory; fill it with the command gonia fill, which writes it row by row",
            options.step_deg
        )));
    }
    let scale = samples.scale.unwrap_or(Scale::Relative);
    let budget = budget_in(&samples.provenance).map_err(to_py)?;
    let (mut file, errors, account, combined) = run(py, progress, |progress| {
        let filled = fill_samples(values, scale, &options, progress)?;
        let (file, errors) = (filled.dense, filled.errors);
        let combined = errors.as_ref().map(|errors| {
            let budget = budget.as_ref()?;
            combined(&file, errors, budget)
        });
        Ok::<_, Error>((file, errors, filled.account, combined.flatten()))
    })?;
    file.provenance.extend(samples.provenance.clone());
    let uncertainty = errors.map(|errors| Uncertainty {
        planes: combined.unwrap_or_else(|| errors.standard_error.clone()),
        origins: errors.origin.clone(),
        noise: Some(errors),
    });
    let said = [
        ("settings", account.settings),
        ("symmetry", account.symmetry),
    ];
    Ok(Dense {
        file,
        uncertainty,
        account: said.map(|(name, text)| (name.to_owned(), text)).into(),
        remarks: texts(&account.remarks),
    })
}

/// Standard errors of noise and interpolation, combined with what a budget knows.
fn combined(
    file: &DenseChannels,
    errors: &ChannelErrors,
    budget: &gonia_rig::Budget,
) -> Option<Vec<Vec<f32>>> {
    let combine = combine_errors(file.grid, &file.planes, &errors.origin, budget)?;
    let side = file.grid.n_directions();
    let rows: Vec<Vec<Vec<f32>>> = (0..side)
        .into_par_iter()
        .map(|light| {
            let here = light * side..(light + 1) * side;
            let noise: Vec<&[f32]> = errors
                .standard_error
                .iter()
                .map(|plane| &plane[here.clone()])
                .collect();
            combine(light, &noise).combined
        })
        .collect();
    let mut planes = vec![Vec::with_capacity(side * side); file.planes.len()];
    for row in rows {
        for (plane, values) in planes.iter_mut().zip(row) {
            plane.extend(values);
        }
    }
    Some(planes)
}

/// Evaluates the fit of samples at rows of directions (degrees), without a grid: of each channel the value and its
/// standard uncertainty.
#[pyfunction]
fn query_samples(
    py: Python<'_>,
    samples: &Samples,
    rows: &Bound<'_, PyAny>,
    symmetry: &str,
) -> PyResult<(Values, Values)> {
    let symmetry = symmetry_of(symmetry)?;
    let budget = budget_in(&samples.provenance).map_err(to_py)?;
    let pairs = crate::dense::pairs_of(rows)?;
    let values = samples.values.clone();
    let found = run_silently(py, || {
        let (fit, _) = FitOfSamples::new(values, symmetry)?;
        Ok::<_, Error>(fit.with_uncertainty(&pairs, budget.as_ref()))
    })?;
    let n = samples.values.channels().count();
    let of = |k: usize| {
        let values = found.iter().flatten().map(|of| of[k]).collect();
        Values::new(values, vec![found.len(), n])
    };
    Ok((of(0), of(1)))
}

/// Writes a dense BRDF in another program's format: how far the file, read back, is from it.
#[pyfunction]
fn export<'py>(
    py: Python<'py>,
    dense: &Dense,
    path: PathBuf,
    format: Option<&str>,
    resolution: Option<usize>,
    assume_scale: Option<f64>,
    allow_coarse: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let format = export_format(&path, format).map_err(to_py)?;
    let resolution = match (resolution, &format.resolution) {
        (Some(n), Some(of)) if (of.least..=of.most).contains(&n) => n,
        (Some(n), Some(of)) => {
            let wanted = format!("give {} to {} {}", of.least, of.most, of.of);
            return Err(to_py(format!("resolution {n}: {wanted}")));
        }
        (Some(n), None) => {
            let size = "a file of this format has one size; leave it out";
            return Err(to_py(format!("resolution {n}: {size}")));
        }
        (None, of) => of.as_ref().map_or(0, |of| of.default),
    };
    if let Some(factor) = assume_scale.filter(|of| !(of.is_finite() && *of > 0.0)) {
        return Err(to_py(format!(
            "assume_scale {factor}: give a factor above 0"
        )));
    }
    let file = dense.file.clone();
    let (error, remarks) = run_silently(py, || {
        let source = ExportSource {
            dense: file,
            path: Path::new("the dense BRDF"),
            errors: format
                .holds_uncertainties()
                .then(|| dense.uncertainties())
                .flatten(),
            scale_by: assume_scale,
            allow_coarse,
        };
        export_file(source, &path, format, resolution)
    })?;
    let told = PyDict::new(py);
    told.set_item("format", format.name)?;
    told.set_item("median", error.median)?;
    told.set_item("p99", error.p99)?;
    told.set_item("rms", error.rms)?;
    told.set_item("lost", error.lost)?;
    told.set_item("remarks", texts(&remarks))?;
    Ok(told)
}

/// A dense BRDF as colours.
fn colours(dense: &Dense) -> PyResult<DenseFile> {
    let found = colours_of(dense.file.clone(), Path::new("the dense BRDF"));
    let (file, _) = found.ok_or_else(|| {
        to_py("the dense BRDF has planes that are not of its grid's size; make it again")
    })?;
    Ok(file)
}

/// Figures of merit of one dense BRDF against another, by part of the domain.
#[pyfunction]
fn compare<'py>(py: Python<'py>, a: &Dense, b: &Dense) -> PyResult<Bound<'py, PyDict>> {
    let (a, b) = (colours(a)?, colours(b)?);
    let options = Options {
        name_a: "a",
        name_b: "b",
        ..Options::default()
    };
    let figures = run_silently(py, || {
        compare_tables(Table::from(&a), Side::Table(Table::from(&b)), &options)
    })?;
    let strata = PyDict::new(py);
    for row in &figures.strata {
        let of = PyDict::new(py);
        of.set_item("cells", row.cells)?;
        of.set_item("log_rms", row.log_rms)?;
        of.set_item("log_mean", row.log_mean)?;
        of.set_item("cos_error_mean", row.cos_error_mean)?;
        of.set_item("cos_error_p99", row.cos_error_p99)?;
        of.set_item("delta_e", row.delta_e)?;
        strata.set_item(row.stratum.name(), of)?;
    }
    let told = PyDict::new(py);
    told.set_item("strata", strata)?;
    told.set_item("factor", figures.factor)?;
    told.set_item("sphere_delta_e", figures.sphere_delta_e)?;
    told.set_item("cylinder_delta_e", figures.cylinder_delta_e)?;
    told.set_item("text", figures.to_string())?;
    Ok(told)
}

/// A model fitted to a dense BRDF, or to the samples behind it: its numbers, and the model on the same grid.
#[pyfunction]
fn fit<'py>(
    py: Python<'py>,
    dense: &Dense,
    model: &str,
    samples: Option<&Samples>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Dense)> {
    let family: StandardFamily = model.parse().map_err(to_py)?;
    let measured = colours(dense)?;
    let family = family.for_values(measured.scale == Scale::Relative);
    let settings = FitSettings::default();
    let of_samples = samples.map(|samples| samples.values.of_channels([0, 1, 2]));
    let result = run(py, progress, |progress| {
        let cells = match of_samples {
            Some(samples) => cells_of_samples(&measured.brdf, &samples, &settings)?,
            None => cells_of_dense(&measured.brdf, &settings),
        };
        fit_model(&measured, "dense", &cells, family, &settings, progress)
    })?;
    let numbers = PyDict::new(py);
    for number in &result.note.parameters {
        let of = PyDict::new(py);
        of.set_item("value", number.value)?;
        of.set_item("u", number.uncertainty)?;
        of.set_item("unit", &number.unit)?;
        of.set_item("at_bound", number.at_bound)?;
        numbers.set_item(&number.name, of)?;
    }
    let told = PyDict::new(py);
    told.set_item("model", &result.note.model)?;
    told.set_item("parameters", numbers)?;
    told.set_item("residual_rms", result.note.residual_rms)?;
    told.set_item("converged", result.note.converged)?;
    told.set_item("sphere_delta_e", result.note.figures.sphere_delta_e)?;
    let fitted = DenseFile {
        brdf: result.dense,
        scale: measured.scale,
        provenance: measured.provenance.clone(),
    };
    let fitted = Dense {
        file: fitted.into(),
        uncertainty: None,
        account: [("fit".to_owned(), result.note.model)].into(),
        remarks: Vec::new(),
    };
    Ok((told, fitted))
}

/// A sphere or a cylinder of the material: linear light, rows from the top, and how much of each pixel it covers.
#[pyfunction]
fn render(
    py: Python<'_>,
    dense: &Dense,
    shape: &str,
    light: &str,
    px: usize,
) -> PyResult<(Values, Values)> {
    if !(1..=8192).contains(&px) {
        return Err(to_py(format!("px {px}: must lie in 1..=8192")));
    }
    let draw: fn(&dyn Brdf, &[Light], usize, usize) -> Picture = match shape {
        "sphere" => gonia_render::sphere,
        "cylinder" => gonia_render::cylinder,
        other => {
            return Err(to_py(format!(
                "shape \"{other}\": give \"sphere\" or \"cylinder\""
            )));
        }
    };
    let lights = match light {
        "sky" => gonia_render::Environment::sky().lights(512),
        "above" => gonia_render::single(),
        "studio" => gonia_render::studio(),
        other => {
            return Err(to_py(format!(
                "light \"{other}\": give \"sky\", \"above\" or \"studio\""
            )));
        }
    };
    let file = colours(dense)?;
    let picture = run_silently(py, || {
        let brdf = Tabulated::new(&file.brdf);
        Ok::<_, FileError>(draw(&brdf, &lights, px, 1).with_smooth_outline())
    })?;
    let (height, width) = (picture.height, picture.width);
    let rgb = picture.rgb.iter().flatten().copied().collect();
    Ok((
        Values::new(rgb, vec![height, width, 3]),
        Values::new(picture.cover, vec![height, width]),
    ))
}

/// So many threads work from now on; once, before anything is done.
#[pyfunction]
fn set_threads(n: usize) -> PyResult<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n);
    pool.build_global().map_err(|_| {
        to_py("threads: they are at work already; call gonia.set_threads before anything else, or set RAYON_NUM_THREADS")
    })
}
