//! Sections of a page between `<!-- figures NAME -->` and `<!-- /figures NAME -->`.

use anyhow::{Result, bail};

/// What stands between the marks of a name.
#[derive(Debug, PartialEq)]
pub struct Section<'a> {
    pub name: &'a str,
    pub lines: Vec<&'a str>,
}

/// A mark: its name, and whether it opens the section.
fn mark(line: &str) -> Option<(&str, bool)> {
    let inner = line.trim().strip_prefix("<!-- ")?.strip_suffix(" -->")?;
    match inner.strip_prefix('/') {
        Some(closing) => Some((closing.strip_prefix("figures ")?, false)),
        None => Some((inner.strip_prefix("figures ")?, true)),
    }
}

/// All sections of a page, in their order. Fails on a mark without its partner.
pub fn sections(text: &str) -> Result<Vec<Section<'_>>> {
    let mut all = Vec::new();
    let mut open: Option<Section> = None;
    for line in text.lines() {
        match (mark(line), &mut open) {
            (None, Some(section)) => section.lines.push(line),
            (None, None) => (),
            (Some((name, true)), None) => {
                let lines = Vec::new();
                open = Some(Section { name, lines });
            }
            (Some((name, false)), Some(section)) if section.name == name => all.extend(open.take()),
            (Some((name, _)), _) => bail!("the mark {name} does not match the one before it"),
        }
    }
    match open {
        Some(section) => bail!("the figure {} has no mark at its end", section.name),
        None => Ok(all),
    }
}

/// The lines of a page that belong to no section.
pub fn outside(text: &str) -> impl Iterator<Item = &str> {
    let mut inside = false;
    text.lines().filter(move |line| match mark(line) {
        Some((_, opens)) => {
            inside = opens;
            false
        }
        None => !inside,
    })
}

/// The page with other lines between the marks of a name.
pub fn rewritten(text: &str, name: &str, body: &str) -> Result<String> {
    let times = sections(text)?.iter().filter(|s| s.name == name).count();
    if times != 1 {
        bail!("the page has {times} sections of the name {name}");
    }
    let mut new = String::new();
    let mut inside = false;
    for line in text.lines() {
        let found = mark(line).filter(|(found, _)| *found == name);
        if found == Some((name, false)) {
            inside = false;
        }
        if !inside {
            new += line;
            new.push('\n');
        }
        if found == Some((name, true)) {
            inside = true;
            new += body;
            new.push('\n');
        }
    }
    Ok(new)
}

/// Whether a line is what [`super::origin::Origin::caption`] writes: in italics, with commit, date
/// and command.
pub fn is_caption(line: &str) -> bool {
    let Some(inner) = line.strip_prefix('*').and_then(|l| l.strip_suffix('*')) else {
        return false;
    };
    let mut parts = inner.split("; ");
    let has_machine = parts.next().is_some_and(|machine| !machine.is_empty());
    let is_commit = |part: &str| {
        let hash = part.strip_prefix("commit ").unwrap_or_default();
        let hash = hash.split(' ').next().unwrap_or_default();
        hash.len() >= 7 && hash.bytes().all(|b| b.is_ascii_hexdigit())
    };
    let is_date = |part: &str| {
        let shape = |(k, b): (usize, u8)| match k {
            4 | 7 => b == b'-',
            _ => b.is_ascii_digit(),
        };
        part.len() >= 10 && part.bytes().take(10).enumerate().all(shape)
    };
    has_machine
        && parts.next().is_some_and(is_commit)
        && parts.next().is_some_and(is_date)
        && inner.matches('`').count() >= 2
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "\
# Made up
before
<!-- figures a -->
| old |
*caption*
<!-- /figures a -->
between
<!-- figures b -->
<!-- /figures b -->
after
";

    #[test]
    fn the_lines_between_the_marks_are_replaced_and_no_others() {
        let new = rewritten(PAGE, "a", "| x |\n\n*new*").unwrap();
        assert_eq!(new, PAGE.replace("| old |\n*caption*", "| x |\n\n*new*"));
        let filled = rewritten(&new, "b", "| y |").unwrap();
        assert!(filled.contains("<!-- figures b -->\n| y |\n<!-- /figures b -->\nafter\n"));
        // The same again is the same page.
        assert_eq!(rewritten(&filled, "b", "| y |").unwrap(), filled);
    }

    #[test]
    fn a_missing_or_misplaced_mark_is_an_error_and_changes_nothing() {
        assert!(rewritten(PAGE, "c", "").is_err());
        let open = PAGE.replace("<!-- /figures a -->\n", "");
        assert!(rewritten(&open, "a", "").is_err() && sections(&open).is_err());
        let crossed = PAGE.replace("<!-- /figures a -->", "<!-- /figures b -->");
        assert!(rewritten(&crossed, "a", "").is_err());
        let twice = PAGE.replace("figures b", "figures a");
        assert!(rewritten(&twice, "a", "").is_err());
    }

    #[test]
    fn what_stands_outside_of_all_marks_is_known() {
        let lines: Vec<&str> = outside(PAGE).collect();
        assert_eq!(lines, ["# Made up", "before", "between", "after"]);
    }

    #[test]
    fn a_caption_names_machine_commit_date_and_command() {
        let good = "*A machine, 2 cores; commit 0123abc and changes; 2026-11-27; 3 min. `make it`*";
        assert!(is_caption(good));
        for (part, instead) in [
            ("*A", "A"),
            ("0123abc", "today"),
            ("2026-11-27", "yesterday"),
            ("`make it`", "by hand"),
            ("A machine, 2 cores", ""),
        ] {
            assert!(!is_caption(&good.replace(part, instead)), "{part}");
        }
    }
}
