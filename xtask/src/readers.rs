//! Other people's programs read what `gonia export` writes: they come from PyPI into a folder of their own.

use crate::tools::{apt_get, cargo, install, root, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the scripts in `tests/readers` import, at the versions that they were tried with.
const PACKAGES: [&str; 7] = [
    "mitsuba==3.9.1",
    "netCDF4==1.7.5.1.post1",
    "numpy==2.4.6",
    "OpenEXR==3.5.3",
    "pyradiance==1.3.1",
    "xarray==2026.9.0",
    "zarr==3.1.6",
];

/// Each reader's script, in `tests/readers`.
const SCRIPTS: [&str; 3] = ["mitsuba_bsdf.py", "radiance_xml.py", "arrays.py"];

/// Has every reader read what gonia exports, and fails where one reads something else.
pub fn check() -> Result<()> {
    if !install("python3", "python3-venv") {
        bail!("python3 is missing: apt-get install python3-venv");
    }
    let root = root()?;
    run(cargo(&root).args(["build", "--package", "gonia"]))?;
    let python = environment(&root.join("target/readers"))?;
    // Mitsuba compiles for many values at a time by LLVM.
    let llvm = llvm().context("libLLVM is missing: apt-get install libllvm19")?;
    for script in SCRIPTS {
        println!("== {script}");
        run(Command::new(&python)
            .arg(root.join("tests/readers").join(script))
            .arg(root.join("target/debug/gonia"))
            .env("DRJIT_LIBLLVM_PATH", &llvm))?;
    }
    Ok(())
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
