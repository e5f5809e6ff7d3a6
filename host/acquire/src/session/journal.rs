//! The journal's lines: number, time, entry, checksum.
//!
//! ```text
//! 17 2026-11-22T09:20:40Z pose material 12 at=308916 bytes=25743 crc=00abcdef pointing=0.004125 #1a2b3c4d
//! ```
//! The checksum is of everything before ` #`. Lines are numbered from 0, so that a missing one is
//! noticed.

use crate::session::append::{AppendLog, LogFile};
use crate::session::clock;
use crate::session::entry::Entry;
use gonia_formats::FileError;
use gonia_protocol::crc32c;
use std::path::{Path, PathBuf};

/// The lines of a journal, and how many of its bytes are whole lines.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    /// What they say.
    pub entries: Vec<Entry>,
    /// Bytes of whole lines.
    pub whole_bytes: u64,
    /// Bytes behind them: the start of a line whose writer died.
    pub torn_bytes: u64,
}

/// Reads a journal. The start of a line at its end is no error: its writer died.
///
/// # Errors
/// Unreadable, or a line other than that which is not whole.
pub fn read(path: &Path) -> Result<Lines, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    lines_of(path, &bytes)
}

/// The lines of a journal's bytes; the path is for errors.
///
/// # Errors
/// As [`read`].
pub fn lines_of(path: &Path, bytes: &[u8]) -> Result<Lines, FileError> {
    let mut entries = Vec::new();
    let mut at = 0;
    while let Some(length) = bytes[at..].iter().position(|b| *b == b'\n') {
        let line = &bytes[at..at + length];
        let entry = parse(line, entries.len()).ok_or_else(|| {
            FileError::new(
                path,
                "is damaged: its number or checksum is wrong",
                "the poses up to the line before can be saved: keep a copy, and cut the journal there",
            )
            .at(format_args!("line {}", entries.len() + 1))
        })?;
        entries.push(entry);
        at += length + 1;
    }
    Ok(Lines {
        entries,
        whole_bytes: at as u64,
        torn_bytes: (bytes.len() - at) as u64,
    })
}

fn parse(line: &[u8], number: usize) -> Option<Entry> {
    let line = std::str::from_utf8(line).ok()?;
    let (text, crc) = line.rsplit_once(" #")?;
    if crc.len() != 8 || u32::from_str_radix(crc, 16).ok()? != crc32c(text.as_bytes()) {
        return None;
    }
    let (found, rest) = text.split_once(' ')?;
    let (_time, entry) = rest.split_once(' ')?;
    if found.parse() != Ok(number) {
        return None;
    }
    Entry::parse(entry)
}

/// The journal's end, to which lines are appended.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    log: AppendLog,
    next: usize,
}

impl Journal {
    /// Goes on behind the whole lines of a journal.
    ///
    /// # Errors
    /// When its torn end cannot be cut off.
    pub fn append_to(
        path: &Path,
        file: Box<dyn LogFile>,
        lines: &Lines,
    ) -> Result<Self, FileError> {
        Ok(Self {
            path: path.to_owned(),
            log: AppendLog::open(path, file, lines.whole_bytes)?,
            next: lines.entries.len(),
        })
    }

    /// Writes a line and waits until it is on the disk. Returns the entry as it will be read.
    ///
    /// # Errors
    /// When the disk does not take it. The journal is then as it was.
    pub fn write(&mut self, entry: &Entry) -> Result<Entry, FileError> {
        let text = format!("{} {} {entry}", self.next, clock::now());
        let line = format!("{text} #{:08x}", crc32c(text.as_bytes()));
        let entry = parse(line.as_bytes(), self.next).ok_or_else(|| {
            FileError::new(
                &self.path,
                format_args!("has no line for \"{entry}\""),
                "please report this",
            )
        })?;
        self.log.append(format!("{line}\n").as_bytes())?;
        self.next += 1;
        Ok(entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::entry::SessionEnd;

    fn open(path: &Path) -> Journal {
        let mut options = std::fs::OpenOptions::new();
        let file = options.write(true).create(true).truncate(false).open(path);
        let lines = read(path).unwrap();
        Journal::append_to(path, Box::new(file.unwrap()), &lines).unwrap()
    }

    fn written(n: usize) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.log");
        std::fs::write(&path, "").unwrap();
        let mut journal = open(&path);
        for i in 0..n {
            journal.write(&Entry::Event(format!("number {i}"))).unwrap();
        }
        (folder, path)
    }

    #[test]
    fn a_journal_cut_anywhere_keeps_its_whole_lines_and_goes_on() {
        let (_folder, path) = written(4);
        let bytes = std::fs::read(&path).unwrap();
        for keep in 0..=bytes.len() {
            std::fs::write(&path, &bytes[..keep]).unwrap();
            let lines = read(&path).unwrap();
            let whole = bytes[..keep].iter().filter(|b| **b == b'\n').count();
            assert_eq!(lines.entries.len(), whole);
            assert_eq!(lines.whole_bytes + lines.torn_bytes, keep as u64);
            let mut journal = open(&path);
            journal
                .write(&Entry::Stop(SessionEnd::Paused, "x".into()))
                .unwrap();
            assert_eq!(read(&path).unwrap().entries.len(), whole + 1);
        }
    }

    #[test]
    fn every_flipped_byte_is_noticed_and_its_line_named() {
        let (_folder, path) = written(3);
        let bytes = std::fs::read(&path).unwrap();
        for i in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[i] ^= 1;
            std::fs::write(&path, &damaged).unwrap();
            match read(&path) {
                // The last line break: what was a line is the start of one.
                Ok(lines) => assert_eq!((i, lines.entries.len()), (bytes.len() - 1, 2)),
                Err(error) => assert!(error.to_string().contains("journal.log, line ")),
            }
        }
    }

    #[test]
    fn a_line_that_is_gone_is_noticed() {
        let (_folder, path) = written(3);
        let text = std::fs::read_to_string(&path).unwrap();
        let without: Vec<&str> = text
            .lines()
            .enumerate()
            .filter(|l| l.0 != 1)
            .map(|l| l.1)
            .collect();
        std::fs::write(&path, without.join("\n") + "\n").unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("line 2"), "{error}");
    }
}
