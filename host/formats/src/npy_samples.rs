//! An array of numpy's as samples: which of its elements is which number of which sample.

use crate::FileError;
use crate::npy::{NpyHeader, shape_text};
use crate::npy_type::{ElementType, Field, NumberType};
use crate::sample_columns::{NumberRow, SampleColumns};
use crate::sample_rows::{BadRow, frame_of_number, sample_from_row};
use gonia_rig::{Remark, SampleValues};
use std::io::{self, Read};
use std::ops::RangeInclusive;
use std::path::Path;

/// Rows read at a time.
const ROWS: usize = 1 << 13;

/// Columns that an array without names may have.
const COLUMNS: RangeInclusive<u64> = 5..=8;

/// Memory is reserved for so many samples before they came, where a length is only claimed.
const MOST_RESERVED: usize = 1 << 20;

/// What is needed, as a remedy says it.
const NEEDED: &str = "save N × 7 of float32 (theta_i, phi_i, theta_v, phi_v, r, g, b), or N × 8 with the frame last; bands as records with names (450nm)";

/// Where the numbers of each sample stand.
pub(super) struct SampleArray {
    columns: SampleColumns,
    /// Of each column the place of its first number, in bytes, and its type.
    numbers: Vec<(usize, NumberType)>,
    rows: usize,
    /// Bytes from a sample to the next in the same column.
    step: usize,
    /// Whether a sample's numbers stand together; else those of a column do.
    by_rows: bool,
    /// Bytes of an element.
    element_bytes: usize,
    /// What is remarkable about the types.
    remarks: Vec<&'static str>,
}

/// Why an array cannot be samples.
pub(super) struct NotSamples {
    problem: String,
    remedy: &'static str,
}

impl NotSamples {
    /// As the error of a file.
    pub fn of(self, path: &Path) -> FileError {
        FileError::new(path, self.problem, self.remedy)
    }
}

impl SampleArray {
    /// Of an array with this header.
    pub fn new(header: &NpyHeader) -> Result<Self, NotSamples> {
        let holds = || format!("holds {}", header.descr);
        let element = ElementType::of(&header.descr).ok_or_else(|| NotSamples {
            problem: holds(),
            remedy: NEEDED,
        })?;
        let mut array = if element.is_record {
            Self::of_records(header, &element)?
        } else {
            let number = element.fields.first().and_then(|field| field.number);
            Self::of_numbers(
                header,
                number.ok_or_else(|| NotSamples {
                    problem: holds(),
                    remedy: NEEDED,
                })?,
            )?
        };
        array.element_bytes = element.bytes;
        // Float16 tells whole numbers apart up to 2047.
        let is_coarse = |place: usize| array.numbers[place].1.last_whole() < 1 << 12;
        if array.columns.places().take(4).any(is_coarse) {
            array.remarks.push(
                "its angles are float16, which rounds those above 256° to a quarter of a degree",
            );
        }
        Ok(array)
    }

    fn of_records(header: &NpyHeader, element: &ElementType) -> Result<Self, NotSamples> {
        // A column or a row of records is a list of them.
        let rows = match header.shape[..] {
            [rows] | [rows, 1] | [1, rows] => rows,
            _ => {
                return Err(NotSamples {
                    problem: format!("has the shape {} of records", shape_text(&header.shape)),
                    remedy: "save a list of records, one a sample",
                });
            }
        };
        let names: Vec<&str> = element.fields.iter().map(|field| &field.name[..]).collect();
        let columns = SampleColumns::by_names(&names).map_err(|unclear| NotSamples {
            problem: unclear.problem,
            remedy: unclear.remedy,
        })?;
        // Columns that are not read need no type.
        let of_field = |field: &Field| (field.offset, field.number.unwrap_or(NumberType::SINGLE));
        let numbers = element.fields.iter().map(of_field).collect();
        for place in columns.places() {
            let field = &element.fields[place];
            if field.number.is_none() {
                return Err(NotSamples {
                    problem: format!("{} is no number but {}", field.name, field.text),
                    remedy: "save it as float32 or float64",
                });
            }
        }
        Ok(Self {
            columns,
            numbers,
            rows: usize::try_from(rows).unwrap_or(usize::MAX),
            step: element.bytes,
            by_rows: true,
            element_bytes: 0,
            remarks: Vec::new(),
        })
    }

