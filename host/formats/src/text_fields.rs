//! The fields of a line of a table.

use std::borrow::Cow;

/// What stands between two fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    /// One character.
    Character(char),
    /// Any run of blanks and tabs.
    Blanks,
}

/// All of them, in the order in which they are tried: a comma may be a decimal one, a tab is a blank.
pub(super) const SEPARATORS: [Separator; 5] = [
    Separator::Character(';'),
    Separator::Character('\t'),
    Separator::Character(','),
    Separator::Character('|'),
    Separator::Blanks,
];

/// The fields of a line, without the blanks around them and without quotes.
pub(super) fn split_into<'a>(line: &'a str, separator: Separator, fields: &mut Vec<Cow<'a, str>>) {
    fields.clear();
    if line.contains('"') {
        return split_quoted(line, separator, fields);
    }
    match separator {
        Separator::Character(character) => {
            fields.extend(line.split(character).map(|field| field.trim().into()));
        }
        Separator::Blanks => fields.extend(line.split_whitespace().map(Cow::from)),
    }
}

/// The same, for one line alone.
pub(super) fn split(line: &str, separator: Separator) -> Vec<Cow<'_, str>> {
    let mut fields = Vec::new();
    split_into(line, separator, &mut fields);
    fields
}

/// Quotes keep separators together; they may have blanks around them, which CSV proper does not allow.
fn split_quoted<'a>(line: &'a str, separator: Separator, fields: &mut Vec<Cow<'a, str>>) {
    let mut field = String::new();
    let (mut is_inside, mut was_quoted) = (false, false);
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        let parts = match separator {
            Separator::Character(character) => letter == character,
            Separator::Blanks => letter.is_whitespace(),
        };
        if is_inside {
            // Two quotes are one that belongs to the text.
            match letter {
                '"' if letters.next_if_eq(&'"').is_some() => field.push('"'),
                '"' => is_inside = false,
                _ => field.push(letter),
            }
        } else if letter == '"' && field.trim().is_empty() && !was_quoted {
            field.clear();
            (is_inside, was_quoted) = (true, true);
        } else if parts {
            let is_between = separator == Separator::Blanks && field.is_empty() && !was_quoted;
            if !is_between {
                fields.push(field.trim().to_owned().into());
            }
            field.clear();
            was_quoted = false;
        } else {
            field.push(letter);
        }
    }
    if separator != Separator::Blanks || !field.is_empty() || was_quoted {
        fields.push(field.trim().to_owned().into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_parted_trimmed_and_unquoted() {
        let comma = Separator::Character(',');
        assert_eq!(split("1, 2 ,,4,", comma), ["1", "2", "", "4", ""]);
        assert_eq!(
            split(r#""54,75", "a ""b""" ,3"#, comma),
            ["54,75", r#"a "b""#, "3"]
        );
        assert_eq!(split(" 1\t 2   3 ", Separator::Blanks), ["1", "2", "3"]);
        assert_eq!(
            split(r#"  "a  b"   "" 2 "#, Separator::Blanks),
            ["a  b", "", "2"]
        );
        assert_eq!(split(r#"5" wide,"3"x,""#, comma), ["5\" wide", "3x", ""]);
        assert_eq!(split("1\t\t3", Separator::Character('\t')), ["1", "", "3"]);
    }
}
