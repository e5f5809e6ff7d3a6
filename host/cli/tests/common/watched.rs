//! `gonia capture --serve` as a child.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};

/// A session that serves its page.
pub struct Watched {
    child: Child,
    errors: BufReader<ChildStderr>,
    pub address: String,
    pub token: String,
}

impl Watched {
    /// The session of the `rig.toml` and the `plan.csv` of a folder, into `s` there.
    pub fn start(folder: &Path) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_gonia"))
            .current_dir(folder)
            .args(["capture", "s", "--rig", "rig.toml", "--plan", "plan.csv"])
            .args(["--serve", "127.0.0.1:0"])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut errors = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.starts_with("live page: ") {
            line.clear();
            assert!(errors.read_line(&mut line).unwrap() > 0, "it has ended");
        }
        let url = line.trim().strip_prefix("live page: http://").unwrap();
        let (address, token) = url.split_once("/#token=").unwrap();
        Self {
            child,
            errors,
            address: address.to_owned(),
            token: token.to_owned(),
        }
    }

    /// Waits until it ends; whether it succeeded, and what it said.
    pub fn finish(mut self) -> (bool, String) {
        let mut errors = String::new();
        self.errors.read_to_string(&mut errors).unwrap();
        (self.child.wait().unwrap().success(), errors)
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
