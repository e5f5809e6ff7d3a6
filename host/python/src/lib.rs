//! The compiled half of the Python package `gonia`: `python/gonia` calls it, and is what users see.
//!
//! | module | what it holds |
//! |---|---|
//! | `run` | long work beside Python: progress, Ctrl-C, the interpreter's lock released |
//! | `arrays` | numbers from and to numpy |
//! | `samples`, `dense` | the two kinds of data |
//! | `calls` | what is done with them |
//! | `shared` | the same by several processes |

mod arrays;
mod calls;
mod dense;
mod run;
mod samples;
mod shared;

use pyo3::prelude::*;

pyo3::create_exception!(
    gonia,
    GoniaError,
    pyo3::exceptions::PyException,
    "What is wrong, where, what was found and what to do, in one line."
);

/// An error of gonia's as Python's.
fn to_py(error: impl std::fmt::Display) -> PyErr {
    GoniaError::new_err(error.to_string())
}

/// What `python/gonia` imports.
#[pymodule]
fn _gonia(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("GoniaError", module.py().get_type::<GoniaError>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<samples::Samples>()?;
    module.add_class::<dense::Dense>()?;
    shared::add_to(module)?;
    calls::add_to(module)
}
