//! A dense BRDF, whose values Python sees without a copy.

use crate::arrays::{Values, interface, rows_of};
use crate::run::run_silently;
use crate::to_py;
use gonia_brdf::Direction;
use gonia_formats::checksum;
use gonia_formats::dense::ChannelErrors;
use gonia_formats::dense::{
    CombineErrors, ERRORS_OF, are_errors_of, read_dense_channels, read_origins,
    write_dense_channels, write_error_bars,
};
use gonia_pipeline::budget::{UNCERTAINTIES, budget_in, combine_errors};
use gonia_rig::DenseChannels;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Standard uncertainties of a dense BRDF's cells.
pub struct Uncertainty {
    /// Combined, a plane a channel, in the unit of the values.
    pub planes: Vec<Vec<f32>>,
    /// Where each cell's value is from; empty where that is not known.
    pub origins: Vec<u8>,
    /// Those of noise and interpolation alone, where they were made here: they are what a file is written from.
    pub noise: Option<ChannelErrors>,
}

/// A dense BRDF.
#[pyclass(frozen, module = "gonia._gonia")]
pub struct Dense {
    pub file: DenseChannels,
    pub uncertainty: Option<Uncertainty>,
    /// What was done, by name.
    pub account: BTreeMap<String, String>,
    pub remarks: Vec<String>,
}

impl Dense {
    /// Its uncertainties as a table of their own, where they are known.
    pub fn uncertainties(&self) -> Option<DenseChannels> {
        let uncertainty = self.uncertainty.as_ref()?;
        Some(DenseChannels {
            planes: uncertainty.planes.clone(),
            provenance: self.facts_of_errors(),
            channels: self.file.channels.clone(),
            ..self.file
        })
    }

    /// Provenance of its uncertainties.
    fn facts_of_errors(&self) -> BTreeMap<String, String> {
        let mut facts = self.file.provenance.clone();
        facts.insert(ERRORS_OF.to_owned(), checksum::of_channels(&self.file));
        facts
    }
}

