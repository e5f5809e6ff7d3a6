//! Other people's programs read what `gonia export` writes: they come from PyPI into a folder of their own.

use crate::tools::{apt_get, cargo, python_with, root, run};
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the scripts in `tests/readers` import, at the versions that they were tried with.
const PACKAGES: [&str; 9] = [
    "MaterialX==1.39.5",
    "jsonschema==4.26.0",
    "mitsuba==3.9.1",
    "netCDF4==1.7.5.1.post1",
    "numpy==2.4.6",
    "OpenEXR==3.5.3",
    "pyradiance==1.3.1",
    "xarray==2026.9.0",
    "zarr==3.1.6",
];

/// Each reader's script, in `tests/readers`.
const SCRIPTS: [&str; 6] = [
    "mitsuba_bsdf.py",
    "mitsuba_sphere.py",
    "radiance_xml.py",
    "arrays.py",
    "materials.py",
    "bird.py",
];

/// Has every reader read what gonia exports, and fails where one reads something else.
pub fn check() -> Result<()> {
    let root = root()?;
    run(cargo(&root).args(["build", "--package", "gonia"]))?;
    check_with(&root, &python(&root)?)
}

/// A Python that has the readers.
pub fn python(root: &Path) -> Result<PathBuf> {
    python_with(&root.join("target/readers"), &PACKAGES)
}

/// As [`check`], of a command that is built, with such a Python.
pub fn check_with(root: &Path, python: &Path) -> Result<()> {
    // Mitsuba compiles for many values at a time by LLVM.
    let llvm = llvm().context("libLLVM is missing: apt-get install libllvm19")?;
    for script in SCRIPTS {
        println!("== {script}");
        run(Command::new(python)
            .arg(root.join("tests/readers").join(script))
            .arg(root.join("target/debug/gonia"))
            .env("DRJIT_LIBLLVM_PATH", &llvm))?;
    }
    Ok(())
}

/// LLVM's library, the newest that is there.
fn llvm() -> Option<PathBuf> {
    let find = || {
        let folder = std::fs::read_dir("/usr/lib/x86_64-linux-gnu").ok()?;
        let names = folder.flatten().map(|entry| entry.path());
        let is_llvm = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with("libLLVM") && name.contains(".so")
        };
        names.filter(is_llvm).max()
    };
    find().or_else(|| {
        apt_get(&["libllvm19"]);
        find()
    })
}
