//! Reads at a place of a file, from several threads at once, on every system.

use std::fs::File;
use std::io;

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
