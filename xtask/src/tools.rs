//! Programs that the tests need beside Rust, and how to get them on Debian and Ubuntu.

use anyhow::{Context, Result, bail};
use std::process::{Command, Stdio};

/// The boards' target.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Whether a program is there and answers to `--version`.
pub fn has(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|s| s.success())
}

/// Adds the boards' target to the toolchain.
pub fn add_target() -> Result<()> {
    if !has("rustup") {
        bail!(
            "rustup is not there to add the target {TARGET}: install it, or add the target by hand"
        );
    }
    run(Command::new("rustup").args(["target", "add", TARGET]))
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
    let has_it = || {
        Command::new("pkg-config")
            .args(["--exists", name])
            .status()
            .is_ok_and(|s| s.success())
    };
    if !has_it() {
        apt_get(packages);
    }
    has_it()
}

/// Installs Debian packages when this user may.
fn apt_get(packages: &[&str]) {
    let root = Command::new("id")
        .arg("-u")
        .output()
        .is_ok_and(|o| o.stdout.trim_ascii() == b"0");
    if root && has("apt-get") {
        println!("installing {}", packages.join(" "));
        let quiet = |arguments: &[&str]| {
            Command::new("apt-get")
                .args(arguments)
                .env("DEBIAN_FRONTEND", "noninteractive")
                .stdout(Stdio::null())
                .status()
                .is_ok_and(|s| s.success())
        };
        if quiet(&["-qq", "update"]) {
            quiet(
                &[
                    &["-qq", "install", "--no-install-recommends", "-y"],
                    packages,
                ]
                .concat(),
            );
        }
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
