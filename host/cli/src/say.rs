//! Printing, in one place: whoever reads may stop reading.
//!
//! `gonia … | head` closes standard output while a command goes on: what follows is dropped, and the
//! command ends as it would have. Any other failure of standard output, as of a full disk that it was
//! sent to, is the command's failure. Nobody learns of one of standard error.

use anyhow::{Result, bail};
use std::fmt::Arguments;
use std::io::{self, Write};
use std::sync::Mutex;

/// Prints a line on standard output, as `println!` does.
macro_rules! outln {
    ($($line:tt)*) => { $crate::say::out(format_args!("{}\n", format_args!($($line)*))) };
}

/// Prints a line on standard error, as `eprintln!` does.
macro_rules! errln {
    ($($line:tt)*) => { $crate::say::err(format_args!("{}\n", format_args!($($line)*))) };
}

pub(crate) use {errln, outln};

/// Why standard output takes no more.
static ENDED: Mutex<Option<io::Error>> = Mutex::new(None);

/// Prints on standard output.
pub fn out(text: Arguments<'_>) {
    let mut ended = match ENDED.lock() {
        Ok(ended) => ended,
        Err(poisoned) => poisoned.into_inner(),
    };
    if ended.is_none() {
        *ended = io::stdout().write_fmt(text).err();
    }
}

/// Prints on standard error.
pub fn err(text: Arguments<'_>) {
    let _ = io::stderr().write_fmt(text);
}

/// What comes of writing on standard output: that nobody reads any more is no failure.
///
/// # Errors
/// Standard output took not all, for any other reason.
pub fn written(result: io::Result<()>) -> Result<()> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => bail!(
            "standard output: cannot be written ({error}); check where it goes, and run the command again"
        ),
        _ => Ok(()),
    }
}

/// Sends off what is printed so far.
///
/// # Errors
/// As [`written`].
pub fn finish() -> Result<()> {
    let failed = match ENDED.lock() {
        Ok(mut ended) => ended.take(),
        Err(poisoned) => poisoned.into_inner().take(),
    };
    written(match failed {
        Some(error) => Err(error),
        None => io::stdout().flush(),
    })
}

/// Whether standard output takes no more: who prints without end may stop.
pub fn is_closed() -> bool {
    match ENDED.lock() {
        Ok(ended) => ended.is_some(),
        Err(poisoned) => poisoned.into_inner().is_some(),
    }
}