#[pymethods]
impl Dense {
    /// Reads a dense BRDF, and its uncertainties from a second file where one is given.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, error: Option<PathBuf>) -> PyResult<Self> {
        let file = run_silently(py, || read_dense_channels(&path))?;
        let uncertainty = error.map(|error| {
            let (planes, origins) = run_silently(py, || {
                let bars = read_dense_channels(&error)?;
                Ok::<_, gonia_formats::FileError>((bars, read_origins(&error)?))
            })?;
            if !are_errors_of((planes.grid, &planes.channels, &planes.provenance), &file) {
                return Err(to_py(format!(
                    "{}: is not of the values of {}; give the error bars that were written with it (gonia fill --error)",
                    error.display(),
                    path.display()
                )));
            }
            Ok(Uncertainty {
                planes: planes.planes,
                origins: origins.unwrap_or_default(),
                noise: None,
            })
        });
        Ok(Self {
            file,
            uncertainty: uncertainty.transpose()?,
            account: BTreeMap::new(),
            remarks: Vec::new(),
        })
    }

    /// Writes it, and its uncertainties under a second name.
    fn save(&self, py: Python<'_>, path: PathBuf, error: Option<PathBuf>) -> PyResult<()> {
        run_silently(py, || write_dense_channels(&path, &self.file))?;
        let Some(error) = error else {
            return Ok(());
        };
        let noise = self.uncertainty.as_ref().and_then(|u| u.noise.clone());
        let noise = noise.ok_or_else(|| {
            to_py(format!(
                "{}: the dense BRDF was not filled with error=True here; fill it so, or copy the file of its error bars",
                error.display()
            ))
        })?;
        let budget = budget_in(&self.file.provenance).map_err(to_py)?;
        let mut facts = self.facts_of_errors();
        run_silently(py, || {
            let combine = budget.as_ref().and_then(|budget| {
                facts.insert(UNCERTAINTIES.to_owned(), budget.to_string());
                combine_errors(self.file.grid, &self.file.planes, &noise.origin, budget)
            });
            let combine = combine.as_ref().map(|of| of as &CombineErrors<'_>);
            let (grid, scale) = (self.file.grid, self.file.scale);
            write_error_bars(&error, grid, noise, combine, scale, &facts)
        })
    }

    /// A plane of values, or of uncertainties: an object that numpy looks into.
    fn plane(slf: Bound<'_, Self>, channel: usize, of_uncertainty: bool) -> PyResult<Plane> {
        let dense = slf.get();
        let there = match (&dense.uncertainty, of_uncertainty) {
            (_, false) => dense.file.planes.len(),
            (Some(u), true) => u.planes.len(),
            (None, true) => 0,
        };
        if channel >= there {
            return Err(to_py("there is no such channel"));
        }
        Ok(Plane {
            dense: slf.unbind(),
            channel,
            of_uncertainty,
        })
    }

    /// Values between the nodes at rows of theta_i, phi_i, theta_v, phi_v (degrees): a column a channel.
    fn query(&self, py: Python<'_>, rows: &Bound<'_, PyAny>) -> PyResult<Values> {
        let pairs = pairs_of(rows)?;
        let values: Vec<f32> = py.detach(|| {
            let values = pairs
                .iter()
                .flat_map(|(light, view)| self.file.lookup(*light, *view));
            values.collect()
        });
        Ok(Values::new(
            values,
            vec![pairs.len(), self.file.planes.len()],
        ))
    }

    /// Where each cell's value is from, if that is known.
    #[getter]
    fn origins(&self) -> Option<Vec<u8>> {
        let origins = self.uncertainty.as_ref().map(|u| u.origins.clone());
        origins.filter(|origins| !origins.is_empty())
    }

    #[getter]
    fn has_uncertainty(&self) -> bool {
        self.uncertainty.is_some()
    }

    #[getter]
    fn step(&self) -> f64 {
        self.file.grid.step_deg()
    }

    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.file.grid.n_theta(), self.file.grid.n_phi())
    }

    #[getter]
    fn channels(&self) -> Vec<String> {
        self.file.channels.names()
    }

    #[getter]
    fn scale(&self) -> String {
        self.file.scale.to_string()
    }

    #[getter]
    fn provenance(&self) -> BTreeMap<String, String> {
        self.file.provenance.clone()
    }

    #[getter]
    fn account(&self) -> BTreeMap<String, String> {
        self.account.clone()
    }

    #[getter]
    fn remarks(&self) -> Vec<String> {
        self.remarks.clone()
    }
}

/// Pairs of directions from rows of theta_i, phi_i, theta_v, phi_v, degrees.
pub fn pairs_of(rows: &Bound<'_, PyAny>) -> PyResult<Vec<(Direction, Direction)>> {
    let (numbers, columns) = rows_of(rows)?;
    if columns != 4 {
        return Err(to_py(format!(
            "directions: {columns} columns; four are needed: theta_i, phi_i, theta_v, phi_v in degrees"
        )));
    }
    let rows = numbers.chunks_exact(4).enumerate();
    rows.map(|(k, row)| {
        let is_sound = |n: f64| (0.0..=90.0).contains(&n);
        if !row.iter().all(|n| n.is_finite()) || !is_sound(row[0]) || !is_sound(row[2]) {
            return Err(to_py(format!(
                "directions: row {k} is {row:?}; give finite angles in degrees, polar angles from 0 to 90"
            )));
        }
        Ok((
            Direction::from_deg(row[0], row[1]),
            Direction::from_deg(row[2], row[3]),
        ))
    })
    .collect()
}

/// A channel of a dense BRDF, which keeps it alive.
#[pyclass(frozen, module = "gonia._gonia")]
pub struct Plane {
    dense: Py<Dense>,
    channel: usize,
    of_uncertainty: bool,
}

#[pymethods]
impl Plane {
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dense = self.dense.get();
        let planes = match (&dense.uncertainty, self.of_uncertainty) {
            (Some(u), true) => &u.planes,
            _ => &dense.file.planes,
        };
        let (n_theta, n_phi) = dense.shape();
        interface(py, &planes[self.channel], &[n_theta, n_phi, n_theta, n_phi])
    }
}
