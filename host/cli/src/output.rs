//! Whether an output can be written, before the work that makes it.

use anyhow::{Result, bail};
use gonia_formats::check_output;
use std::path::Path;

/// Checks the name of a picture: one of some endings, none of the inputs, and in a folder that can be
/// written to.
///
/// # Errors
/// One line that names it, and what to do.
pub fn check_picture(path: &Path, endings: &[&str], inputs: &[&Path]) -> Result<()> {
    if !endings.iter().any(|ending| ends_in(path, ending)) && !path.is_dir() {
        let known: Vec<String> = endings.iter().map(|ending| format!(".{ending}")).collect();
        bail!(
            "{}: has not the ending of what is written; end the name in {}",
            path.display(),
            known.join(" or ")
        );
    }
    check_output(path, inputs)?;
    Ok(())
}

/// Endings that nobody gives a table in text by purpose.
const NO_TABLES: [&str; 10] = [
    "exr", "npy", "npz", "png", "toml", "html", "svg", "json", "xlsx", "ods",
];

/// Checks the name of a table (CSV), which may have any ending but that of another kind of file.
///
/// # Errors
/// One line that names it, and what to do.
pub fn check_table(path: &Path, inputs: &[&Path]) -> Result<()> {
    if NO_TABLES.iter().any(|ending| ends_in(path, ending)) {
        bail!(
            "{}: has the ending of another kind of file than a table; end the name in .csv",
            path.display()
        );
    }
    check_output(path, inputs)?;
    Ok(())
}

/// Whether a name has an ending, in either case.
pub fn ends_in(path: &Path, ending: &str) -> bool {
    path.extension()
        .is_some_and(|found| found.eq_ignore_ascii_case(ending))
}
