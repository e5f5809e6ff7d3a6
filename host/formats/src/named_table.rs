//! Tables whose columns are found by name, in every dialect that [`TextTable`] reads, with errors that name
//! the line.

use crate::FileError;
use crate::column_name::{Quantity, column_name};
use crate::text_file::{decoded, not_text, read_text};
use crate::text_table::{Rows, TextTable};
use gonia_brdf::{Direction, Pose};
use std::path::Path;
use std::str::FromStr;

/// The angles of a pose, as gonia writes them.
const ANGLES: [&str; 4] = ["theta_i_deg", "phi_i_deg", "theta_v_deg", "phi_v_deg"];

/// A table, and what its columns are.
pub(super) struct NamedTable {
    table: TextTable,
    columns: Vec<Name>,
}

/// What a column is called.
struct Name {
    /// As in the file.
    text: String,
    /// In lower case, words joined by `_`, without a unit.
    plain: String,
    /// The quantity, where it is one of samples; and whether it is an angle in radians.
    quantity: Option<(Quantity, bool)>,
}

/// A column of angles.
#[derive(Clone, Copy, Debug)]
pub(super) struct AngleColumn {
    place: usize,
    radians: bool,
}

impl NamedTable {
    /// Reads a file, whose header names at least these columns, and whose rows have at least so many
    /// numbers.
    pub fn open(path: &Path, names: &[&str], numbers: usize) -> Result<Self, FileError> {
        Ok(Self::of_text(path, read_text(path)?, names, numbers))
    }

    /// The same, of bytes that came from elsewhere; `path` says where from.
    pub fn of_bytes(
        path: &Path,
        bytes: Vec<u8>,
        names: &[&str],
        numbers: usize,
    ) -> Result<Self, FileError> {
        let text = decoded(bytes).ok_or_else(|| not_text(path))?;
        Ok(Self::of_text(path, text, names, numbers))
    }

    fn of_text(path: &Path, text: String, names: &[&str], numbers: usize) -> Self {
        let is_header = |fields: &[String]| {
            let columns: Vec<Name> = fields.iter().map(|field| Name::of(field)).collect();
            let has = |name: &&str| columns.iter().any(|column| column.is(name));
            names.iter().all(has)
        };
        let table = TextTable::new(path, text, numbers, &is_header);
        let header = table.header.iter().flat_map(|header| &header.names);
        let columns = header.map(|name| Name::of(name)).collect();
        Self { table, columns }
    }

    /// The place of a column that must be there.
    pub fn column(&self, name: &str) -> Result<usize, FileError> {
        self.optional_column(name)?.ok_or_else(|| {
            let found: Vec<&str> = self.columns.iter().map(|c| c.text.as_str()).collect();
            let found = match found.as_slice() {
                [] => "the file has no header".to_owned(),
                found => format!("found: {}", found.join(", ")),
            };
            self.of_header(
                format_args!("there is no column \"{name}\"; {found}"),
                "name the columns in the first line",
            )
        })
    }

    /// The place of a column that may be there.
    pub fn optional_column(&self, name: &str) -> Result<Option<usize>, FileError> {
        let all = 0..self.columns.len();
        // Of several spellings the exact one counts: others may be what the arms were sent to.
        let mut exact = all.clone().filter(|i| self.columns[*i].text == name);
        if let (Some(place), None) = (exact.next(), exact.next()) {
            return Ok(Some(place));
        }
        let mut places = all.filter(|i| self.columns[*i].is(name));
        let first = places.next();
        if let (Some(first), Some(second)) = (first, places.next()) {
            let [first, second] = [first, second].map(|place| &self.columns[place].text);
            return Err(self.of_header(
                if first == second {
                    format!("column \"{first}\" is there twice")
                } else {
                    format!("{first} and {second} are columns of the same quantity")
                },
                "keep one of them",
            ));
        }
        Ok(first)
    }

    /// A column of angles, which must be there.
    pub fn angle(&self, name: &str) -> Result<AngleColumn, FileError> {
        let place = self.column(name)?;
        let radians = self.columns[place].quantity.is_some_and(|(_, rad)| rad);
        Ok(AngleColumn { place, radians })
    }

