//! What is wrong with a file, in one line.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fmt, io};

/// A file that cannot be used: which one, where in it, what is wrong, and what to do about it.
///
/// Its text is always a single line, `FILE, PLACE: PROBLEM; REMEDY`. What caused it, where something
/// did, is its [`source`](Error::source).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    text: Box<Text>,
    cause: Cause,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Text {
    path: PathBuf,
    place: Option<String>,
    problem: String,
    remedy: String,
}

/// The error of the system or of a library. Errors are compared by their texts alone.
#[derive(Clone, Debug, Default)]
struct Cause(Option<Arc<dyn Error + Send + Sync>>);

impl PartialEq for Cause {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Eq for Cause {}

impl FileError {
    /// A problem with a file as a whole.
    pub fn new(path: &Path, problem: impl fmt::Display, remedy: impl fmt::Display) -> Self {
        Self {
            text: Box::new(Text {
                path: path.to_owned(),
                place: None,
                problem: one_line(&problem.to_string()),
                remedy: one_line(&remedy.to_string()),
            }),
            cause: Cause::default(),
        }
    }

    /// The same error, with what caused it.
    #[must_use]
    pub fn caused_by(mut self, error: impl Error + Send + Sync + 'static) -> Self {
        self.cause = Cause(Some(Arc::new(error)));
        self
    }

    /// The same error, with the place in the file ("line 3", "channel R, pixel (5, 7)").
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        self.text.place = Some(one_line(&place.to_string()));
        self
    }

    /// A file that the system would not let us read.
    pub fn reading(path: &Path, error: &io::Error) -> Self {
        let remedy = match error.kind() {
            io::ErrorKind::NotFound => "check the path",
            io::ErrorKind::PermissionDenied => "make it readable for this user",
            io::ErrorKind::IsADirectory => "name a file, not a folder",
            _ => of_the_system(error).unwrap_or("check the disk and try again"),
        };
        Self::new(path, format_args!("cannot be read ({error})"), remedy).caused_by(copy_of(error))
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
            _ => of_the_system(error).unwrap_or("check the disk and try again"),
        };
        Self::new(path, format_args!("cannot be written ({error})"), remedy)
            .caused_by(copy_of(error))
    }

    /// Whether the system lacks what has nothing to do with this file (open files, memory, the network's
    /// disk): other files would fail alike, and this one may well be sound.
    pub fn is_of_the_system(&self) -> bool {
        let cause = self.cause.0.as_deref();
        let error = cause.and_then(|cause| cause.downcast_ref::<io::Error>());
        error.is_some_and(|error| {
            error.kind() != io::ErrorKind::InvalidFilename && of_the_system(error).is_some()
        })
    }

    /// The file that is wrong.
    pub fn path(&self) -> &Path {
        &self.text.path
    }
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Text {
            path,
            place,
            problem,
            remedy,
        } = &*self.text;
        write!(f, "{}", one_line(&path.display().to_string()))?;
        if let Some(place) = place {
            write!(f, ", {place}")?;
        }
        write!(f, ": {problem}; {remedy}")
    }
}

impl Error for FileError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        let cause = self.cause.0.as_deref()?;
        Some(cause)
    }
}

/// What to do about an error that has nothing to do with what the file holds.
fn of_the_system(error: &io::Error) -> Option<&'static str> {
    /// Unix: no more files for this process, for the system.
    const TOO_MANY_FILES: [i32; 2] = [24, 23];
    if cfg!(unix)
        && error
            .raw_os_error()
            .is_some_and(|code| TOO_MANY_FILES.contains(&code))
    {
        return Some("raise the limit of open files (ulimit -n) or close other programs");
    }
    match error.kind() {
        io::ErrorKind::InvalidFilename => Some("choose a shorter name"),
        io::ErrorKind::OutOfMemory => Some("close other programs: memory has run out"),
        io::ErrorKind::StaleNetworkFileHandle | io::ErrorKind::TimedOut => {
            Some("check that the network's disk is there")
        }
        _ => None,
    }
}

/// An error of the system with the same code, kind and text.
fn copy_of(error: &io::Error) -> io::Error {
    match error.raw_os_error() {
        Some(code) => io::Error::from_raw_os_error(code),
        None => io::Error::new(error.kind(), error.to_string()),
    }
}

/// A text with whitespace of any kind, line breaks included, as single spaces.
pub fn one_line(text: &str) -> String {
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
    fn an_error_of_the_system_is_the_source_and_does_not_count_in_comparisons() {
        let full = io::Error::from(io::ErrorKind::StorageFull);
        let error = FileError::writing(Path::new("x"), &full);
        let source = error.source().unwrap().downcast_ref::<io::Error>();
        assert_eq!(source.unwrap().kind(), io::ErrorKind::StorageFull);
        assert!(error.to_string().contains(&full.to_string()));
        let same = FileError::new(
            Path::new("x"),
            format_args!("cannot be written ({full})"),
            "free some space or choose another disk",
        );
        assert_eq!(error, same);
        assert!(same.source().is_none());
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

    #[cfg(unix)]
    #[test]
    fn too_many_open_files_are_no_fault_of_the_disk() {
        let many = io::Error::from_raw_os_error(24);
        for error in [
            FileError::reading(Path::new("x"), &many),
            FileError::writing(Path::new("x"), &many),
        ] {
            let said = error.to_string();
            assert!(
                said.contains("Too many open files") && said.contains("ulimit"),
                "{said}"
            );
        }
    }
}
