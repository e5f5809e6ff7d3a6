//! Runs the program as a user does.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs `gonia` with arguments and some standard input.
pub fn gonia(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_gonia"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A program that refuses its arguments does not read its input.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

/// Runs `gonia`, which must succeed; what it printed on standard output.
#[allow(dead_code)]
pub fn gonia_ok(arguments: &[&str], input: &str) -> String {
    let output = gonia(arguments, input);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// A path as an argument.
#[allow(dead_code)]
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Runs `gonia`, which must end with exit code 1 and one line; that line.
#[allow(dead_code)]
pub fn refused(arguments: &[&str], input: &str) -> String {
    let output = gonia(arguments, input);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
    let said: Vec<&str> = errors
        .lines()
        .filter(|line| line.starts_with("gonia: "))
        .collect();
    assert_eq!(said.len(), 1, "{arguments:?}: {errors}");
    assert!(!errors.contains("panicked"), "{errors}");
    said[0].to_owned()
}
