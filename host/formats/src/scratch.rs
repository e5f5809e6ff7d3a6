//! Room on the disk for what does not fit memory: a file without a name beside an output, which is gone with the
//! process, however that ends.

use crate::FileError;
use crate::floats::{floats_of, write_bytes};
use crate::read_at::{read_exact_at, write_all_at};
use crate::whole_file::folder_of;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Numbers that are put down one after the other and looked up anywhere, from several threads.
#[derive(Debug)]
pub struct Scratch {
    file: File,
    /// Whose errors it speaks of.
    output: PathBuf,
    /// Numbers so far.
    end: AtomicU64,
}

impl Scratch {
    /// On the disk of an output.
    ///
    /// # Errors
    /// The output's folder cannot be written to.
    pub fn beside(output: &Path) -> Result<Self, FileError> {
        let file = tempfile::tempfile_in(folder_of(output));
        Ok(Self {
            file: file.map_err(|error| FileError::writing(output, &error))?,
            output: output.to_owned(),
            end: AtomicU64::new(0),
        })
    }

    /// Puts numbers down; returns where they begin.
    ///
    /// # Errors
    /// The disk is full.
    pub fn put(&self, values: &[f32]) -> Result<u64, FileError> {
        let at = self.end.fetch_add(values.len() as u64, Relaxed);
        let written = write_bytes(values, |before, bytes| {
            write_all_at(&self.file, bytes, 4 * (at + before as u64))
        });
        written.map_err(|error| {
            let so_far = 4.0 * (at + values.len() as u64) as f64 / 1e9;
            FileError::new(
                &self.output,
                format_args!(
                    "what is kept on its disk until it is written has reached {so_far:.1} GB: {error}"
                ),
                "free some of the disk, or give a path on another one",
            )
        })?;
        Ok(at)
    }

    /// Appends to `into` so many numbers from where they begin.
    ///
    /// # Errors
    /// The disk fails, or so many were not put down.
    pub fn get(&self, at: u64, count: usize, into: &mut Vec<f32>) -> Result<(), FileError> {
        let mut bytes = vec![0; 4 * count];
        let read = read_exact_at(&self.file, &mut bytes, 4 * at);
        read.map_err(|error| FileError::reading(&self.output, &error))?;
        into.extend(floats_of(&bytes));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_from_anywhere_and_nothing_is_left() {
        let dir = tempfile::tempdir().unwrap();
        let scratch = Scratch::beside(&dir.path().join("dense.exr")).unwrap();
        let first = scratch.put(&[1.0, 2.0, 3.0]).unwrap();
        let second = scratch.put(&[4.0]).unwrap();
        let mut found = Vec::new();
        scratch.get(second, 1, &mut found).unwrap();
        scratch.get(first + 1, 2, &mut found).unwrap();
        assert_eq!(found, [4.0, 2.0, 3.0]);
        assert!(scratch.get(second, 2, &mut found).is_err());
        drop(scratch);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        let error = Scratch::beside(&dir.path().join("no/dense.exr")).unwrap_err();
        assert_eq!(error.to_string().lines().count(), 1);
    }
}
