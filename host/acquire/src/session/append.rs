//! A file to which records are appended, each on the disk before the next one is begun.

use gonia_formats::FileError;
use std::fmt::Debug;
use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// What a log asks of its file: the calls at which a disk fails. A test puts its own disk there.
pub trait LogFile: Debug + Send {
    /// Writes bytes at a place, as many as the system takes.
    ///
    /// # Errors
    /// None was taken.
    fn write_at(&mut self, bytes: &[u8], at: u64) -> io::Result<usize>;

    /// Waits until all that was written is on the disk.
    ///
    /// # Errors
    /// It may not be.
    fn sync(&mut self) -> io::Result<()>;

    /// Cuts the file there.
    ///
    /// # Errors
    /// It is as it was.
    fn cut(&mut self, length: u64) -> io::Result<()>;

    /// The file's bytes.
    ///
    /// # Errors
    /// The system does not say.
    fn length(&mut self) -> io::Result<u64>;
}

impl LogFile for File {
    fn write_at(&mut self, bytes: &[u8], at: u64) -> io::Result<usize> {
        self.seek(SeekFrom::Start(at))?;
        self.write(bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }

    fn length(&mut self) -> io::Result<u64> {
        Ok(self.metadata()?.len())
    }
}

/// Appends to a file.
#[derive(Debug)]
pub struct AppendLog {
    path: PathBuf,
    file: Box<dyn LogFile>,
    /// Bytes of whole records.
    length: u64,
    /// Bytes may follow the whole records: of a record that failed.
    is_torn: bool,
}

impl AppendLog {
    /// Goes on behind the first `length` bytes of a file; what follows them is cut off.
    ///
    /// # Errors
    /// It is shorter, or what follows cannot be cut off.
    pub fn open(path: &Path, mut file: Box<dyn LogFile>, length: u64) -> Result<Self, FileError> {
        let there = file.length();
        let there = there.map_err(|error| FileError::writing(path, &error))?;
        if there < length {
            return Err(FileError::new(
                path,
                format_args!("has {there} bytes, and the journal speaks of {length}"),
                "restore the file from a copy, or measure the session anew",
            ));
        }
        let mut log = Self {
            path: path.to_owned(),
            file,
            length,
            // Also where nothing follows: what a killed program has written need not be on the disk yet.
            is_torn: true,
        };
        log.cut_rest()?;
        Ok(log)
    }

    /// Bytes of whole records: where the next one begins.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Appends a record, and waits until it is on the disk.
    ///
    /// # Errors
    /// The disk does not take it. The records before it are as they were, and nothing is written behind
    /// them until what there is of this one has been cut off.
    pub fn append(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        self.cut_rest()?;
        self.is_torn = true;
        if let Err(error) = self.write(bytes) {
            // Now, for the program may be killed before the next record. If it fails, it comes first then.
            let _ = self.cut_rest();
            return Err(FileError::writing(&self.path, &error));
        }
        self.is_torn = false;
        self.length += bytes.len() as u64;
        Ok(())
    }

    /// Takes back the records behind the first `length` bytes.
    pub fn take_back(&mut self, length: u64) {
        self.is_torn |= length < self.length;
        self.length = self.length.min(length);
        // If it fails, it comes before the next record.
        let _ = self.cut_rest();
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut done = 0;
        while done < bytes.len() {
            match self
                .file
                .write_at(&bytes[done..], self.length + done as u64)
            {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(n) => done += n,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        self.file.sync()
    }

    /// Cuts off what follows the whole records, and makes sure of it.
    fn cut_rest(&mut self) -> Result<(), FileError> {
        if !self.is_torn {
            return Ok(());
        }
        let cut = self.file.cut(self.length);
        let there = cut
            .and_then(|()| self.file.sync())
            .and_then(|()| self.file.length())
            .map_err(|error| FileError::writing(&self.path, &error))?;
        if there != self.length {
            return Err(FileError::new(
                &self.path,
                format_args!("has {there} bytes where {} were left", self.length),
                "check the disk and that no other program writes there",
            ));
        }
        self.is_torn = false;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    /// A disk that is full for so many calls, after a part of the record.
    #[derive(Debug, Default)]
    struct Full {
        bytes: Arc<Mutex<Vec<u8>>>,
        calls: u32,
        fails: std::ops::Range<u32>,
    }

    impl Full {
        fn call(&mut self) -> io::Result<()> {
            self.calls += 1;
            if self.fails.contains(&self.calls) {
                return Err(ErrorKind::StorageFull.into());
            }
            Ok(())
        }
    }

    impl LogFile for Full {
        fn write_at(&mut self, bytes: &[u8], at: u64) -> io::Result<usize> {
            self.call()?;
            let mut file = self.bytes.lock().unwrap();
            let some = bytes.len().min(5);
            file.truncate(at as usize);
            file.extend(&bytes[..some]);
            Ok(some)
        }

        fn sync(&mut self) -> io::Result<()> {
            self.call()
        }

        fn cut(&mut self, length: u64) -> io::Result<()> {
            self.call()?;
            self.bytes.lock().unwrap().truncate(length as usize);
            Ok(())
        }

        fn length(&mut self) -> io::Result<u64> {
            self.call()?;
            Ok(self.bytes.lock().unwrap().len() as u64)
        }
    }

    #[test]
    fn a_record_that_failed_leaves_nothing_before_the_next_one_wherever_and_however_often_the_disk_fails()
     {
        for first in 5..17 {
            for failures in 1..9 {
                // Opening takes four calls.
                let disk = Full {
                    fails: first..first + failures,
                    ..Full::default()
                };
                let bytes = disk.bytes.clone();
                let path = Path::new("frames.bin");
                let mut log = AppendLog::open(path, Box::new(disk), 0).unwrap();
                let mut kept = String::new();
                let mut refused = 0;
                for k in 0..20 {
                    let record = format!("record {k};");
                    match log.append(record.as_bytes()) {
                        Ok(()) => kept += &record,
                        Err(_) => refused += 1,
                    }
                    let file = bytes.lock().unwrap();
                    // A torn record may lie behind the whole ones, and never between them.
                    assert!(file.starts_with(kept.as_bytes()), "{first} {failures}");
                }
                assert_eq!(*bytes.lock().unwrap(), kept.as_bytes());
                assert!(refused > 0, "{first} {failures}");
            }
        }
    }

    #[test]
    fn a_file_that_is_too_short_is_refused_and_a_longer_one_is_cut() {
        for (there, fine) in [(3, false), (4, true), (9, true)] {
            let disk = Full::default();
            let bytes = disk.bytes.clone();
            bytes.lock().unwrap().resize(there, 7);
            let log = AppendLog::open(Path::new("x"), Box::new(disk), 4);
            assert_eq!(log.is_ok(), fine);
            assert_eq!(bytes.lock().unwrap().len(), there.min(4));
        }
    }
}
