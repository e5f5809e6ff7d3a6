//! The table of all formats, and how a file's format is recognised.

use crate::export::{bird, pab, radiance, zarr_read, zemax};
use crate::format::{Content, Format};
use crate::{
    FileError, alta, astm, dense_exr, merl, ngan, rgl, samples_csv, samples_npy, samples_npz, utia,
};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Every format. The first one of each kind is written where a name has no known ending.
static FORMATS: [&Format; 15] = [
    &dense_exr::FORMAT,
    &samples_npy::FORMAT,
    &samples_csv::FORMAT,
    &samples_npz::FORMAT,
    &utia::FORMAT,
    &merl::FORMAT,
    &alta::FORMAT,
    &ngan::FORMAT,
    &rgl::FORMAT,
    &radiance::FORMAT,
    &zemax::FORMAT,
    &astm::FORMAT,
    &pab::FORMAT,
    &bird::FORMAT,
    &zarr_read::FORMAT,
];

/// The formats of a kind, in the order of the table.
pub(super) fn formats(is_wanted: fn(&Content) -> bool) -> impl Iterator<Item = &'static Format> {
    FORMATS
        .into_iter()
        .filter(move |format| is_wanted(&format.content))
}

/// The format of a file that exists: by its first bytes, else by its ending.
///
/// # Errors
/// When neither tells the format and the file cannot be read.
pub(super) fn format_of_file(path: &Path) -> Result<Option<&'static Format>, FileError> {
    let start = first_bytes(path);
    let is_begun_so = |format: &&Format| {
        let start = start.as_deref().unwrap_or_default();
        let is_begun = !format.magic.is_empty() && start.starts_with(format.magic);
        // One byte begins too much else: the ending has to say it too, and that it is text.
        let is_text = || start.get(1).is_some_and(|byte| *byte != 0);
        is_begun && (format.magic.len() > 1 || (is_named_so(format, path) && is_text()))
    };
    // Of two with one ending, one is known by its first bytes: a file without them is the other.
    let by_name = || {
        let mut named = FORMATS
            .into_iter()
            .filter(|format| is_named_so(format, path));
        let first = named.next()?;
        let is_other = start.is_ok() && !first.magic.is_empty();
        Some(named.find(|_| is_other).unwrap_or(first))
    };
    let format = FORMATS.into_iter().find(is_begun_so).or_else(by_name);
    match (format, start) {
        (Some(format), _) => Ok(Some(format)),
        (None, Ok(_)) => Ok(None),
        (None, Err(error)) => Err(FileError::reading(path, &error)),
    }
}

/// The format that a file of this name has, by its ending in either case.
pub(super) fn format_of_name(path: &Path) -> Option<&'static Format> {
    FORMATS.into_iter().find(|format| is_named_so(format, path))
}

fn is_named_so(format: &Format, path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default();
    format
        .endings
        .iter()
        .any(|of_format| ending.eq_ignore_ascii_case(of_format))
}

/// The endings of a kind, as a remedy lists them: `.npy or .csv`.
pub(super) fn endings(is_wanted: fn(&Content) -> bool) -> String {
    listed(formats(is_wanted).map(|format| format!(".{}", format.endings[0])))
}

/// A list as people write it, the last two parted by "or".
pub(super) fn listed(words: impl Iterator<Item = String>) -> String {
    let mut words: Vec<String> = words.collect();
    match words.pop() {
        Some(last) if words.is_empty() => last,
        Some(last) => format!("{} or {last}", words.join(", ")),
        None => String::new(),
    }
}

/// The first bytes of an ordinary file; none of a pipe, which can be read only once.
fn first_bytes(path: &Path) -> io::Result<Vec<u8>> {
    let kind = std::fs::metadata(path)?;
    if kind.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let longest = FORMATS.iter().map(|format| format.magic.len()).max();
    let mut bytes = Vec::new();
    if kind.is_file() {
        let file = File::open(path)?;
        file.take(longest.unwrap_or(0) as u64)
            .read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_apart_by_endings_or_by_first_bytes() {
        for (k, format) in FORMATS.iter().enumerate() {
            for other in &FORMATS[..k] {
                let is_shared = format.endings.iter().any(|e| other.endings.contains(e));
                let is_told = !other.magic.is_empty() && format.magic.is_empty();
                assert!(!is_shared || is_told, "{}", format.name);
                let (a, b) = (format.magic, other.magic);
                let differ = !a.starts_with(b) && !b.starts_with(a);
                assert!(a.is_empty() || b.is_empty() || differ, "{}", format.name);
            }
            assert!(!format.endings.is_empty() && !format.name.is_empty());
        }
    }
}
