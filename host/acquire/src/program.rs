//! A program that is run and must end within a time.

use std::io;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

/// Pause between two looks at the program.
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// Why a program that was run is of no use. Without the program's name.
#[derive(Debug, thiserror::Error)]
pub enum ProgramError {
    /// It cannot be started.
    #[error("cannot be run ({0})")]
    Start(#[source] io::Error),
    /// The system does not say whether it has ended.
    #[error("cannot be waited for ({0})")]
    Wait(#[source] io::Error),
    /// It took too long, and was killed.
    #[error("did not end within {0} s")]
    Timeout(f64),
    /// It ended otherwise than with success.
    #[error("ended with {0}")]
    Status(ExitStatus),
}

/// Runs a program until it ends with success; it is killed when it takes longer than `timeout`. Its
/// pipes, if it has any, are those of the child that is returned.
///
/// # Errors
/// Every other end of it.
pub fn run(command: &mut Command, timeout: Duration) -> Result<Child, ProgramError> {
    let mut child = command.spawn().map_err(ProgramError::Start)?;
    let until = Instant::now() + timeout;
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(child),
            Ok(Some(status)) => return Err(ProgramError::Status(status)),
            Ok(None) if Instant::now() < until => std::thread::sleep(LOOK_EVERY),
            Ok(None) => {
                // It may have ended in this moment; then there is nothing to kill.
                let _ = child.kill();
                let _ = child.wait();
                return Err(ProgramError::Timeout(timeout.as_secs_f64()));
            }
            Err(error) => return Err(ProgramError::Wait(error)),
        }
    }
}
