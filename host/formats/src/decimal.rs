//! Numbers as people and programs write them.

use std::str::FromStr;

/// What stands before the decimals of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DecimalMark {
    Point,
    Comma,
}

/// Reads a number with either mark, with a typographic minus or with Fortran's exponent (`1.5D-03`);
/// `None` where it is none. The mark says how it was written, if it has decimals.
pub(super) fn parse_number<T: FromStr>(field: &str) -> Option<(T, Option<DecimalMark>)> {
    if let Ok(number) = field.parse() {
        let point = field.contains('.').then_some(DecimalMark::Point);
        return Some((number, point));
    }
    let commas = field.matches(',').count();
    let has_point = field.contains('.');
    // 1,234.5 and 1,234,567 have commas between thousands: another kind of number.
    if commas > 1 || (commas == 1 && has_point) || field.ends_with(',') {
        return None;
    }
    let begins_as_number = field.starts_with(|c: char| "+-−.,".contains(c) || c.is_ascii_digit());
    if !begins_as_number {
        return None;
    }
    let usual: String = field
        .chars()
        .map(|letter| match letter {
            ',' => '.',
            '−' => '-',
            'D' | 'd' => 'e',
            other => other,
        })
        .collect();
    let mark = match (commas, has_point) {
        (1, _) => Some(DecimalMark::Comma),
        (_, true) => Some(DecimalMark::Point),
        _ => None,
    };
    Some((usual.parse().ok()?, mark))
}

/// Whether a field holds a number.
pub(super) fn is_number(field: &str) -> bool {
    parse_number::<f64>(field).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use DecimalMark::{Comma, Point};

    #[test]
    fn numbers_are_read_with_the_mark_they_were_written_with() {
        for (field, number, mark) in [
            ("54.75", 54.75, Some(Point)),
            ("54,75", 54.75, Some(Comma)),
            (",5", 0.5, Some(Comma)),
            ("-1,5E-3", -1.5e-3, Some(Comma)),
            ("−1.5", -1.5, Some(Point)),
            ("1.5D-03", 1.5e-3, Some(Point)),
            ("2d0", 2.0, None),
            ("+7", 7.0, None),
        ] {
            assert_eq!(parse_number::<f64>(field), Some((number, mark)), "{field}");
        }
    }

    #[test]
    fn what_can_be_read_in_two_ways_is_no_number() {
        for field in [
            "1,234.5",
            "1.234,5",
            "1,234,567",
            "54,",
            "x",
            "",
            ",",
            "deg",
            "1 234",
            "0x10",
        ] {
            assert_eq!(parse_number::<f64>(field), None, "{field}");
        }
    }
}
