//! What is wrong with a file, in one line.

use std::path::{Path, PathBuf};
use std::{fmt, io};

/// A file that cannot be used: which one, where in it, what is wrong, and what to do about it.
///
/// Its text is always a single line, `FILE, PLACE: PROBLEM; REMEDY`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    path: PathBuf,
    place: Option<String>,
    problem: String,
    remedy: String,
}

impl FileError {
    /// A problem with a file as a whole.
    pub fn new(path: &Path, problem: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        Self {
            path: path.to_owned(),
            place: None,
            problem: one_line(&problem.to_string()),
            remedy: one_line(&remedy.to_string()),
        }
    }

    /// The same error, with the place in the file ("line 3", "channel R, pixel (5, 7)").
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        self.place = Some(one_line(&place.to_string()));
        self
    }

    /// A file that the system would not let us read.
    pub fn reading(path: &Path, error: &io::Error) -> Self {
        let remedy = match error.kind() {
            io::ErrorKind::NotFound => "check the path",
            io::ErrorKind::PermissionDenied => "make it readable for this user",
            io::ErrorKind::IsADirectory => "name a file, not a folder",
            _ => "check the disk and try again",
        };
        Self::new(path, format_args!("cannot be read ({error})"), remedy)
    }

    /// A file or folder that the system would not let us write.
    pub fn writing(path: &Path, error: &io::Error) -> Self {
        let remedy = match error.kind() {
            io::ErrorKind::NotFound => "make its folder first",
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                "choose a place where this user may write"
            }
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "free some space or choose another disk"
            }
            io::ErrorKind::IsADirectory => "choose a name that is not a folder's",
            io::ErrorKind::NotADirectory => "choose a place inside a folder",
            _ => "check the disk and try again",
        };
        Self::new(path, format_args!("cannot be written ({error})"), remedy)
    }

    /// The file that is wrong.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", one_line(&self.path.display().to_string()))?;
        if let Some(place) = &self.place {
            write!(f, ", {place}")?;
        }
        write!(f, ": {}; {}", self.problem, self.remedy)
    }
}

impl std::error::Error for FileError {}

/// Whitespace of any kind, line breaks included, as single spaces.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_one_line_with_file_place_and_remedy() {
        let error =
            FileError::new(Path::new("a/b.csv"), "not a\n  number", "write a number").at("line 3");
        assert_eq!(
            error.to_string(),
            "a/b.csv, line 3: not a number; write a number"
        );
    }

    #[test]
    fn a_full_disk_and_a_missing_folder_have_different_remedies() {
        let say =
            |kind: io::ErrorKind| FileError::writing(Path::new("x"), &kind.into()).to_string();
        assert!(
            say(io::ErrorKind::StorageFull).ends_with("free some space or choose another disk")
        );
        assert!(say(io::ErrorKind::NotFound).ends_with("make its folder first"));
    }
}
