//! libFuzzer on the protocol, with the stable compiler: its sources come with `libfuzzer-sys` and
//! take a C++ compiler; coverage is a pass of LLVM that every rustc has.

use crate::tools::{has, run};
use anyhow::{Context, Result};
use std::path::Path;
use std::process::Command;

/// What is let loose: bytes on the decoder, a hostile wire on both ends of the link, frames and
/// sensors on a whole controller.
pub const TARGETS: [&str; 3] = ["decoder", "link", "node"];

/// What the fuzzer needs of the compiler: edges and comparisons counted, overflows found.
const FLAGS: &str = "--cfg fuzzing -Cpasses=sancov-module \
    -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares \
    -Cdebug-assertions=yes -Coverflow-checks=yes -Ccodegen-units=1";

/// Why it cannot run here, if it cannot.
pub fn missing() -> Option<&'static str> {
    let is_there = has("c++");
    (!is_there).then_some("a C++ compiler is missing: apt-get install g++")
}

/// Builds every target.
pub fn build(root: &Path) -> Result<()> {
    run(Command::new("cargo")
        .args(["build", "--release", "--target", &host()?])
        .current_dir(root.join("protocol/fuzz"))
        .env_remove("CARGO_TARGET_DIR")
        .env("RUSTFLAGS", FLAGS))
}

/// Runs a target for so many seconds. What breaks it is kept in `protocol/fuzz/target`.
pub fn run_target(root: &Path, target: &str, seconds: u32) -> Result<()> {
    let folder = root.join("protocol/fuzz");
    let built = folder.join("target").join(host()?).join("release");
    let mut command = Command::new(built.join(target));
    command.current_dir(folder.join("target"));
    command.arg(format!("-max_total_time={seconds}"));
    run(command.args(["-verbosity=0", "-print_final_stats=1"]))
}

/// The machine that this compiler is for. Flags for another target than the default one leave build
/// scripts alone.
fn host() -> Result<String> {
    let output = Command::new("rustc").arg("-vV").output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc -vV does not name its host")?.to_owned())
}
