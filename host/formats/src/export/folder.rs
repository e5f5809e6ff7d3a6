//! Exports that are folders of files: there whole or not at all.

use crate::{FileError, check_writable_beside};
use std::io;
use std::path::Path;

/// Whether a folder can be made under this name: none stands there yet.
///
/// # Errors
/// Something has the name, or its folder cannot be written to.
pub fn check_new_folder(path: &Path) -> Result<(), FileError> {
    if path.symlink_metadata().is_ok() {
        return Err(FileError::new(
            path,
            "is there already, and the format is a folder of files",
            "remove it or choose another name",
        ));
    }
    check_writable_beside(path)
}

/// Makes a folder under its final name once it is complete.
///
/// # Errors
/// As [`check_new_folder`]; the disk is full, or `fill` fails.
pub(super) fn write_whole_folder(
    path: &Path,
    fill: impl FnOnce(&Path) -> io::Result<()>,
) -> Result<(), FileError> {
    check_new_folder(path)?;
    let failed = |error: io::Error| FileError::writing(path, &error);
    let beside = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let folder = tempfile::Builder::new()
        .prefix(".gonia-")
        .tempdir_in(beside.unwrap_or(Path::new(".")))
        .map_err(failed)?;
    let inner = folder.path().join("whole");
    std::fs::create_dir(&inner)
        .and_then(|()| fill(&inner))
        .and_then(|()| std::fs::rename(&inner, path))
        .map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_there_whole_or_not_at_all_and_replaces_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.pab");
        let fails = |_: &Path| Err(io::ErrorKind::StorageFull.into());
        assert!(write_whole_folder(&path, fails).is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        let fill = |folder: &Path| std::fs::write(folder.join("x"), "x");
        write_whole_folder(&path, fill).unwrap();
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
        assert!(path.join("x").is_file());
        let error = write_whole_folder(&path, fill).unwrap_err().to_string();
        assert!(
            error.contains("remove it or choose another name"),
            "{error}"
        );
    }
}