    fn of_numbers(header: &NpyHeader, number: NumberType) -> Result<Self, NotSamples> {
        let wrong = |what: &str| NotSamples {
            problem: format!("has the shape {}{what}", shape_text(&header.shape)),
            remedy: NEEDED,
        };
        let [first, second] = header.shape[..] else {
            return Err(wrong(""));
        };
        let (rows, columns, columns_first) =
            match (COLUMNS.contains(&first), COLUMNS.contains(&second)) {
                // What gonia writes, however few the rows.
                (_, true) if second >= 7 => (first, second, false),
                (false, true) => (first, second, false),
                (true, false) => (second, first, true),
                (true, true) => return Err(wrong(": either side may be the columns")),
                (false, false) => return Err(wrong("")),
            };
        let size = number.bytes();
        let by_rows = header.fortran_order == columns_first;
        let (n_columns, n_rows) = (
            columns as usize,
            usize::try_from(rows).unwrap_or(usize::MAX),
        );
        let to_next = if by_rows {
            size
        } else {
            n_rows.saturating_mul(size)
        };
        Ok(Self {
            columns: SampleColumns::by_count(n_columns).ok_or_else(|| wrong(""))?,
            numbers: (0..n_columns)
                .map(|k| (k.saturating_mul(to_next), number))
                .collect(),
            rows: n_rows,
            step: if by_rows { n_columns * size } else { size },
            by_rows,
            element_bytes: 0,
            remarks: Vec::new(),
        })
    }

    /// Bytes of an element, for the check against the file's length.
    pub fn element_bytes(&self) -> usize {
        self.element_bytes
    }

    /// What is to be said of the array.
    pub fn remarks(&self, path: &Path) -> Vec<Remark> {
        let of_types = self.remarks.iter().map(|what| {
            Remark::new(
                path.display(),
                what,
                "save float32 where angles are known better",
            )
        });
        self.columns.remarks(path).chain(of_types).collect()
    }

    /// Reads the samples from the elements. `is_there` says that all of their bytes are in the file.
    ///
    /// # Errors
    /// The row that holds no sample, or an error of the reader.
    pub fn read(&self, data: &mut impl Read, is_there: bool) -> Result<SampleValues, RowError> {
        let most = if is_there { usize::MAX } else { MOST_RESERVED };
        let mut samples = self.columns.room(self.rows.min(most));
        if !self.by_rows {
            let all = self.numbers.len() * self.rows * self.element_bytes;
            let mut bytes = Vec::with_capacity(all.min(most));
            data.take(all as u64).read_to_end(&mut bytes)?;
            if bytes.len() < all {
                return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
            }
            self.append(&bytes, self.rows, &mut samples)?;
            return Ok(samples);
        }
        let mut buffer = vec![0; ROWS.min(self.rows) * self.step];
        while samples.len() < self.rows {
            let rows = ROWS.min(self.rows - samples.len());
            let chunk = &mut buffer[..rows * self.step];
            data.read_exact(chunk)?;
            self.append(chunk, rows, &mut samples)?;
        }
        Ok(samples)
    }

    /// Appends the samples of so many rows that stand in `bytes`.
    fn append(
        &self,
        bytes: &[u8],
        rows: usize,
        samples: &mut SampleValues,
    ) -> Result<(), RowError> {
        let bad = |row: usize| move |bad| RowError::Bad { row, bad };
        if let SampleValues::Rgb(samples) = samples
            && self.is_single_by_rows()
        {
            let mut row = [0f32; 8];
            let n_columns = self.numbers.len();
            for one in bytes.chunks_exact(self.step) {
                for (value, four) in row.iter_mut().zip(one.as_chunks::<4>().0) {
                    *value = f32::from_le_bytes(*four);
                }
                samples.push(sample_from_row(&row[..n_columns]).map_err(bad(samples.len()))?);
            }
            return Ok(());
        }
        for row in 0..rows {
            let mut row = ArrayRow {
                numbers: &self.numbers,
                bytes: &bytes[row * self.step..],
            };
            let number = samples.len();
            self.columns.push(&mut row, samples).map_err(bad(number))?;
        }
        Ok(())
    }

    /// What gonia writes, of which there may be ten million rows.
    fn is_single_by_rows(&self) -> bool {
        let columns = self.numbers.len();
        let mut numbers = self.numbers.iter().enumerate();
        matches!(columns, 7 | 8)
            && self.by_rows
            && numbers.all(|(k, number)| *number == (4 * k, NumberType::SINGLE))
            && self.step == 4 * columns
            && SampleColumns::by_count(columns).is_some_and(|usual| usual == self.columns)
    }
}

/// Why the samples of an array were not all read.
pub(super) enum RowError {
    /// A row that holds no sample.
    Bad { row: usize, bad: BadRow },
    /// The elements could not be read.
    Io(io::Error),
}

impl From<io::Error> for RowError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// A row of an array.
struct ArrayRow<'a> {
    numbers: &'a [(usize, NumberType)],
    bytes: &'a [u8],
}

impl NumberRow for ArrayRow<'_> {
    fn single(&mut self, column: usize) -> Result<f32, BadRow> {
        Ok(self.double(column)? as f32)
    }

    fn double(&mut self, column: usize) -> Result<f64, BadRow> {
        let (at, number) = self.numbers[column];
        Ok(number.number(&self.bytes[at..]))
    }

    fn frame(&mut self, column: usize) -> Result<u32, BadRow> {
        frame_of_number(self.double(column)?, self.numbers[column].1.last_whole())
    }
}
