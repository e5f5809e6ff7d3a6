//! What is said of data aside from errors.

use std::fmt;

/// One line about data that were used all the same: what was assumed of them, or what speaks against
/// an assumption, and what to do. A command prints it as a warning; nothing is wrong without a word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remark(String);

impl Remark {
    /// Of a file, a column or a frame: what was found there, and what to do.
    pub fn new(
        place: impl fmt::Display,
        what: impl fmt::Display,
        remedy: impl fmt::Display,
    ) -> Self {
        Self(format!("{place}: {what}; {remedy}"))
    }

    /// One that was made elsewhere, as the line that it is.
    pub fn of_line(line: &str) -> Self {
        Self(line.to_owned())
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
