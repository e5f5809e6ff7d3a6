//! Links of the Markdown pages: every file, heading and included piece that they name is there.

use anyhow::{Context, Result, bail};
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};
use std::collections::{BTreeMap, HashMap};
use std::path::{Component, Path, PathBuf};

/// Where the book's pages lie.
const BOOK: &str = "docs/src";

/// What a page says that can be wrong.
#[derive(Default)]
struct Page {
    /// Line and target of every link and picture.
    links: Vec<(usize, String)>,
    /// Line and target of every `{{#include …}}`.
    includes: Vec<(usize, String)>,
    /// What a link can name after `#`.
    anchors: Vec<String>,
}

/// Fails on links and includes that lead nowhere, and on pages that the book's summary leaves out.
pub fn check(root: &Path) -> Result<()> {
    let mut files = Vec::new();
    find_pages(root, &mut files)?;
    let mut pages = BTreeMap::new();
    for file in files {
        let text = std::fs::read_to_string(&file).with_context(|| format!("{}", file.display()))?;
        let name = file.strip_prefix(root).unwrap_or(&file).to_owned();
        pages.insert(name, read(&text));
    }
    let faults = faults_of(root, &pages);
    let links: usize = pages.values().map(|page| page.links.len()).sum();
    println!("{} pages, {links} links", pages.len());
    if !faults.is_empty() {
        bail!("{}", faults.join("\n"));
    }
    Ok(())
}

fn find_pages(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("{}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_built = name == "target" || name == "book" && path.join("index.html").is_file();
        if is_built || name.starts_with('.') && name != ".github" {
            continue;
        }
        if path.is_dir() {
            find_pages(&path, files)?;
        } else if name.ends_with(".md") {
            files.push(path);
        }
    }
    Ok(())
}

fn read(text: &str) -> Page {
    let mut page = Page::default();
    let line_of = |at: usize| text[..at].matches('\n').count() + 1;
    let mut heading: Option<String> = None;
    let options =
        Options::ENABLE_TABLES | Options::ENABLE_HEADING_ATTRIBUTES | Options::ENABLE_FOOTNOTES;
    let mut own_id = None;
    for (event, range) in Parser::new_ext(text, options).into_offset_iter() {
        match event {
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                page.links
                    .push((line_of(range.start), dest_url.to_string()));
            }
            Event::Start(Tag::Heading { id, .. }) => {
                own_id = id.map(|id| id.to_string());
                heading = Some(String::new());
            }
            Event::End(TagEnd::Heading(_)) => {
                let words = heading.take().unwrap_or_default();
                add_anchor(
                    &mut page.anchors,
                    own_id.take().unwrap_or_else(|| id_of(&words)),
                );
            }
            Event::Text(part) | Event::Code(part) => {
                if let Some(heading) = &mut heading {
                    heading.push_str(&part);
                }
            }
            Event::Html(part) | Event::InlineHtml(part) => {
                let line = line_of(range.start);
                for name in ["href", "src"] {
                    page.links
                        .extend(attributes(&part, name).map(|to| (line, to.to_owned())));
                }
                for name in ["id", "name"] {
                    page.anchors
                        .extend(attributes(&part, name).map(str::to_owned));
                }
            }
            _ => {}
        }
    }
    for (i, line) in text.lines().enumerate() {
        let parts = line
            .match_indices("{{#")
            .filter(|(at, _)| !line[..*at].ends_with('\\'));
        for (at, sign) in parts {
            let inside = line[at + sign.len()..]
                .split("}}")
                .next()
                .unwrap_or_default();
            if let Some((_, target)) = inside.split_once("include ") {
                page.includes.push((i + 1, target.trim().to_owned()));
            }
        }
    }
    page
}

/// The values of an attribute in a piece of HTML.
fn attributes<'a>(html: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let start = format!(" {name}=\"");
    let starts: Vec<usize> = html
        .match_indices(&start)
        .map(|(at, s)| at + s.len())
        .collect();
    starts
        .into_iter()
        .filter_map(|at| html[at..].split('"').next())
}

/// The name of a heading in a link: its words in small letters with dashes between them.
fn id_of(heading: &str) -> String {
    let letters = heading.chars().filter_map(|c| match c {
        _ if c.is_whitespace() => Some('-'),
        _ if c.is_alphanumeric() || c == '_' || c == '-' => Some(c),
        _ => None,
    });
    letters.flat_map(char::to_lowercase).collect()
}

/// Adds a heading's name; the second of the same words is `name-1`.
fn add_anchor(anchors: &mut Vec<String>, id: String) {
    let numbered = (1..).map(|i| format!("{id}-{i}"));
    let free = std::iter::once(id.clone())
        .chain(numbered)
        .find(|id| !anchors.contains(id));
    anchors.push(free.unwrap_or(id));
}

