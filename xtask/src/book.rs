//! The book in docs/.

use crate::links;
use crate::tools::{has, root, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The mdBook that the book is built with.
pub const MDBOOK: &str = "0.5.4";

/// Checks the links, installs mdBook where it is missing, and builds the book into docs/book.
pub fn book() -> Result<()> {
    let root = root()?;
    links::check(&root)?;
    let program = match installed(&root) {
        Some(program) => program,
        None => {
            let tools = tools(&root);
            let package = format!("mdbook@{MDBOOK}");
            println!("installing {package} in {}", tools.display());
            let mut command = Command::new("cargo");
            command.args(["install", "--locked", "--root"]).arg(&tools);
            run(command.args(["--no-default-features", "--features", "search", &package]))?;
            tools.join("bin/mdbook")
        }
    };
    build(&root, &program)
}

/// mdBook, if it is there: on the path, or installed by this chore.
pub fn installed(root: &Path) -> Option<PathBuf> {
    let ours = tools(root).join("bin/mdbook");
    if ours.is_file() {
        return Some(ours);
    }
    has("mdbook").then(|| "mdbook".into())
}

fn tools(root: &Path) -> PathBuf {
    root.join("target/tools")
}

/// Builds the book; a warning is a failure.
pub fn build(root: &Path, program: &Path) -> Result<()> {
    let mut command = Command::new(program);
    let command = command.arg("build").arg(root.join("docs"));
    let output = command
        .output()
        .with_context(|| format!("{}", program.display()))?;
    let said = String::from_utf8_lossy(&output.stderr);
    eprint!("{said}");
    if !output.status.success() || says_wrong(&said) {
        bail!("mdBook is not content with docs/; correct what it names above");
    }
    println!("docs/book/index.html");
    Ok(())
}

/// Whether mdBook's log has a warning or an error.
fn says_wrong(log: &str) -> bool {
    let mut words = log
        .split_whitespace()
        .map(|word| word.trim_matches(['[', ']']));
    words.any(|word| ["WARN", "ERROR"].contains(&word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_in_the_log_is_seen_in_both_of_its_forms() {
        assert!(says_wrong(" WARN no such file"));
        assert!(says_wrong(
            "2026-01-01 00:00:00 [ERROR] (mdbook::utils): no"
        ));
        assert!(!says_wrong(" INFO Book building has started"));
    }
}
