//! TOML files with errors that name the line.

use crate::FileError;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Reads a TOML file.
///
/// # Errors
/// Unreadable, not UTF-8, not TOML, or with unknown, missing or mistyped keys; the line is named
/// where there is one.
pub fn read<T: DeserializeOwned>(path: &Path, remedy: &str) -> Result<T, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    let text =
        String::from_utf8(bytes).map_err(|_| FileError::new(path, "is not UTF-8 text", remedy))?;
    toml::from_str(&text).map_err(|error| {
        let found = FileError::new(path, error.message(), remedy);
        match error.span() {
            // A missing key's span is its whole table, which starts where the table does.
            Some(span) => found.at(format_args!("line {}", line_of(&text, span.start))),
            None => found,
        }
    })
}

fn line_of(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|b| *b == b'\n').count()
}