/// One line a fault: what, where, what to do.
fn faults_of(root: &Path, pages: &BTreeMap<PathBuf, Page>) -> Vec<String> {
    let mut faults = Vec::new();
    let mut texts = HashMap::new();
    for (name, page) in pages {
        let folder = name.parent().unwrap_or(Path::new(""));
        for (line, link) in &page.links {
            if let Err(why) = follow(root, pages, name, link) {
                faults.push(format!("{}:{line}: {link}: {why}", name.display()));
            }
        }
        for (line, include) in &page.includes {
            let (file, piece) = include.split_once(':').unwrap_or((include, ""));
            let file = root.join(tidy(&folder.join(file)));
            let text = texts
                .entry(file.clone())
                .or_insert_with(|| std::fs::read_to_string(file).ok());
            let why = match text {
                None => "there is no such file; correct the path",
                Some(text) if !has_piece(text, piece) => {
                    "the file has no such piece; mark it with ANCHOR: and ANCHOR_END:"
                }
                Some(_) => continue,
            };
            faults.push(format!("{}:{line}: {include}: {why}", name.display()));
        }
    }
    let book = Path::new(BOOK);
    if let Some(summary) = pages.get(&book.join("SUMMARY.md")) {
        let listed: Vec<PathBuf> = summary
            .links
            .iter()
            .map(|(_, link)| book.join(link))
            .collect();
        let all = pages
            .keys()
            .filter(|name| name.starts_with(book) && !name.ends_with("SUMMARY.md"));
        let left_out = all.filter(|name| !listed.contains(name));
        faults.extend(left_out.map(|name| {
            let name = name.display();
            format!("{name}: no page of the book; add it to {BOOK}/SUMMARY.md")
        }));
    }
    faults
}

/// Why a link leads nowhere.
fn follow(
    root: &Path,
    pages: &BTreeMap<PathBuf, Page>,
    from: &Path,
    link: &str,
) -> Result<(), &'static str> {
    if link.contains("://") || link.starts_with("mailto:") {
        return Ok(());
    }
    let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
    let to = if file.is_empty() {
        from.to_owned()
    } else {
        tidy(
            &from
                .parent()
                .unwrap_or(Path::new(""))
                .join(file.replace("%20", " ")),
        )
    };
    if !root.join(&to).exists() && !pages.contains_key(&to) {
        return Err("there is no such file; correct the path");
    }
    if from.starts_with(BOOK) && !to.starts_with(BOOK) {
        return Err("it leads out of the book; name the file in words, or move it in");
    }
    match pages.get(&to) {
        Some(page) if !anchor.is_empty() && !page.anchors.iter().any(|a| a == anchor) => {
            Err("the page has no such heading; correct what follows #")
        }
        _ => Ok(()),
    }
}

/// Whether an included file has the piece: lines by number, or what stands between marks.
fn has_piece(text: &str, piece: &str) -> bool {
    let is_lines = piece.chars().all(|c| c.is_ascii_digit() || c == ':');
    let mark = format!("ANCHOR: {piece}");
    is_lines || text.lines().any(|line| line.trim_end().ends_with(&mark))
}

/// A path without `.` and `..`.
fn tidy(path: &Path) -> PathBuf {
    let mut tidy = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                tidy.pop();
            }
            Component::CurDir => {}
            part => tidy.push(part),
        }
    }
    tidy
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(pages: &[(&str, &str)]) -> Vec<String> {
        let pages = pages
            .iter()
            .map(|(name, text)| (PathBuf::from(name), read(text)));
        faults_of(Path::new("/nowhere"), &pages.collect())
    }

    #[test]
    fn links_to_pages_and_headings_that_are_there_are_good() {
        let pages = [
            (
                "README.md",
                "[a](docs/src/a.md#two-words-θi) ![b](https://b/c) `[x](y)`\n```\n[x](y)\n```",
            ),
            (
                "docs/src/a.md",
                "# Two *words*: `θi`\n## Same\n## Same\n## Other {#mine}\n<a id=\"here\"></a>\n[b](./b/c.md) [](#same-1) [](#mine) [](#here)",
            ),
            ("docs/src/b/c.md", "[up](../a.md#same)"),
            ("docs/src/SUMMARY.md", "- [a](a.md)\n  - [c](b/c.md)"),
        ];
        assert_eq!(faults(&pages), [""; 0]);
    }

    #[test]
    fn what_leads_nowhere_is_a_fault_with_its_line() {
        let pages = [
            (
                "README.md",
                "\n[a](a.md)\n\n[b](docs/src/b.md#no)\n<img src=\"c.png\">\n",
            ),
            (
                "docs/src/b.md",
                "[out](../../README.md)\n{{#include ../../host/x.rs:piece}}\n\\{{#include y}}",
            ),
            ("docs/src/SUMMARY.md", "# Summary"),
        ];
        assert_eq!(
            faults(&pages),
            [
                "README.md:2: a.md: there is no such file; correct the path",
                "README.md:4: docs/src/b.md#no: the page has no such heading; correct what follows #",
                "README.md:5: c.png: there is no such file; correct the path",
                "docs/src/b.md:1: ../../README.md: it leads out of the book; name the file in words, or move it in",
                "docs/src/b.md:2: ../../host/x.rs:piece: there is no such file; correct the path",
                "docs/src/b.md: no page of the book; add it to docs/src/SUMMARY.md",
            ]
        );
    }

    #[test]
    fn a_piece_of_an_included_file_is_marked_or_numbered() {
        let text = "fn a() {}\n// ANCHOR: one\nfn b() {}\n// ANCHOR_END: one\n";
        assert!(has_piece(text, "one") && has_piece(text, "") && has_piece(text, "2:3"));
        assert!(!has_piece(text, "on") && !has_piece(text, "two"));
    }
}
