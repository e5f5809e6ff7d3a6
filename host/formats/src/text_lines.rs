//! The lines of a table as text.

/// Lines that a quoted field may go on over.
const MOST_LINES_OF_A_FIELD: usize = 100;

/// What stands in a line of comment.
pub(super) fn comment(line: &str) -> Option<&str> {
    let line = line.trim();
    let inside = ["#", "%", "//"]
        .iter()
        .find_map(|mark| line.strip_prefix(mark))?;
    Some(inside.trim_start_matches(['#', '%', '/']))
}

/// A line of a text, or several that a quoted field goes on over.
pub(super) struct Line<'a> {
    /// Without its end.
    pub text: &'a str,
    /// Counted from 1.
    pub number: usize,
}

/// The lines of a text from a place on.
#[derive(Clone)]
pub(super) struct Lines<'a> {
    text: &'a str,
    /// Where the next line begins.
    pub offset: usize,
    /// The number of the next line.
    pub number: usize,
}

impl<'a> Lines<'a> {
    /// Of a text whose first line has this number.
    pub fn of(text: &'a str, number: usize) -> Self {
        Self {
            text,
            offset: 0,
            number,
        }
    }

    /// The next line, with those that a quoted field goes on over; `None` at the end.
    pub fn next_record(&mut self) -> Option<Line<'a>> {
        let rest = &self.text[self.offset..];
        let mut ends = rest.split_inclusive('\n').scan(0, |end, line| {
            *end += line.len();
            Some((*end, line))
        });
        let (first_end, first) = ends.next()?;
        let (mut end, mut lines) = (first_end, 1);
        if first.contains('"') && comment(first).is_none() {
            let mut quotes = 0;
            let all = std::iter::once((first_end, first)).chain(ends);
            for (k, (until, line)) in all.take(MOST_LINES_OF_A_FIELD).enumerate() {
                quotes += line.matches('"').count();
                if quotes % 2 == 0 {
                    (end, lines) = (until, k + 1);
                    break;
                }
            }
        }
        let line = Line {
            text: rest[..end].trim_end_matches(['\n', '\r']),
            number: self.number,
        };
        self.offset += end;
        self.number += lines;
        Some(line)
    }
}
