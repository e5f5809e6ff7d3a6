//! Reads and writes at a place of a file, from several threads at once, on every system; and reads of files
//! whose length is known.

use crate::FileError;
use std::fs::File;
use std::io;
use std::path::Path;

/// All bytes of a file that must have one of some lengths; of any other file none is read.
///
/// # Errors
/// When the system reports one, or the length is none of `lengths`.
pub(super) fn read_of_length(
    path: &Path,
    lengths: &[usize],
    remedy: &str,
) -> Result<Vec<u8>, FileError> {
    let reading = |error| FileError::reading(path, &error);
    let length = std::fs::metadata(path).map_err(reading)?.len();
    let wrong = |length: u64| FileError::new(path, format_args!("holds {length} bytes"), remedy);
    if !lengths.iter().any(|wanted| *wanted as u64 == length) {
        return Err(wrong(length));
    }
    let bytes = std::fs::read(path).map_err(reading)?;
    if lengths.contains(&bytes.len()) {
        return Ok(bytes);
    }
    Err(wrong(bytes.len() as u64))
}

/// Fills a buffer from `offset` on, wherever the file's cursor is.
///
/// # Errors
/// When the system reports one, or the file ends before the buffer is full.
#[cfg(unix)]
pub(super) fn read_exact_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

/// Fills a buffer from `offset` on. The cursor moves, but no read of ours depends on it.
///
/// # Errors
/// When the system reports one, or the file ends before the buffer is full.
#[cfg(windows)]
pub(super) fn read_exact_at(file: &File, mut buffer: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !buffer.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, buffer, offset) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(n) => {
                buffer = &mut buffer[n..];
                offset += n as u64;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Writes a buffer from `offset` on, wherever the file's cursor is.
///
/// # Errors
/// When the system reports one.
#[cfg(unix)]
pub(super) fn write_all_at(file: &File, buffer: &[u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, buffer, offset)
}

/// Writes a buffer from `offset` on. The cursor moves, but no write of ours depends on it.
///
/// # Errors
/// When the system reports one.
#[cfg(windows)]
pub(super) fn write_all_at(file: &File, mut buffer: &[u8], mut offset: u64) -> io::Result<()> {
    while !buffer.is_empty() {
        match std::os::windows::fs::FileExt::seek_write(file, buffer, offset) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(n) => {
                buffer = &buffer[n..];
                offset += n as u64;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
