//! The Windows program on this machine: built with MinGW, run under Wine, and its results compared
//! with those of the Linux program.

use crate::doors::metadata;
use crate::systems::WINDOWS;
use crate::tools::{add_targets, cargo, install, root, run};
use anyhow::{Context, Result, bail};
use std::path::Path;
use std::process::Command;

/// What is needed, and the Debian package of it.
const PROGRAMS: [(&str, &str); 2] = [
    ("x86_64-w64-mingw32-gcc", "gcc-mingw-w64-x86-64"),
    ("wine", "wine"),
];

/// What the demo leaves behind that is the same, byte for byte.
const RESULTS: [&str; 2] = ["samples.npy", "dense.exr"];

/// Runs the demo on both systems and fails where their results differ.
pub fn compare_with_linux() -> Result<()> {
    for (program, package) in PROGRAMS {
        if !install(program, package) {
            bail!("{program} is missing: apt-get install {package}");
        }
    }
    add_targets(&[WINDOWS.to_owned()])?;
    let root = root()?;
    let build = ["build", "--release", "--package", "gonia"];
    run(cargo(&root).args(build))?;
    run(cargo(&root).args(build).args(["--target", WINDOWS]))?;

    let metadata = metadata(&root)?;
    let target = metadata["target_directory"].as_str();
    let target = Path::new(target.context("cargo metadata: no target_directory")?);
    let folder = target.join("windows");
    for system in ["on-linux", "on-windows"] {
        let old = folder.join(system);
        if old.exists() {
            std::fs::remove_dir_all(&old).with_context(|| format!("{}", old.display()))?;
        }
    }
    std::fs::create_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
    let mut linux = Command::new(target.join("release/gonia"));
    let built = target.join(WINDOWS).join("release");
    let mut windows = wine(&folder, &built)?;
    windows.arg(built.join("gonia.exe"));
    for (command, out) in [(&mut linux, "on-linux"), (&mut windows, "on-windows")] {
        run(command
            .current_dir(&folder)
            .args(["demo", "--quick", "--out", out]))?;
    }

    for name in RESULTS {
        let files = ["on-linux", "on-windows"].map(|system| folder.join(system).join(name));
        run(Command::new("sha256sum").args(&files))?;
        same_bytes(&files[0], &files[1])?;
    }
    println!(
        "the same bytes on Linux and Windows: {}",
        RESULTS.join(", ")
    );
    Ok(())
}

/// Wine with a Windows of its own below a folder, and what it lacks beside the programs.
fn wine(folder: &Path, programs: &Path) -> Result<Command> {
    let prefix = folder.join("wine");
    let command = |name: &str| {
        let mut command = Command::new(name);
        command.env("WINEPREFIX", &prefix).env("WINEDEBUG", "-all");
        command
    };
    let system = prefix.join("drive_c/windows/system32");
    if !system.exists() {
        run(command("wineboot").arg("--init"))?;
    }
    if !system.join("bcryptprimitives.dll").exists() {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/bcryptprimitives.c");
        run(Command::new(PROGRAMS[0].0)
            .args(["-O2", "-shared", "-o"])
            .arg(programs.join("bcryptprimitives.dll"))
            .arg(source)
            .arg("-ladvapi32"))?;
    }
    Ok(command("wine"))
}

/// Fails when two files differ, and says where first.
fn same_bytes(one: &Path, other: &Path) -> Result<()> {
    let read = |file: &Path| std::fs::read(file).with_context(|| format!("{}", file.display()));
    let (a, b) = (read(one)?, read(other)?);
    let differs = a.iter().zip(&b).position(|(a, b)| a != b);
    let shorter = (a.len() != b.len()).then_some(a.len().min(b.len()));
    if let Some(at) = differs.or(shorter) {
        bail!(
            "{} and {} differ from byte {at} on ({} and {} bytes); find what the systems compute differently",
            one.display(),
            other.display(),
            a.len(),
            b.len()
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_named() {
        let folder = std::env::temp_dir().join(format!("gonia-bytes-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.join(name), bytes).unwrap();
            folder.join(name)
        };
        let (a, b) = (file("a", b"samples"), file("b", b"samPles"));
        let (short, same) = (file("short", b"samp"), file("same", b"samples"));
        let at = |x: &Path, y: &Path| same_bytes(x, y).map_err(|e| format!("{e:#}"));
        let (differs, cut, alike) = (at(&a, &b), at(&a, &short), at(&a, &same));
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(differs.unwrap_err().contains("from byte 3 on"));
        assert!(cut.unwrap_err().contains("from byte 4 on (7 and 4 bytes)"));
        assert_eq!(alike, Ok(()));
    }
}
