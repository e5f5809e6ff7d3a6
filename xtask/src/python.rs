//! The Python package, built as `pip install ./host/python` builds it and tested by pytest, in a folder of its own.

use crate::tools::{cargo, install, root, run};
use anyhow::{Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What builds and tests it, at the versions that it was tried with.
const PACKAGES: [&str; 4] = [
    "maturin==1.16.0",
    "pytest==9.2.0",
    "numpy==2.4.6",
    "xarray==2026.9.0",
];

/// Builds the package in the profile of the tests, and runs its tests beside the command's.
pub fn check() -> Result<()> {
    if !install("python3", "python3-venv") {
        bail!("python3 is missing: apt-get install python3-venv");
    }
    let root = root()?;
    run(cargo(&root).args(["build", "--package", "gonia"]))?;
    let folder = root.join("target/python");
    let python = environment(&folder)?;
    let package = root.join("host/python");
    run(Command::new(folder.join("bin/maturin"))
        .args(["develop", "--profile", "dev", "--manifest-path"])
        .arg(package.join("Cargo.toml"))
        .env("VIRTUAL_ENV", &folder)
        .env("CARGO_TARGET_DIR", root.join("target")))?;
    run(Command::new(python)
        .args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider"])
        .arg(package.join("tests"))
        .env("GONIA", root.join("target/debug/gonia")))
}

/// Python with the packages, made where it is not yet.
fn environment(folder: &Path) -> Result<PathBuf> {
    let python = folder.join("bin/python");
    if !python.exists() {
        run(Command::new("python3").args(["-m", "venv"]).arg(folder))?;
    }
    let pip = ["-m", "pip", "install", "--quiet"];
    run(Command::new(&python).args(pip).args(PACKAGES))?;
    Ok(python)
}
