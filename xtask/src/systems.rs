//! Windows and macOS: what can be known about them from here.

use crate::table::Table;
use crate::tools::{add_targets, cargo, run};
use anyhow::Result;
use std::path::Path;

/// Windows, as it is built for.
pub const WINDOWS: &str = "x86_64-pc-windows-gnu";
/// macOS, as it is built for.
pub const MACOS: &str = "aarch64-apple-darwin";

/// Lints everything for the other systems, tests and benches too; without the feature `genicam`, as most
/// people build it here as well. Nothing is linked, so that no compiler of theirs is needed.
pub fn check(table: &mut Table, root: &Path, targets: &[&str]) -> Result<()> {
    let mut arguments = vec!["clippy", "--workspace", "--all-targets"];
    let mut systems = Vec::new();
    for target in targets {
        if let Err(error) = add_targets(&[(*target).to_owned()]) {
            table.not_run(&format!("compiles for {target}"), &format!("{error:#}"));
            continue;
        }
        arguments.extend(["--target", target]);
        systems.push(*target);
    }
    if systems.is_empty() {
        return Ok(());
    }
    arguments.extend(["--", "-D", "warnings"]);
    // In one go: neither waits for the last crate of the other.
    let name = format!("compiles for {}", systems.join(" and "));
    table.step(&name, || run(cargo(root).args(arguments)))
}
