//! The length of functions: short enough to be read at once, or with a reason.

use crate::modules::{is, tokens_of, without_tests};
use anyhow::{Context, Result, bail};
use proc_macro2::{Delimiter, TokenTree};
use std::path::{Path, PathBuf};

/// Lines that a function may have, from `fn` to its closing brace.
const LINES: usize = 80;

/// What a longer one has in the comment above it, followed by the reason.
const REASON: &str = "// long: ";

/// Fails when a function of the project is longer than it may be and gives no reason. Tests that
/// stand in a module of their own are not counted.
pub fn check(root: &Path) -> Result<()> {
    let mut files = Vec::new();
    sources(root, &mut files)?;
    let mut long = Vec::new();
    for file in &files {
        let text = std::fs::read_to_string(file).with_context(|| format!("{}", file.display()))?;
        let found = long_functions(&text).with_context(|| format!("{}", file.display()))?;
        let name = file.strip_prefix(root).unwrap_or(file).display();
        long.extend(
            found
                .iter()
                .map(|f| format!("{name}:{}: {} has {} lines", f.line, f.name, f.lines)),
        );
    }
    println!(
        "{} files, {} functions above {LINES} lines without a reason",
        files.len(),
        long.len()
    );
    if !long.is_empty() {
        bail!(
            "split these, or write `{REASON}why` above:\n{}",
            long.join("\n")
        );
    }
    Ok(())
}

/// All sources below a folder but what is built.
fn sources(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("{}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name == "target" || name.starts_with('.') {
            continue;
        }
        if path.is_dir() {
            sources(&path, files)?;
        } else if name.ends_with(".rs") {
            files.push(path);
        }
    }
    files.sort();
    Ok(())
}

#[derive(Debug, PartialEq, Eq)]
struct Function {
    name: String,
    /// Where it starts, from 1.
    line: usize,
    lines: usize,
}

fn long_functions(text: &str) -> Result<Vec<Function>> {
    let mut found = Vec::new();
    find(&without_tests(tokens_of(text)?), &mut found);
    let lines: Vec<&str> = text.lines().collect();
    found.retain(|f| f.lines > LINES && !has_reason(&lines[..f.line - 1]));
    Ok(found)
}

/// Whether the comments and attributes directly above a function give a reason.
fn has_reason(above: &[&str]) -> bool {
    let mut above = above.iter().rev().map(|line| line.trim());
    let near = above
        .by_ref()
        .take_while(|line| line.starts_with("//") || line.starts_with("#["));
    near.into_iter()
        .any(|line| line.strip_prefix(REASON).is_some_and(|why| !why.is_empty()))
}

/// Finds functions at any depth.
fn find(tokens: &[TokenTree], found: &mut Vec<Function>) {
    for (i, token) in tokens.iter().enumerate() {
        if let TokenTree::Group(group) = token {
            find(&group.stream().into_iter().collect::<Vec<_>>(), found);
        }
        let [TokenTree::Ident(word), TokenTree::Ident(name), rest @ ..] = &tokens[i..] else {
            continue;
        };
        if word != "fn" {
            continue;
        }
        let body = rest
            .iter()
            .take_while(|t| !is(t, ';'))
            .find_map(|token| match token {
                TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => Some(group),
                _ => None,
            });
        if let Some(body) = body {
            let line = word.span().start().line;
            found.push(Function {
                name: name.to_string(),
                line,
                lines: body.span_close().end().line + 1 - line,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function of so many lines below something.
    fn function(above: &str, lines: usize) -> String {
        format!(
            "struct A;\nimpl A {{\n{above}fn f(x: [u8; {{ 3 }}]) {{\n{}}}\n}}\n",
            "x();\n".repeat(lines - 2)
        )
    }

    #[test]
    fn a_function_above_the_limit_is_found_with_its_place() {
        assert_eq!(long_functions(&function("", LINES)).unwrap(), []);
        let long = Function {
            name: "f".to_owned(),
            line: 3,
            lines: LINES + 1,
        };
        assert_eq!(long_functions(&function("", LINES + 1)).unwrap(), [long]);
    }

    #[test]
    fn a_reason_directly_above_excuses_it_and_an_empty_one_does_not() {
        let count = |above: &str| long_functions(&function(above, 100)).unwrap().len();
        assert_eq!(
            count("// long: one table, read at once.\n#[inline]\npub "),
            0
        );
        assert_eq!(count("/// Docs.\n// long: one table.\n"), 0);
        assert_eq!(count("// long: \n"), 1);
        assert_eq!(count("// long: of something else.\n\n"), 1);
        assert_eq!(count("/// A long table.\n"), 1);
    }

    #[test]
    fn tests_and_declarations_without_a_body_are_not_counted() {
        let tests = format!("#[cfg(test)]\nmod tests {{ {} }}", function("", 100));
        assert_eq!(long_functions(&tests).unwrap(), []);
        let declared = format!(
            "trait T {{ fn g(&self);\n{}\nconst X: u8 = {{ 1 }}; }}",
            "\n".repeat(90)
        );
        assert_eq!(long_functions(&declared).unwrap(), []);
    }
}
