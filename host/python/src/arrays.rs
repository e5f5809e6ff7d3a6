//! Numbers from and to numpy, by the buffer protocol (copied) and by the array interface (not copied).

use crate::to_py;
use pyo3::buffer::PyBuffer;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// The rows of a C-contiguous array of float64 of two dimensions, which `python/gonia` has made of what it was given.
pub fn rows_of(array: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, usize)> {
    let buffer = PyBuffer::<f64>::get(array)?;
    let &[_, columns] = buffer.shape() else {
        return Err(to_py(
            "the array has not two dimensions; give rows of numbers",
        ));
    };
    Ok((buffer.to_vec(array.py())?, columns))
}

/// Values that Python sees without a copy: numpy's array interface. They live as long as anybody looks at them.
#[pyclass(frozen, module = "gonia._gonia")]
pub struct Values {
    values: Vec<f32>,
    shape: Vec<usize>,
}

impl Values {
    /// Of `shape`, the last index running fastest.
    pub fn new(values: Vec<f32>, shape: Vec<usize>) -> Self {
        Self { values, shape }
    }
}

#[pymethods]
impl Values {
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        interface(py, &self.values, &self.shape)
    }
}

/// The array interface of float32 values that stay where they are: read-only.
pub fn interface<'py>(
    py: Python<'py>,
    values: &[f32],
    shape: &[usize],
) -> PyResult<Bound<'py, PyDict>> {
    let told = PyDict::new(py);
    told.set_item("version", 3)?;
    told.set_item(
        "typestr",
        if cfg!(target_endian = "big") {
            ">f4"
        } else {
            "<f4"
        },
    )?;
    told.set_item("shape", PyTuple::new(py, shape)?)?;
    told.set_item("data", (values.as_ptr() as usize, true))?;
    Ok(told)
}