    /// The columns of a pose: theta_i, phi_i, theta_v, phi_v.
    pub fn angles(&self) -> Result<[AngleColumn; 4], FileError> {
        let [a, b, c, d] = ANGLES.map(|name| self.angle(name));
        Ok([a?, b?, c?, d?])
    }

    /// The rows from the first one on.
    pub fn rows(&self) -> NamedRows<'_> {
        NamedRows {
            table: self,
            rows: self.table.rows(),
        }
    }

    fn of_header(&self, problem: impl std::fmt::Display, remedy: &str) -> FileError {
        let line = self.table.header.as_ref().map_or(1, |header| header.line);
        self.table.wrong(line, problem, remedy)
    }
}

impl Name {
    fn of(text: &str) -> Self {
        let before_unit = text.split(['[', '(']).next().unwrap_or_default();
        let plain = before_unit.trim().to_lowercase().replace([' ', '-'], "_");
        let known = column_name(text);
        Self {
            text: text.to_owned(),
            plain,
            quantity: known.map(|known| (known.quantity, known.radians)),
        }
    }

    /// Whether it is another spelling of a name.
    fn is(&self, name: &str) -> bool {
        let quantity = self.quantity.map(|(quantity, _)| quantity);
        let same = quantity.is_some() && quantity == column_name(name).map(|n| n.quantity);
        same || self.plain == name
    }
}

/// The rows of a table, one after the other.
pub(super) struct NamedRows<'a> {
    table: &'a NamedTable,
    rows: Rows<'a>,
}

impl NamedRows<'_> {
    /// Goes to the next row; `false` at the end.
    pub fn advance(&mut self) -> Result<bool, FileError> {
        self.rows.advance()
    }

    /// The line of the current row, counted from 1.
    pub fn line(&self) -> usize {
        self.rows.line()
    }

    /// A field of the current row as text.
    pub fn text(&self, column: usize) -> &str {
        self.rows.text(column)
    }

    /// A field of the current row as a number of some type.
    pub fn number<T: FromStr>(&mut self, column: usize) -> Result<T, FileError> {
        self.rows.number(column).map_err(|(problem, remedy)| {
            let name = self.table.columns.get(column).map_or("", |c| &c.text);
            self.wrong(format_args!("{name} {problem}"), remedy)
        })
    }

    /// An angle of the current row as it stands there, and in degrees.
    pub fn angle(&mut self, column: AngleColumn) -> Result<(f64, f64), FileError> {
        let value: f64 = self.number(column.place)?;
        let degrees = if column.radians {
            value.to_degrees()
        } else {
            value
        };
        if value.is_finite() {
            return Ok((value, degrees));
        }
        Err(self.wrong(
            format_args!("{} is {value}", self.table.columns[column.place].text),
            "remove the row or mend its value",
        ))
    }

    /// Where the arms were in the current row.
    pub fn pose(&mut self, columns: [AngleColumn; 4]) -> Result<Pose, FileError> {
        let [theta_i, phi_i, theta_v, phi_v] = columns;
        Ok(Pose {
            light: self.arm_direction(theta_i, phi_i)?,
            view: self.arm_direction(theta_v, phi_v)?,
        })
    }

    /// Where an arm points in the current row: −1° < θ < 90°, any finite φ. An arm sent to its zero
    /// may read a little to the other side of it; its azimuth, and with it the way the camera is
    /// turned, is still φ.
    fn arm_direction(
        &mut self,
        theta: AngleColumn,
        phi: AngleColumn,
    ) -> Result<Direction, FileError> {
        let (value, theta_deg) = self.angle(theta)?;
        if !(theta_deg > -1.0 && theta_deg < 90.0) {
            let name = &self.table.columns[theta.place].text;
            let unit = if theta.radians { " radians" } else { "" };
            return Err(self.wrong(
                format_args!("{name} {value}{unit} is not a polar angle"),
                "give degrees from the normal, from 0 (an arm's zero may read a little less) to below 90",
            ));
        }
        Ok(Direction::from_deg(theta_deg, self.angle(phi)?.1))
    }

    /// An error in the current row.
    pub fn wrong(
        &self,
        problem: impl std::fmt::Display,
        remedy: impl std::fmt::Display,
    ) -> FileError {
        self.table.table.wrong(self.rows.line(), problem, remedy)
    }
}
