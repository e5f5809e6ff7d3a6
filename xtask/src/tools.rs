//! Programs that the chores need beside Rust, and how to get them on Debian and Ubuntu.

use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The repository's folder.
pub fn root() -> Result<PathBuf> {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .map(Path::to_path_buf)
        .context("xtask has no parent folder")
}

/// Cargo in a folder. Workspaces of their own (boards, fuzz targets) do not get what was set for the
/// outer one: they choose their own target and flags.
pub fn cargo(folder: &Path) -> Command {
    let mut command = Command::new("cargo");
    command.current_dir(folder);
    if root().is_ok_and(|root| root != folder) {
        for name in ["CARGO_TARGET_DIR", "CARGO_BUILD_TARGET", "RUSTFLAGS"] {
            command.env_remove(name);
        }
    }
    command
}

/// Whether a program is there and answers to `--version`.
pub fn has(program: &str) -> bool {
    succeeds(Command::new(program).arg("--version"))
}

/// Whether a command succeeds; what it prints is not shown.
fn succeeds(command: &mut Command) -> bool {
    let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
    quiet.status().is_ok_and(|status| status.success())
}

/// Adds targets to the toolchain.
pub fn add_targets(targets: &[String]) -> Result<()> {
    if !has("rustup") {
        bail!(
            "rustup is missing; install it, or add these targets by hand: {}",
            targets.join(" ")
        );
    }
    run(Command::new("rustup").args(["target", "add"]).args(targets))
}

/// Installs a Debian package when this user may; whether `program` is there afterwards.
pub fn install(program: &str, package: &str) -> bool {
    if !has(program) {
        apt_get(&[package]);
    }
    has(program)
}

/// Installs what a C library needs when this user may; whether it is there afterwards, for builds.
pub fn install_library(name: &str, packages: &[&str]) -> bool {
    let has_it = || succeeds(Command::new("pkg-config").args(["--exists", name]));
    if !has_it() {
        apt_get(packages);
    }
    has_it()
}

/// Installs Debian packages when this user may.
pub fn apt_get(packages: &[&str]) {
    let id = Command::new("id").arg("-u").output();
    if !id.is_ok_and(|o| o.stdout.trim_ascii() == b"0") || !has("apt-get") {
        return;
    }
    println!("installing {}", packages.join(" "));
    let quiet = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        command.arg("-qq").args(arguments);
        let command = command.env("DEBIAN_FRONTEND", "noninteractive");
        command
            .stdout(Stdio::null())
            .status()
            .is_ok_and(|s| s.success())
    };
    if quiet(&["update"]) {
        quiet(&[&["install", "--no-install-recommends", "-y"], packages].concat());
    }
}

/// Runs a command, its output going where ours goes.
pub fn run(command: &mut Command) -> Result<()> {
    let line = format!("{command:?}").replace('"', "");
    let status = command
        .status()
        .with_context(|| format!("cannot start: {line}"))?;
    if !status.success() {
        bail!("failed ({status}): {line}");
    }
    Ok(())
}

/// A Python of its own in a folder, with packages from PyPI (`name==version`); made where it is not yet.
pub fn python_with(folder: &Path, packages: &[&str]) -> Result<PathBuf> {
    if !install("python3", "python3-venv") {
        bail!("python3 is missing: apt-get install python3-venv");
    }
    let python = folder.join("bin/python");
    if !python.exists() {
        run(Command::new("python3").args(["-m", "venv"]).arg(folder))?;
    }
    let pip = ["-m", "pip", "install", "--quiet"];
    run(Command::new(&python).args(pip).args(packages))?;
    Ok(python)
}
