//! A table of numbers as text: where its header is, what separates its fields, and its rows.
//!
//! Nothing is taken from a single place: the separator is the one by which the rows have as many
//! fields as the header and numbers in them, and a decimal comma must stay one in the whole table.

use crate::FileError;
use crate::decimal::{DecimalMark, is_number, parse_number};
use crate::text_fields::{SEPARATORS, Separator, split, split_into};
use crate::text_lines::{Lines, comment};
use crate::text_top::{Header, Top, top};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Rows by which the separator is found.
const SAMPLED_ROWS: usize = 200;

/// A table whose header was found and whose rows can be read.
pub(super) struct TextTable {
    path: PathBuf,
    text: String,
    /// Absent where the first line holds numbers.
    pub header: Option<Header>,
    /// Where the rows begin: byte, and number of the line.
    start: (usize, usize),
    separator: Separator,
    /// Fields of a row.
    pub columns: usize,
}

impl TextTable {
    /// Finds the header and the separator. `is_header` says whether these names are the header's;
    /// a line of at least `least` numbers is a row.
    pub fn new(
        path: &Path,
        text: String,
        least: usize,
        is_header: &dyn Fn(&[String]) -> bool,
    ) -> Self {
        let text = if text.contains('\n') {
            text
        } else {
            text.replace('\r', "\n")
        };
        let Top {
            header,
            start,
            separator: likely,
            ..
        } = top(&text, least, is_header);
        let expected = header.as_ref().map(|header| header.names.len());
        let rows = &text[start.0..];
        let (separator, columns) = separator_of(rows, least, expected)
            .unwrap_or((likely.unwrap_or(Separator::Character(',')), 0));
        Self {
            path: path.to_owned(),
            header,
            start,
            separator,
            columns: expected.unwrap_or(columns),
            text,
        }
    }

    /// The rows from the first one on.
    pub fn rows(&self) -> Rows<'_> {
        Rows {
            table: self,
            lines: Lines::of(&self.text[self.start.0..], self.start.1),
            fields: Vec::new(),
            line: self.start.1,
            mark: None,
        }
    }

    /// Whether commas separate the fields.
    pub fn is_separated_by_commas(&self) -> bool {
        self.separator == Separator::Character(',')
    }

    /// A problem of a line.
    pub fn wrong(
        &self,
        line: usize,
        problem: impl std::fmt::Display,
        remedy: impl std::fmt::Display,
    ) -> FileError {
        FileError::new(&self.path, problem, remedy).at(format_args!("line {line}"))
    }
}

/// The rows of a table, one after the other.
pub(super) struct Rows<'a> {
    table: &'a TextTable,
    lines: Lines<'a>,
    fields: Vec<Cow<'a, str>>,
    line: usize,
    /// The first mark of decimals, and its line.
    mark: Option<(DecimalMark, usize)>,
}

impl Rows<'_> {
    /// Goes to the next row; `false` at the end.
    ///
    /// # Errors
    /// A row that has not as many fields as there are columns.
    pub fn advance(&mut self) -> Result<bool, FileError> {
        let table = self.table;
        while let Some(line) = self.lines.next_record() {
            if line.text.trim().is_empty() || comment(line.text).is_some() {
                continue;
            }
            self.line = line.number;
            split_into(line.text, table.separator, &mut self.fields);
            // Spreadsheets end rows with separators, and tables with rows of nothing else.
            if self.fields.iter().all(|field| field.is_empty()) {
                continue;
            }
            while self.fields.len() > table.columns
                && self.fields.last().is_some_and(|f| f.is_empty())
            {
                self.fields.pop();
            }
            if self.fields.len() != table.columns {
                return Err(self.wrong_length());
            }
            return Ok(true);
        }
        Ok(false)
    }

    /// The line of the current row, counted from 1.
    pub fn line(&self) -> usize {
        self.line
    }

    /// A field of the current row.
    pub fn text(&self, column: usize) -> &str {
        self.fields.get(column).map_or("", |field| field)
    }

    /// A number of the current row.
    ///
    /// # Errors
    /// The field holds none, or its decimals follow another mark than those before it; with its remedy.
    pub fn number<T: FromStr>(&mut self, column: usize) -> Result<T, (String, &'static str)> {
        let text = self.text(column);
        let Some((number, mark)) = parse_number(text) else {
            return Err((
                format!("\"{text}\" is not a number"),
                "write a number, without separators of thousands",
            ));
        };
        match (mark, self.mark) {
            (Some(mark), None) => self.mark = Some((mark, self.line)),
            (Some(mark), Some((first, line))) if mark != first => {
                let [here, there] = [mark, first].map(|mark| match mark {
                    DecimalMark::Point => "point",
                    DecimalMark::Comma => "comma",
                });
                return Err((
                    format!(
                        "\"{text}\" has a decimal {here}, numbers from line {line} on have a {there}"
                    ),
                    "write all decimals after points, or all after commas",
                ));
            }
            _ => {}
        }
        Ok(number)
    }

    /// Whether any number so far had decimals.
    pub fn had_decimals(&self) -> bool {
        self.mark.is_some()
    }

    fn wrong_length(&self) -> FileError {
        let (found, columns) = (self.fields.len(), self.table.columns);
        let of = match &self.table.header {
            Some(header) => format!("{found} fields where line {} names {columns}", header.line),
            None => format!("{found} fields where the rows before have {columns}"),
        };
        let whole = |field: &Cow<'_, str>| {
            field
                .trim_start_matches('-')
                .bytes()
                .all(|b| b.is_ascii_digit())
        };
        let commas = self.table.is_separated_by_commas() && found > columns;
        if commas && self.fields.iter().all(whole) {
            return self.table.wrong(
                self.line,
                format_args!("{of}: decimal commas cannot be told from commas between fields"),
                "separate the fields by semicolons, or write decimal points",
            );
        }
        self.table
            .wrong(self.line, of, "give every row a field for each column")
    }
}

/// The separator by which most of the first rows have the header's number of fields, or that of the
/// first row, and numbers enough; `None` where no row has.
fn separator_of(rows: &str, least: usize, expected: Option<usize>) -> Option<(Separator, usize)> {
    let mut best = None;
    let mut most = 0;
    for separator in SEPARATORS {
        let mut lines = Lines::of(rows, 1);
        let (mut columns, mut sound, mut seen) = (expected, 0, 0);
        while seen < SAMPLED_ROWS
            && let Some(line) = lines.next_record()
        {
            if line.text.trim().is_empty() || comment(line.text).is_some() {
                continue;
            }
            seen += 1;
            let mut fields = split(line.text, separator);
            while fields.len() > columns.unwrap_or(0) && fields.last().is_some_and(|f| f.is_empty())
            {
                fields.pop();
            }
            let numbers = fields.iter().filter(|field| is_number(field)).count();
            let columns = *columns.get_or_insert(fields.len());
            sound += usize::from(fields.len() == columns && numbers >= least);
        }
        if sound > most {
            most = sound;
            best = Some((separator, columns.unwrap_or(0)));
        }
    }
    best
}
