//! What stands above the rows of a table as text: comments, titles, the header, a line of units.

use crate::column_name::are_units;
use crate::decimal::is_number;
use crate::text_fields::{SEPARATORS, Separator, split};
use crate::text_lines::{Line, Lines, comment};
use std::borrow::Cow;

/// Lines of words that may stand above the header.
const MOST_TITLES: usize = 50;

/// The names of the columns.
pub(super) struct Header {
    /// In the order of the file.
    pub names: Vec<String>,
    /// Counted from 1.
    pub line: usize,
}

/// What stands above the rows.
pub(super) struct Top {
    /// The names of the columns, where a line has them.
    pub header: Option<Header>,
    /// Lines that begin with `#`, without it.
    pub comments: Vec<String>,
    /// Where the rows begin: byte, and number of the line.
    pub start: (usize, usize),
    /// The header's.
    pub separator: Option<Separator>,
}

/// Reads down to the first row. `is_header` says whether these names are the header's; a line of at
/// least `least` numbers is a row.
pub(super) fn top(text: &str, least: usize, is_header: &dyn Fn(&[String]) -> bool) -> Top {
    let mut top = Top {
        header: None,
        comments: Vec::new(),
        start: (0, 1),
        separator: None,
    };
    let mut commented: Option<Header> = None;
    let mut titles: Vec<Line<'_>> = Vec::new();
    // A title may hold numbers: it is a row only if no header follows.
    let mut likely_row = None;
    let mut lines = Lines::of(text, 1);
    loop {
        top.start = (lines.offset, lines.number);
        let Some(line) = lines.next_record() else {
            break;
        };
        let is_first = titles.is_empty() && top.comments.is_empty();
        if line.text.trim().is_empty() || (is_first && names_separator(line.text)) {
            continue;
        }
        if let Some(inside) = comment(line.text) {
            if let Some((names, _)) = header_names(inside, is_header) {
                commented = Some(Header {
                    names,
                    line: line.number,
                });
            }
            top.comments.push(inside.trim().to_owned());
            continue;
        }
        let numbers = numbers_in(line.text);
        if numbers.all && numbers.count >= least {
            break;
        }
        if let Some((names, separator)) = header_names(line.text, is_header) {
            top.separator = Some(separator);
            top.header = Some(Header {
                names: with_units_below(names, separator, &mut lines),
                line: line.number,
            });
            top.start = (lines.offset, lines.number);
            return top;
        }
        if numbers.count >= least && likely_row.is_none() {
            likely_row = Some((top.start, titles.len()));
        }
        titles.push(line);
        if titles.len() == MOST_TITLES {
            break;
        }
    }
    if let Some((start, above)) = likely_row {
        top.start = start;
        titles.truncate(above);
    }
    // A line right above numbers is the header, whatever it says; in a file without numbers the first.
    let is_above_rows = titles.len() < MOST_TITLES && top.start.0 < text.len();
    let unclear = if is_above_rows {
        titles.last()
    } else {
        titles.first()
    };
    top.header = match unclear {
        Some(line)
            if commented
                .as_ref()
                .is_none_or(|header| header.line < line.number) =>
        {
            let (names, separator) = names_by_most_fields(line.text);
            top.separator = Some(separator);
            Some(Header {
                names,
                line: line.number,
            })
        }
        _ => commented,
    };
    top
}

/// Whether a line is a spreadsheet's `sep=;`, which says what the rows show.
fn names_separator(line: &str) -> bool {
    let line = line.trim_start_matches('"');
    let begins = line
        .get(..4)
        .is_some_and(|start| start.eq_ignore_ascii_case("sep="));
    begins && line.len() <= "sep=,\"".len()
}

/// The names in a line if it is the header, by whichever separator it is one.
fn header_names(
    line: &str,
    is_header: &dyn Fn(&[String]) -> bool,
) -> Option<(Vec<String>, Separator)> {
    SEPARATORS.into_iter().find_map(|separator| {
        let names = names_by(line, separator);
        is_header(&names).then_some((names, separator))
    })
}

fn names_by(line: &str, separator: Separator) -> Vec<String> {
    // "theta_i [deg]" is one name, whatever separates it from the next.
    let together = match separator {
        Separator::Blanks => line.replace(" [", "[").replace(" (", "("),
        Separator::Character(_) => line.to_owned(),
    };
    let fields = split(&together, separator);
    let mut names: Vec<String> = fields.into_iter().map(Cow::into_owned).collect();
    while names.last().is_some_and(String::is_empty) {
        names.pop();
    }
    names
}

/// The names of a line that is no header, for a message.
fn names_by_most_fields(line: &str) -> (Vec<String>, Separator) {
    let [first, rest @ ..] = SEPARATORS.map(|separator| (names_by(line, separator), separator));
    rest.into_iter().fold(first, |best, next| {
        // Blanks stand within titles too.
        let is_better = next.0.len() > best.0.len();
        let counts = next.1 != Separator::Blanks || best.0.len() == 1;
        if is_better && counts { next } else { best }
    })
}

/// The names with the units of the line below, where it is a line of units; it is then read.
fn with_units_below(
    mut names: Vec<String>,
    separator: Separator,
    lines: &mut Lines<'_>,
) -> Vec<String> {
    let mut ahead = lines.clone();
    let Some(line) = ahead.next_record() else {
        return names;
    };
    let units = split(line.text, separator);
    if are_units(&units) {
        *lines = ahead;
        for (name, unit) in names
            .iter_mut()
            .zip(&units)
            .filter(|(_, unit)| !unit.is_empty())
        {
            let unit = unit.trim_matches(['[', ']', '(', ')']);
            name.push_str(&format!(" [{unit}]"));
        }
    }
    names
}

/// How many fields of a line are numbers, and whether all are.
struct Numbers {
    count: usize,
    all: bool,
}

/// By the separator that finds the most.
fn numbers_in(line: &str) -> Numbers {
    let by = |separator| {
        let mut fields = split(line, separator);
        while fields.last().is_some_and(|field| field.is_empty()) {
            fields.pop();
        }
        let count = fields.iter().filter(|field| is_number(field)).count();
        let all = count == fields.len();
        Numbers { count, all }
    };
    let [first, rest @ ..] = SEPARATORS.map(by);
    rest.into_iter().fold(first, |best, next| {
        if (next.all, next.count) > (best.all, best.count) {
            next
        } else {
            best
        }
    })
}
