//! CSV files whose columns are found by name, with errors that name the line.

use crate::FileError;
use csv::{ByteRecord, Position, ReaderBuilder, Trim};
use gonia_brdf::Direction;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A CSV file being read row by row.
pub(super) struct CsvTable {
    path: PathBuf,
    reader: csv::Reader<File>,
    header: Vec<String>,
    record: ByteRecord,
}

impl CsvTable {
    /// Opens a file and reads its header.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = File::open(path).map_err(|error| FileError::reading(path, &error))?;
        let mut reader = ReaderBuilder::new()
            .trim(Trim::All)
            .comment(Some(b'#'))
            .buffer_capacity(1 << 18)
            .from_reader(file);
        let header = reader
            .headers()
            .map_err(|error| wrong_csv(path, &error))?
            .iter()
            // Spreadsheets put a byte-order mark in front of the first name.
            .map(|name| name.trim_start_matches('\u{feff}').to_owned())
            .collect();
        Ok(Self {
            path: path.to_owned(),
            reader,
            header,
            record: ByteRecord::new(),
        })
    }

    /// The place of a column that must be there.
    pub fn column(&self, name: &str) -> Result<usize, FileError> {
        self.optional_column(name)?.ok_or_else(|| {
            FileError::new(
                &self.path,
                format_args!("there is no column \"{name}\""),
                "name the columns in the first line",
            )
            .at("line 1")
        })
    }

    /// The place of a column that may be there.
    pub fn optional_column(&self, name: &str) -> Result<Option<usize>, FileError> {
        let mut places = (0..self.header.len()).filter(|i| self.header[*i] == name);
        let first = places.next();
        if places.next().is_some() {
            return Err(FileError::new(
                &self.path,
                format_args!("column \"{name}\" is there twice"),
                "keep one of them",
            )
            .at("line 1"));
        }
        Ok(first)
    }

    /// Reads the next row; `false` at the end.
    pub fn next_row(&mut self) -> Result<bool, FileError> {
        self.reader
            .read_byte_record(&mut self.record)
            .map_err(|error| wrong_csv(&self.path, &error))
    }

    /// A field of the current row as text.
    pub fn text(&self, column: usize) -> Result<&str, FileError> {
        let bytes = self.record.get(column).unwrap_or_default();
        std::str::from_utf8(bytes)
            .map_err(|_| self.wrong("a field is not UTF-8 text", "save the file as UTF-8"))
    }

    /// A field of the current row as a number of some type.
    pub fn number<T: FromStr>(&self, column: usize) -> Result<T, FileError> {
        let text = self.text(column)?;
        text.parse().map_err(|_| {
            self.wrong(
                format_args!(
                    "{} \"{text}\" is not a number it can be",
                    self.header[column]
                ),
                "write a number, with a point for decimals",
            )
        })
    }

    /// Where an arm points in the current row: −1° < θ < 90°, any finite φ. An arm sent to its zero
    /// may read a little to the other side of it; its azimuth, and with it the way the camera is
    /// turned, is still φ.
    pub fn arm_direction(&self, theta: usize, phi: usize) -> Result<Direction, FileError> {
        let theta_deg: f64 = self.number(theta)?;
        if !(theta_deg > -1.0 && theta_deg < 90.0) {
            return Err(self.wrong(
                format_args!("{} {theta_deg} is not a polar angle", self.header[theta]),
                "give degrees from the normal, from 0 (an arm's zero may read a little less) to below 90",
            ));
        }
        Ok(Direction::from_deg(theta_deg, self.finite(phi)?))
    }

    /// A finite number of the current row.
    fn finite(&self, column: usize) -> Result<f64, FileError> {
        let value: f64 = self.number(column)?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.wrong(
            format_args!("{} is {value}", self.header[column]),
            "remove the row or mend its value",
        ))
    }

    /// An error in the current row.
    pub fn wrong(
        &self,
        problem: impl std::fmt::Display,
        remedy: impl std::fmt::Display,
    ) -> FileError {
        FileError::new(&self.path, problem, remedy).at(format_args!("line {}", self.line()))
    }

    /// The line of the current row.
    pub fn line(&self) -> u64 {
        self.record.position().map_or(0, Position::line)
    }
}

fn wrong_csv(path: &Path, error: &csv::Error) -> FileError {
    let line = error.position().map(Position::line);
    let found = match error.kind() {
        csv::ErrorKind::Io(error) => return FileError::reading(path, error),
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => FileError::new(
            path,
            format_args!("{len} fields where the first line names {expected_len}"),
            "give every row a field for each column",
        ),
        csv::ErrorKind::Utf8 { .. } => {
            FileError::new(path, "is not UTF-8 text", "save the file as UTF-8")
        }
        _ => FileError::new(path, error, "check the row"),
    };
    match line {
        Some(line) => found.at(format_args!("line {line}")),
        None => found,
    }
}
