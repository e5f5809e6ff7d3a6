//! Files that are there whole or not at all.

use crate::FileError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Bytes gathered before they go to the disk.
const BUFFER: usize = 1 << 20;

/// Writes a file under its final name only once it is complete: into a temporary file of the same
/// folder, synced to the disk, then renamed. An existing file is replaced whole, or left as it was.
///
/// # Errors
/// When the folder is missing or not writable, the disk is full, or `fill` fails.
pub fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), FileError> {
    let failed = |error: io::Error| FileError::writing(path, &error);
    if path.is_dir() {
        return Err(failed(io::ErrorKind::IsADirectory.into()));
    }
    let folder = folder_of(path);
    let file = temporary(folder).map_err(failed)?;
    let (file, temporary_path) = file.into_parts();
    let mut writer = BufWriter::with_capacity(BUFFER, file);
    fill(&mut writer).map_err(failed)?;
    let file = writer
        .into_inner()
        .map_err(|error| failed(error.into_error()))?;
    file.sync_all().map_err(failed)?;
    temporary_path
        .persist(path)
        .map_err(|error| failed(error.error))?;
    sync_folder(folder);
    Ok(())
}

/// Writes bytes that are already in memory as [`write_whole`] does.
///
/// # Errors
/// As [`write_whole`].
pub fn write_whole_bytes(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_whole(path, |file| file.write_all(bytes))
}

/// Makes a folder (and those above it) where it is missing, and checks that it can be written to,
/// so that a long run fails at its start and not at its end.
///
/// # Errors
/// When the folder cannot be made, is a file, or a file cannot be made and written in it.
pub fn check_writable(folder: &Path) -> Result<(), FileError> {
    let failed = |error: io::Error| FileError::writing(folder, &error);
    fs::create_dir_all(folder).map_err(failed)?;
    let mut probe = temporary(folder).map_err(failed)?;
    // A full disk lets a file be made but not filled.
    probe.write_all(&[0; 4096]).map_err(failed)?;
    probe.as_file().sync_all().map_err(failed)
}

/// Makes sure that a file can be written at `file`: its folder is made and written to.
///
/// # Errors
/// As [`check_writable`], and a folder of that name.
pub fn check_writable_beside(file: &Path) -> Result<(), FileError> {
    if file.is_dir() {
        return Err(FileError::new(
            file,
            "is a folder",
            "give the name of a file in it",
        ));
    }
    check_writable(folder_of(file))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn temporary(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".gonia-").suffix(".part");
    // Temporary files are private by default; this one will be an ordinary file (less the umask).
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(|error| {
        // tempfile wraps the error into a longer text of the same kind; the kind is what counts.
        io::Error::from(error.kind())
    })
}

/// Makes a rename durable. Where folders cannot be synced the rename is still atomic.
fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write_whole_bytes(&path, b"old").unwrap();
        let error = write_whole(&path, |file| {
            file.write_all(b"half")?;
            Err(io::ErrorKind::StorageFull.into())
        })
        .unwrap_err();
        assert!(error.to_string().contains("free some space"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_folder_is_named_with_its_remedy() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("none/a.txt");
        let error = write_whole_bytes(&path, b"x").unwrap_err().to_string();
        assert!(
            error.contains("a.txt") && error.ends_with("make its folder first"),
            "{error}"
        );
        check_writable(&dir.path().join("none/deep")).unwrap();
        write_whole_bytes(&path, b"x").unwrap();
        assert!(check_writable(&path).is_err());
        assert!(write_whole_bytes(dir.path(), b"x").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_written_file_can_be_read_by_others() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let (ours, plain) = (dir.path().join("a"), dir.path().join("b"));
        write_whole_bytes(&ours, b"x").unwrap();
        fs::write(&plain, b"x").unwrap();
        let mode = |path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
