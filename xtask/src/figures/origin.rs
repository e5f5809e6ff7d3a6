//! Machine, commit and date of a measurement.

use anyhow::{Context, Result, bail};
use std::path::Path;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

/// What follows the commit where files differ from it.
const CHANGES: &str = " and changes";

/// Where and of what something is measured.
pub struct Origin {
    machine: String,
    /// The last commit that changed anything but the documentation; "and changes" where files differ.
    commit: String,
    date: String,
}

impl Origin {
    /// Of this machine and the work tree as it stands.
    pub fn now(root: &Path) -> Result<Self> {
        let code = [".", ":!docs"];
        let log = [&["log", "-1", "--format=%h", "--abbrev=7", "--"], &code[..]].concat();
        let status = [&["status", "--porcelain", "--"], &code[..]].concat();
        let mut commit = git(root, &log)?;
        if !git(root, &status)?.is_empty() {
            commit += CHANGES;
        }
        let now = SystemTime::now().duration_since(UNIX_EPOCH)?;
        Ok(Self {
            machine: machine(),
            commit,
            date: date(now.as_secs() / 86_400),
        })
    }

    /// Empties the folder of what other commits have made, and of what any changes have made, so that
    /// no figure stands on it.
    pub fn clear_others(&self, work: &Path) -> Result<()> {
        let note = work.join("commit");
        let of_this = std::fs::read_to_string(&note).is_ok_and(|commit| commit == self.commit);
        if of_this && !self.commit.ends_with(CHANGES) {
            return Ok(());
        }
        if work.exists() {
            std::fs::remove_dir_all(work).with_context(|| work.display().to_string())?;
        }
        std::fs::create_dir_all(work)?;
        std::fs::write(&note, &self.commit).with_context(|| note.display().to_string())
    }

    /// One line in italics: machine; commit; date; duration; commands.
    pub fn caption(&self, seconds: f64, commands: &[&str], work: &str) -> String {
        let commands: Vec<String> = commands
            .iter()
            .map(|command| format!("`{}`", command.replace("{work}", work)))
            .collect();
        format!(
            "*{}; commit {}; {}; {:.1} min. {}*",
            self.machine,
            self.commit,
            self.date,
            seconds / 60.0,
            commands.join(", ")
        )
    }
}

fn git(root: &Path, arguments: &[&str]) -> Result<String> {
    let output = Command::new("git")
        .args(arguments)
        .current_dir(root)
        .output()
        .context("cannot start git")?;
    if !output.status.success() {
        bail!("git {}: failed", arguments.join(" "));
    }
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The processor's name, the number of its cores, and how busy they were.
fn machine() -> String {
    let read = |path| std::fs::read_to_string(path).unwrap_or_default();
    let model = read("/proc/cpuinfo")
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "))
        .map(|(_, name)| name.to_owned())
        .or_else(|| std::env::var("PROCESSOR_IDENTIFIER").ok())
        .unwrap_or_else(|| format!("{} {}", std::env::consts::OS, std::env::consts::ARCH));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let load = match read("/proc/loadavg").split(' ').next() {
        Some(load) if !load.is_empty() => format!(", load {load} at the start"),
        _ => String::new(),
    };
    format!("{model}, {cores} cores{load}")
}

/// The date of a day since 1970-01-01, in the Gregorian calendar.
fn date(days: u64) -> String {
    let is_leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    let (mut year, mut days) = (1970, days);
    while days >= 365 + u64::from(is_leap(year)) {
        days -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + u64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    format!("{year}-{month:02}-{:02}", days + 1)
}

#[cfg(test)]
mod tests {
    use super::super::marks::is_caption;
    use super::*;

    #[test]
    fn days_since_1970_are_dates() {
        for (days, expected) in [
            (0, "1970-01-01"),
            (58, "1970-02-28"),
            (59, "1970-03-01"),
            (11_016, "2000-02-29"),
            (19_722, "2023-12-31"),
            (19_723, "2024-01-01"),
            (20_088, "2024-12-31"),
            (20_784, "2026-11-27"),
        ] {
            assert_eq!(date(days), expected);
        }
    }

    #[test]
    fn a_caption_is_known_as_one_and_names_every_command() {
        let origin = Origin {
            machine: machine(),
            commit: "0123abc and changes".into(),
            date: date(20_784),
        };
        let caption = origin.caption(90.0, &["make {work}/a", "print {work}/a"], "there");
        assert!(is_caption(&caption), "{caption}");
        assert!(caption.ends_with("1.5 min. `make there/a`, `print there/a`*"));
    }

    #[test]
    fn what_another_commit_has_made_is_removed_and_what_this_one_has_made_is_kept() {
        let work = std::env::temp_dir().join(format!("gonia-figures-{}", std::process::id()));
        let of = |commit: &str| Origin {
            machine: String::new(),
            commit: commit.into(),
            date: String::new(),
        };
        of("one").clear_others(&work).unwrap();
        let made = work.join("made");
        std::fs::write(&made, "").unwrap();
        of("one").clear_others(&work).unwrap();
        assert!(made.exists());
        of("two").clear_others(&work).unwrap();
        assert!(!made.exists());
        let changed = of("two and changes");
        changed.clear_others(&work).unwrap();
        std::fs::write(&made, "").unwrap();
        changed.clear_others(&work).unwrap();
        assert!(!made.exists());
        std::fs::remove_dir_all(&work).unwrap();
    }
}
