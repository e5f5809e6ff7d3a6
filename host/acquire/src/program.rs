//! A program that is run and must end within a time.
//!
//! It has a process group of its own: Ctrl-C on the terminal, which ends the session at the next pose,
//! does not end the exposure, and a program that takes too long is killed with all that it has started.

use std::io::{self, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

/// Pause between two looks at the program.
const LOOK_EVERY: Duration = Duration::from_millis(2);
/// What a program has said is waited for so long after its end: another one that it has left behind may
/// hold its output open.
const LAST_WORDS: Duration = Duration::from_millis(200);
/// Bytes that are kept of what it says on either output: the last ones.
const MOST_SAID: usize = 4096;
/// Characters of its last line that are shown.
const SHOWN: usize = 200;

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
    #[error("did not end within {limit_s} s{}", quoted(said))]
    Timeout {
        /// How long it was waited for, seconds.
        limit_s: f64,
        /// The last line that it wrote to its standard error.
        said: String,
    },
    /// It ended otherwise than with success.
    #[error("ended with {status}{}", quoted(said))]
    Status {
        /// How.
        status: ExitStatus,
        /// The last line that it wrote to its standard error.
        said: String,
    },
}

fn quoted(said: &str) -> String {
    match said {
        "" => String::new(),
        said => format!(" and said \"{said}\""),
    }
}

/// Runs a program until it ends with success; with all that it has started it is killed when it takes
/// longer than `timeout`. Returns the last bytes of what it wrote to its standard output.
///
/// # Errors
/// Every other end of it.
pub fn run(command: &mut Command, timeout: Duration) -> Result<Vec<u8>, ProgramError> {
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    let mut child = command.spawn().map_err(ProgramError::Start)?;
    let out = child.stdout.take().map(last_bytes);
    let err = child.stderr.take().map(last_bytes);
    let until = Instant::now() + timeout;
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(said(out)),
            Ok(Some(status)) => {
                let said = last_line(&said(err));
                return Err(ProgramError::Status { status, said });
            }
            Ok(None) if Instant::now() < until => std::thread::sleep(LOOK_EVERY),
            Ok(None) => {
                kill(&mut child);
                return Err(ProgramError::Timeout {
                    limit_s: timeout.as_secs_f64(),
                    said: last_line(&said(err)),
                });
            }
            Err(error) => return Err(ProgramError::Wait(error)),
        }
    }
}

/// Kills a program and what it has started. It may have ended in this moment; then there is nothing to
/// kill.
fn kill(child: &mut Child) {
    #[cfg(unix)]
    if let Ok(id) = i32::try_from(child.id()) {
        use nix::sys::signal::{Signal, killpg};
        let _ = killpg(nix::unistd::Pid::from_raw(id), Signal::SIGKILL);
    }
    let _ = child.kill();
    let _ = child.wait();
}

/// Reads a program's output, so that it never waits for a reader, and gives the last bytes at its end.
fn last_bytes(mut from: impl Read + Send + 'static) -> Receiver<Vec<u8>> {
    let (send, receive) = mpsc::channel();
    let read = move || {
        let (mut kept, mut chunk) = (Vec::new(), [0; 4096]);
        loop {
            match from.read(&mut chunk) {
                Ok(0) => break,
                Ok(n) => kept.extend_from_slice(&chunk[..n]),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(_) => break,
            }
            let more = kept.len().saturating_sub(MOST_SAID);
            kept.drain(..more);
            // Also before the end, which may not come: the last ones that were sent count.
            if send.send(kept.clone()).is_err() {
                return;
            }
        }
    };
    // Without a thread nothing is read, and nothing said.
    let _ = std::thread::Builder::new()
        .name("program's output".into())
        .spawn(read);
    receive
}

/// What a program that has ended has said.
fn said(output: Option<Receiver<Vec<u8>>>) -> Vec<u8> {
    let mut last = Vec::new();
    let Some(output) = output else {
        return last;
    };
    let until = Instant::now() + LAST_WORDS;
    while let Ok(bytes) = output.recv_timeout(until.saturating_duration_since(Instant::now())) {
        last = bytes;
    }
    last
}

/// The last line with something in it, for a person.
fn last_line(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let line = text.lines().rev().find(|line| !line.trim().is_empty());
    let shown = line.unwrap_or_default().trim().chars();
    shown
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(SHOWN)
        .collect()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn sh(script: &str, timeout_s: f64) -> Result<Vec<u8>, ProgramError> {
        let mut command = Command::new("sh");
        run(
            command.args(["-c", script]),
            Duration::from_secs_f64(timeout_s),
        )
    }

    #[test]
    fn a_program_that_fails_is_quoted_and_one_that_talks_much_does_not_wait() {
        let error = sh(
            "echo first >&2; echo 'no camera found' >&2; echo >&2; exit 3",
            10.0,
        );
        let error = error.unwrap_err().to_string();
        assert_eq!(
            error,
            "ended with exit status: 3 and said \"no camera found\""
        );
        let much = "i=0; while [ $i -lt 3000 ]; do echo 'a line that fills a pipe of 64 kB'; \
            echo 'another one' >&2; i=$((i+1)); done; echo 22.5";
        let said = sh(much, 20.0).unwrap();
        assert!(said.ends_with(b"\n22.5\n") && said.len() <= MOST_SAID);
    }

    #[test]
    fn a_program_that_takes_too_long_is_killed_with_all_that_it_has_started() {
        let folder = tempfile::tempdir().unwrap();
        let mark = folder.path().join("mark");
        // The child of the child would leave its mark later.
        let script = format!(
            "(sleep 1; touch {}) & echo waiting >&2; sleep 30",
            mark.display()
        );
        let error = sh(&script, 0.3).unwrap_err().to_string();
        assert_eq!(error, "did not end within 0.3 s and said \"waiting\"");
        std::thread::sleep(Duration::from_millis(1500));
        assert!(!mark.exists());
    }

    #[test]
    fn a_program_that_leaves_another_one_behind_has_ended() {
        let began = Instant::now();
        assert_eq!(sh("sleep 5 & echo done", 20.0).unwrap(), b"done\n");
        assert!(began.elapsed() < Duration::from_secs(3));
    }

    #[test]
    fn a_program_does_not_hear_the_terminals_interrupt() {
        // A signal to this process's group does not reach it: it has one of its own.
        let group = sh("ps -o pgid= -p $$; echo $$", 10.0).unwrap();
        let text = String::from_utf8(group).unwrap();
        let words: Vec<&str> = text.split_whitespace().collect();
        assert_eq!(words[0], words[1], "{text}");
    }
}
