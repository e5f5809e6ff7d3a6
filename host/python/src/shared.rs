//! Work that several processes share: a fill through a folder, and frames by shares.

use crate::calls::{Filling, samples_of, texts};
use crate::run::{run, run_silently};
use crate::samples::Samples;
use crate::to_py;
use gonia_formats::CaptureFolder;
use gonia_pipeline::process::sample_share as share_of;
use gonia_pipeline::{Begun, Error, FillInParts, samples_of_shares};
use gonia_rig::Scale;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;

/// Adds the class and the functions.
pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<SharedFill>()?;
    module.add_function(wrap_pyfunction!(begin_fill, module)?)?;
    module.add_function(wrap_pyfunction!(frames_in, module)?)?;
    module.add_function(wrap_pyfunction!(sample_share, module)?)?;
    module.add_function(wrap_pyfunction!(process_shares, module)?)
}

/// A fill in a folder that several processes see.
#[pyclass(frozen, module = "gonia._gonia")]
pub struct SharedFill {
    fill: FillInParts,
    #[pyo3(get)]
    remarks: Vec<String>,
}

/// Begins a fill in a new folder; None where a fit of few samples makes it, which is no work to share.
#[pyfunction]
fn begin_fill(
    py: Python<'_>,
    samples: &Samples,
    how: Filling,
    folder: PathBuf,
) -> PyResult<Option<SharedFill>> {
    let options = how.options()?;
    let values = samples.values.clone();
    let scale = samples.scale.unwrap_or(Scale::Relative);
    let begun = run(py, None, |progress| {
        FillInParts::begin(
            values,
            scale,
            &options,
            &folder,
            &samples.provenance,
            progress,
        )
    })?;
    Ok(match begun {
        Begun::OneFit => None,
        Begun::Parts { fill, remarks } => Some(SharedFill {
            fill: *fill,
            remarks: texts(&remarks),
        }),
    })
}

#[pymethods]
impl SharedFill {
    /// One that was begun.
    #[staticmethod]
    fn open(folder: PathBuf) -> PyResult<Self> {
        let fill = FillInParts::open(&folder).map_err(to_py)?;
        let remarks = Vec::new();
        Ok(Self { fill, remarks })
    }

    /// Groups of channels, patches of each, bands of each.
    #[getter]
    fn parts(&self) -> (usize, usize, usize) {
        (self.fill.groups(), self.fill.patches(), self.fill.bands())
    }

    /// Solves some patches of a group.
    fn solve(&self, py: Python<'_>, group: usize, first: usize, end: usize) -> PyResult<()> {
        run(py, None, |progress| {
            self.fill.solve(group, first..end, progress)
        })
    }

    /// Writes a band of a group.
    fn write(&self, py: Python<'_>, group: usize, band: usize) -> PyResult<()> {
        run(py, None, |progress| self.fill.write(group, band, progress))
    }

    /// Gives the table its name.
    fn finish(&self, py: Python<'_>, output: PathBuf) -> PyResult<()> {
        run_silently(py, || self.fill.finish(&output))
    }
}

/// How many frames a capture folder has, those of the reference included.
#[pyfunction]
fn frames_in(folder: PathBuf) -> PyResult<usize> {
    let folder = CaptureFolder::open(&folder).map_err(to_py)?;
    Ok(folder.rows().len())
}

/// Samples some frames of a capture folder: bytes for `process_shares`.
#[pyfunction]
fn sample_share<'py>(
    py: Python<'py>,
    folder: PathBuf,
    first: usize,
    end: usize,
) -> PyResult<Bound<'py, PyBytes>> {
    let share = run_silently(py, || {
        let folder = CaptureFolder::open(&folder)?;
        share_of(folder.rig(), &folder, first..end).map_err(Error::from)
    })?;
    Ok(PyBytes::new(py, &share))
}

/// Samples of a capture folder of which shares were sampled elsewhere.
#[pyfunction]
fn process_shares(py: Python<'_>, folder: PathBuf, shares: Vec<Vec<u8>>) -> PyResult<Samples> {
    let (processed, rig) = run(py, None, |progress| {
        let of = CaptureFolder::open(&folder)?;
        let processed = samples_of_shares(&of, &shares, progress)?;
        Ok::<_, Error>((processed, of.rig().clone()))
    })?;
    Ok(samples_of(processed, &rig, &folder))
}
