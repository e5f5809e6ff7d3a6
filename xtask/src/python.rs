//! The Python package, built as `pip install ./host/python` builds it and tested by pytest, in a folder of its own.

use crate::tools::{cargo, python_with, root, run};
use anyhow::Result;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What builds and tests it, at the versions that it was tried with.
const PACKAGES: [&str; 10] = [
    "maturin==1.16.0",
    "pytest==9.2.0",
    "numpy==2.4.6",
    "xarray==2026.9.0",
    "zarr==3.1.6",
    "dask==2026.8.0",
    "distributed==2026.8.0",
    "dask-jobqueue==0.9.0",
    "nbclient==0.11.0",
    "ipykernel==7.4.0",
];

/// Builds the package in the profile of the tests, and runs its tests beside the command's.
pub fn check() -> Result<()> {
    let root = root()?;
    run(cargo(&root).args(["build", "--package", "gonia"]))?;
    check_with(&root, &python(&root)?)
}

/// A Python that has what it needs.
pub fn python(root: &Path) -> Result<PathBuf> {
    python_with(&root.join("target/python"), &PACKAGES)
}

/// As [`check`], of a command that is built, with such a Python.
pub fn check_with(root: &Path, python: &Path) -> Result<()> {
    let folder = root.join("target/python");
    let package = root.join("host/python");
    run(Command::new(folder.join("bin/maturin"))
        .args(["develop", "--quiet", "--profile", "dev", "--manifest-path"])
        .arg(package.join("Cargo.toml"))
        .env("VIRTUAL_ENV", &folder)
        .env("CARGO_TARGET_DIR", root.join("target")))?;
    run(Command::new(python)
        .args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider"])
        .arg(package.join("tests"))
        .env("GONIA", root.join("target/debug/gonia")))
}
