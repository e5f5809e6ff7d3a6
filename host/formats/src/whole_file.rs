//! Files that are there whole or not at all.

use crate::FileError;
use std::fs::{self, File, OpenOptions};
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
    check_name(path)?;
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
    if folder.exists() && !folder.is_dir() {
        return Err(FileError::new(
            folder,
            "is no folder",
            "give the name of a folder",
        ));
    }
    let failed = |error: io::Error| FileError::writing(folder, &error);
    fs::create_dir_all(folder).map_err(failed)?;
    let mut probe = temporary(folder).map_err(failed)?;
    // A full disk lets a file be made but not filled.
    probe.write_all(&[0; 4096]).map_err(failed)?;
    probe.as_file().sync_all().map_err(failed)
}

/// Makes sure that a file can be written at `file`, before the work that makes it: its name can be
/// one, it is neither a folder nor a device, and its folder is made and written to.
///
/// # Errors
/// As [`check_writable`], and a name that no file can have there.
pub fn check_writable_beside(file: &Path) -> Result<(), FileError> {
    check_name(file)?;
    check_writable(folder_of(file))
}

/// As [`check_writable_beside`], for an output that is none of the files that it is made from.
///
/// # Errors
/// As [`check_writable_beside`], and an input of the same name, by whatever path.
pub fn check_output(file: &Path, inputs: &[&Path]) -> Result<(), FileError> {
    check_writable_beside(file)?;
    let Ok(place) = file.canonicalize() else {
        return Ok(());
    };
    let is_input = |input: &&Path| input.canonicalize().is_ok_and(|input| input == place);
    if inputs.iter().any(is_input) {
        return Err(FileError::new(
            file,
            "is an input too, and would be replaced",
            "give the output another name",
        ));
    }
    Ok(())
}

/// Whether two names are those of one file, which need not be there yet.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        let folder = folder_of(path).canonicalize().ok();
        path.canonicalize()
            .ok()
            .or_else(|| Some(folder?.join(path.file_name()?)))
    };
    a == b || place(a).is_some_and(|place_of_a| Some(place_of_a) == place(b))
}

/// Whether a file may stand under this name: an ordinary one, or none yet.
fn check_name(file: &Path) -> Result<(), FileError> {
    let is_folder = || FileError::new(file, "is a folder", "give the name of a file in it");
    let no_ordinary_file = || {
        let problem = "is no ordinary file (a device or a pipe)";
        FileError::new(file, problem, "give the name of a file")
    };
    let ends_in_separator = file
        .as_os_str()
        .to_string_lossy()
        .ends_with(std::path::is_separator);
    if ends_in_separator || file.file_name().is_none() {
        return Err(is_folder());
    }
    // /dev/stdout may lead to an ordinary file, but a rename would replace the link to it.
    let is_of_the_system = cfg!(unix)
        && (file.parent() == Some(Path::new("/dev"))
            || ["/dev/fd", "/proc"].iter().any(|of| file.starts_with(of)));
    match fs::metadata(file) {
        Ok(_) if is_of_the_system => Err(no_ordinary_file()),
        Ok(there) if there.is_dir() => Err(is_folder()),
        Ok(there) if there.is_file() => Ok(()),
        // A rename would put a file in the place of the device.
        Ok(_) => Err(no_ordinary_file()),
        // Not there, or its folder is not: both can be made.
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(FileError::writing(file, &error)),
    }
}

pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

pub(crate) fn temporary(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".gonia-").suffix(".part");
    // tempfile wraps the system's error into one of its own, whose code is lost: it is kept here.
    let mut cause = None;
    let made = builder.make_in(folder, |path| {
        let mut open = OpenOptions::new();
        open.read(true).write(true).create_new(true);
        // An ordinary file (less the umask), not a private one.
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut open, 0o666);
        open.open(path)
            .inspect_err(|error| cause = error.raw_os_error())
    });
    made.map_err(|error| match cause {
        Some(code) => io::Error::from_raw_os_error(code),
        None => error,
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

    #[test]
    fn a_name_that_no_file_can_have_is_refused_before_anything_is_made() {
        let dir = tempfile::tempdir().unwrap();
        let say = |path: &Path| check_writable_beside(path).unwrap_err().to_string();
        let folder = say(dir.path());
        assert!(folder.ends_with("is a folder; give the name of a file in it"));
        // Not there yet, but meant as one.
        let slash = dir.path().join("new/");
        assert!(say(&slash).contains("is a folder"));
        assert!(write_whole_bytes(&slash, b"x").is_err() && !slash.exists());
        let input = dir.path().join("in.exr");
        fs::write(&input, "x").unwrap();
        let same = dir.path().join("./in.exr");
        let error = check_output(&same, &[&input]).unwrap_err().to_string();
        assert!(error.contains("is an input too"), "{error}");
        assert!(check_output(&dir.path().join("out.exr"), &[&input]).is_ok());
        let below = say(&input.join("a.exr"));
        assert!(below.contains("choose a place inside a folder"), "{below}");
        let error = check_writable(&input).unwrap_err().to_string();
        assert!(
            error.ends_with("is no folder; give the name of a folder"),
            "{error}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn names_too_long_and_devices_are_refused_as_what_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let long = dir.path().join("a".repeat(300));
        let error = check_writable_beside(&long).unwrap_err().to_string();
        assert!(error.ends_with("choose a shorter name"), "{error}");
        for device in ["/dev/null", "/dev/stdout", "/proc/self/fd/1"] {
            let error = write_whole_bytes(Path::new(device), b"x").unwrap_err();
            assert!(error.to_string().contains("is no ordinary file"), "{error}");
        }
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
