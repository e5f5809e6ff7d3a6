//! The Python literal in front of an array's bytes: dictionaries, tuples, lists, texts, whole numbers.

use std::fmt;

/// Nothing that numpy writes is nested deeper than a few levels.
const DEEPEST: usize = 16;

/// A value of a header.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Literal {
    Text(String),
    Number(u64),
    Truth(bool),
    /// A tuple or a list.
    Sequence(Vec<Literal>),
    Dictionary(Vec<(Literal, Literal)>),
}

impl Literal {
    /// Reads a header; `None` where it is none.
    pub fn parse(text: &str) -> Option<Self> {
        let mut rest = text;
        let value = value(&mut rest, 0)?;
        rest.trim().is_empty().then_some(value)
    }

    /// What a dictionary has under a key.
    pub fn get(&self, key: &str) -> Option<&Self> {
        let Self::Dictionary(entries) = self else {
            return None;
        };
        let is_key = |name: &Self| matches!(name, Self::Text(name) if name == key);
        entries
            .iter()
            .find(|(name, _)| is_key(name))
            .map(|(_, value)| value)
    }
}

/// As Python writes it, on one line.
impl fmt::Display for Literal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(text) => write!(f, "'{text}'"),
            Self::Number(number) => write!(f, "{number}"),
            Self::Truth(truth) => f.write_str(if *truth { "True" } else { "False" }),
            Self::Sequence(items) => {
                f.write_str("(")?;
                for (k, item) in items.iter().enumerate() {
                    write!(f, "{}{item}", if k > 0 { ", " } else { "" })?;
                }
                f.write_str(")")
            }
            Self::Dictionary(entries) => {
                f.write_str("{")?;
                for (k, (key, value)) in entries.iter().enumerate() {
                    write!(f, "{}{key}: {value}", if k > 0 { ", " } else { "" })?;
                }
                f.write_str("}")
            }
        }
    }
}

fn value(rest: &mut &str, depth: usize) -> Option<Literal> {
    if depth > DEEPEST {
        return None;
    }
    *rest = rest.trim_start();
    match rest.chars().next()? {
        quote @ ('\'' | '"') => quoted(rest, quote).map(Literal::Text),
        '(' => items(rest, ")", depth).map(Literal::Sequence),
        '[' => items(rest, "]", depth).map(Literal::Sequence),
        '{' => entries(rest, depth).map(Literal::Dictionary),
        'T' if takes(rest, "True") => Some(Literal::Truth(true)),
        'F' if takes(rest, "False") => Some(Literal::Truth(false)),
        // Python 2 wrote u'text', and 7L for a long number.
        'u' => {
            *rest = &rest[1..];
            let quote = rest.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
            quoted(rest, quote).map(Literal::Text)
        }
        _ => {
            let end = rest
                .find(|c: char| !c.is_ascii_digit())
                .unwrap_or(rest.len());
            let number = rest[..end].parse().ok()?;
            *rest = &rest[end..];
            takes(rest, "L");
            Some(Literal::Number(number))
        }
    }
}

/// Takes a word from the front, if it stands there.
fn takes(rest: &mut &str, word: &str) -> bool {
    let trimmed = rest.trim_start();
    let after = trimmed.strip_prefix(word);
    *rest = after.unwrap_or(trimmed);
    after.is_some()
}

fn quoted(rest: &mut &str, quote: char) -> Option<String> {
    let mut text = String::new();
    let mut letters = rest.char_indices().skip(1);
    while let Some((at, letter)) = letters.next() {
        match letter {
            '\\' => text.push(letters.next()?.1),
            _ if letter == quote => {
                *rest = &rest[at + 1..];
                return Some(text);
            }
            _ => text.push(letter),
        }
    }
    None
}

fn items(rest: &mut &str, close: &str, depth: usize) -> Option<Vec<Literal>> {
    *rest = &rest[1..];
    let mut items = Vec::new();
    while !takes(rest, close) {
        items.push(value(rest, depth + 1)?);
        if !takes(rest, ",") {
            return takes(rest, close).then_some(items);
        }
    }
    Some(items)
}

fn entries(rest: &mut &str, depth: usize) -> Option<Vec<(Literal, Literal)>> {
    *rest = &rest[1..];
    let mut entries = Vec::new();
    while !takes(rest, "}") {
        let key = value(rest, depth + 1)?;
        if !takes(rest, ":") {
            return None;
        }
        entries.push((key, value(rest, depth + 1)?));
        if !takes(rest, ",") {
            return takes(rest, "}").then_some(entries);
        }
    }
    Some(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_numpy_are_read() {
        let text = "{'descr': [('a b', '<f4'), (u'rgb', '<f8', (3,))], 'fortran_order': False, 'shape': (10L, 7), }  \n";
        let header = Literal::parse(text).unwrap();
        assert_eq!(header.get("fortran_order"), Some(&Literal::Truth(false)));
        let shape = header.get("shape").unwrap();
        assert_eq!(
            *shape,
            Literal::Sequence(vec![Literal::Number(10), Literal::Number(7)])
        );
        let descr = header.get("descr").unwrap().to_string();
        assert_eq!(descr, "(('a b', '<f4'), ('rgb', '<f8', (3)))");
        assert_eq!(Literal::parse("()"), Some(Literal::Sequence(Vec::new())));
    }

    #[test]
    fn anything_else_is_none_and_no_panic() {
        let deep = "(".repeat(100_000);
        for text in [
            "",
            "{",
            "{'a'",
            "{'a':",
            "{'a' 1}",
            "(1",
            "'a",
            "(1 2)",
            "x",
            "u",
            "u1",
            "\\",
            "'\\",
            "99999999999999999999999",
            "-1",
            "(é)",
            "1 é",
            &deep,
        ] {
            assert_eq!(Literal::parse(text), None, "{text}");
        }
    }
}
