//! Which files of a crate import which: no two import each other, parents and their children aside.

use crate::modules::{Module, is, modules_of};
use anyhow::{Result, bail};
use proc_macro2::{Delimiter, TokenTree};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Files by their module's name from the root; a file imports those of its set.
type Graph = BTreeMap<Vec<String>, BTreeSet<Vec<String>>>;

/// Fails when two files of a crate of this workspace import each other. Longer circles are printed.
pub fn check(metadata: &Value, root: &Path) -> Result<()> {
    let mut pairs = Vec::new();
    let (mut files, mut circles) = (0, 0);
    for file in roots_of(metadata) {
        let modules = modules_of(Path::new(&file))?;
        let graph = graph_of(&modules);
        let show = |name: &Vec<String>| {
            let module = modules.iter().find(|m| m.name == *name);
            let file = module.map_or(Path::new(""), |m| &m.file);
            file.strip_prefix(root)
                .unwrap_or(file)
                .display()
                .to_string()
        };
        for (one, other) in pairs_of(&graph) {
            pairs.push(format!("{} ⇄ {}", show(one), show(other)));
        }
        for circle in circles_of(&graph) {
            let names: Vec<String> = circle.iter().map(|name| show(name)).collect();
            println!("a circle of {}: {}", names.len(), names.join(", "));
            circles += 1;
        }
        files += modules.len();
    }
    println!(
        "{files} files, {circles} circles, {} pairs that import each other",
        pairs.len()
    );
    if !pairs.is_empty() {
        bail!(
            "these import each other; move what both need into a file of its own:\n{}",
            pairs.join("\n")
        );
    }
    Ok(())
}

/// The root files of a workspace's libraries and programs.
fn roots_of(metadata: &Value) -> Vec<String> {
    let all = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let targets = all(&metadata["packages"])
        .into_iter()
        .flat_map(|p| all(&p["targets"]));
    let ours = targets.filter(|target| {
        let kinds = all(&target["kind"]);
        ["lib", "bin", "cdylib", "proc-macro"]
            .iter()
            .any(|kind| kinds.contains(&(*kind).into()))
    });
    ours.filter_map(|target| target["src_path"].as_str().map(str::to_owned))
        .collect()
}

/// Who imports whom. What a file imports from its parents, or from below itself, is not in it.
fn graph_of(modules: &[Module]) -> Graph {
    let names: BTreeSet<&[String]> = modules.iter().map(|m| m.name.as_slice()).collect();
    let paths_of = |module: &Module| {
        let mut paths = Vec::new();
        collect(&module.tokens, &module.name, &names, &mut paths);
        paths
    };
    let paths: Vec<_> = modules.iter().map(paths_of).collect();
    // Where a name leads that a file has imported, and may hand on.
    let mut handed_on = BTreeMap::new();
    for (module, paths) in modules.iter().zip(&paths) {
        for path in paths {
            let name = path.last().into_iter().cloned();
            handed_on.insert(module.name.iter().cloned().chain(name).collect(), path);
        }
    }
    let mut graph = Graph::new();
    for (module, paths) in modules.iter().zip(&paths) {
        let files = paths
            .iter()
            .flat_map(|path| files_of(path, &names, &handed_on));
        let others = files.filter(|f| !f.starts_with(&module.name) && !module.name.starts_with(f));
        graph.insert(
            module.name.clone(),
            others.map(<[String]>::to_vec).collect(),
        );
    }
    graph
}

/// The files that a path leads into: the one that its longest beginning names, and, where that one
/// only hands on a name, the one where it comes from.
fn files_of<'a>(
    path: &'a [String],
    names: &BTreeSet<&[String]>,
    handed_on: &BTreeMap<Vec<String>, &'a Vec<String>>,
) -> Vec<&'a [String]> {
    let mut files: Vec<&[String]> = Vec::new();
    let mut path = path;
    loop {
        let lengths = (0..=path.len()).rev();
        let mut beginnings = lengths.map(|n| &path[..n]);
        let file = beginnings.find(|p| names.contains(p)).unwrap_or_default();
        if files.contains(&file) {
            return files;
        }
        files.push(file);
        let name = path.get(..=file.len());
        match name.and_then(|name| handed_on.get(name)) {
            Some(from) => path = from.as_slice(),
            None => return files,
        }
    }
}

/// Finds the paths into this crate that a module names: in `use`, and wherever else `crate::`,
/// `self::` and `super::` stand.
fn collect(
    tokens: &[TokenTree],
    module: &[String],
    names: &BTreeSet<&[String]>,
    paths: &mut Vec<Vec<String>>,
) {
    let mut i = 0;
    while i < tokens.len() {
        let here = &tokens[i..];
        match here {
            // A module inside this file: its paths start one deeper.
            [
                TokenTree::Ident(word),
                TokenTree::Ident(name),
                TokenTree::Group(body),
                ..,
            ] if word == "mod" => {
                let inner = [module, &[name.to_string()]].concat();
                collect(&inner_of(body), &inner, names, paths);
                i += 3;
                continue;
            }
            [TokenTree::Ident(word), next, ..] if word == "use" && !is(next, '<') => {
                let end = here.iter().position(|t| is(t, ';')).unwrap_or(here.len());
                let mut written = Vec::new();
                expand(&here[1..end], &[], &mut written);
                paths.extend(written.iter().filter_map(|p| from_root(p, module, names)));
                i += end;
                continue;
            }
            [TokenTree::Ident(word), next, ..]
                if is(next, ':') && ["crate", "self", "super"].iter().any(|w| word == w) =>
            {
                let mut written = Vec::new();
                let length = here.iter().take_while(|t| is_of_path(t)).count();
                expand(&here[..length], &[], &mut written);
                paths.extend(written.iter().filter_map(|p| from_root(p, module, names)));
                i += length;
                continue;
            }
            [TokenTree::Group(group), ..] => collect(&inner_of(group), module, names, paths),
            _ => {}
        }
        i += 1;
    }
}

fn inner_of(group: &proc_macro2::Group) -> Vec<TokenTree> {
    group.stream().into_iter().collect()
}

fn is_of_path(token: &TokenTree) -> bool {
    matches!(token, TokenTree::Ident(_)) || is(token, ':')
}

/// The paths of a `use`: `a::{b, c::{self, d}}` is `a::b`, `a::c`, `a::c::d`.
fn expand(tokens: &[TokenTree], before: &[String], paths: &mut Vec<Vec<String>>) {
    let mut path = before.to_vec();
    for token in tokens {
        match token {
            TokenTree::Ident(word) if word == "as" => break,
            TokenTree::Ident(word) if word == "self" && !path.is_empty() => {}
            TokenTree::Ident(word) => path.push(word.to_string()),
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
                for part in inner_of(group).split(|t| is(t, ',')) {
                    expand(part, &path, paths);
                }
                return;
            }
            _ => {}
        }
    }
    if !path.is_empty() {
        paths.push(path);
    }
}

/// A path as it is written in a module, from the crate's root; `None` when it leads out of the crate.
fn from_root(
    path: &[String],
    module: &[String],
    names: &BTreeSet<&[String]>,
) -> Option<Vec<String>> {
    let (first, rest) = path.split_first()?;
    match first.as_str() {
        "crate" => Some(rest.to_vec()),
        "self" => from_here(rest, module),
        "super" => from_here(path, module),
        _ => {
            let child = [module, std::slice::from_ref(first)].concat();
            names
                .contains(child.as_slice())
                .then(|| [module, path].concat())
        }
    }
}

/// A path from a module, that may go up first.
fn from_here(path: &[String], module: &[String]) -> Option<Vec<String>> {
    let ups = path.iter().take_while(|word| *word == "super").count();
    let base = module.get(..module.len().checked_sub(ups)?)?;
    Some([base, &path[ups..]].concat())
}

fn pairs_of(graph: &Graph) -> Vec<(&Vec<String>, &Vec<String>)> {
    let arrows = graph
        .iter()
        .flat_map(|(from, to)| to.iter().map(move |to| (from, to)));
    let back = |from, to: &Vec<String>| graph.get(to).is_some_and(|uses| uses.contains(from));
    arrows
        .filter(|(from, to)| from < to && back(*from, to))
        .collect()
}

/// Sets of three files and more that all reach each other.
fn circles_of(graph: &Graph) -> Vec<Vec<&Vec<String>>> {
    let reached: BTreeMap<_, _> = graph
        .keys()
        .map(|from| (from, reached_from(from, graph)))
        .collect();
    let mut circles: Vec<Vec<&Vec<String>>> = Vec::new();
    for (from, to) in &reached {
        if circles.iter().any(|circle| circle.contains(from)) {
            continue;
        }
        let both = to
            .iter()
            .filter(|other| reached.get(*other).is_some_and(|r| r.contains(*from)));
        let circle: Vec<_> = both.copied().collect();
        if circle.len() > 2 {
            circles.push(circle);
        }
    }
    circles
}

fn reached_from<'a>(from: &'a Vec<String>, graph: &'a Graph) -> BTreeSet<&'a Vec<String>> {
    let mut reached = BTreeSet::new();
    let mut open = vec![from];
    while let Some(file) = open.pop() {
        for to in graph.get(file).into_iter().flatten() {
            if reached.insert(to) {
                open.push(to);
            }
        }
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modules::{tokens_of, without_tests};

    /// A crate of made-up files: module and text.
    fn graph(files: &[(&str, &str)]) -> Graph {
        let modules = files.iter().map(|(name, text)| Module {
            name: name
                .split("::")
                .filter(|n| !n.is_empty())
                .map(str::to_owned)
                .collect(),
            file: (*name).into(),
            tokens: without_tests(tokens_of(text).unwrap()),
        });
        graph_of(&modules.collect::<Vec<_>>())
    }

    fn pairs(files: &[(&str, &str)]) -> Vec<String> {
        let graph = graph(files);
        let pairs = pairs_of(&graph).into_iter();
        pairs
            .map(|(a, b)| format!("{} {}", a.join("::"), b.join("::")))
            .collect()
    }

    #[test]
    fn two_files_that_import_each_other_are_found_however_they_write_it() {
        for (a, b) in [
            ("use crate::b::X;", "use crate::a::Y;"),
            ("use super::b::X;", "use super::{a::{Y, Z}, c};"),
            (
                "pub(crate) use crate::{b as other};",
                "use std::io; fn f() { crate::a::y() }",
            ),
            ("mod in_it { use super::super::b; }", "use super::a::*;"),
            ("fn f() -> super::b::X { X }", "use crate::{c, a::{self}};"),
        ] {
            let files = [("", "mod a; mod b; mod c;"), ("a", a), ("b", b), ("c", "")];
            assert_eq!(pairs(&files), ["a b"], "{a} / {b}");
        }
    }

    #[test]
    fn parents_tests_and_one_way_are_no_pairs() {
        let files = [
            ("", "mod a; pub use a::X; use crate::b::Y;"),
            ("a", "mod in_a; use in_a::Z; use crate::Y; use crate::b::Y;"),
            ("a::in_a", "use super::X; use crate::X;"),
            (
                "b",
                "#[cfg(test)] mod tests { use crate::a::X; } use a::foreign;",
            ),
        ];
        assert_eq!(pairs(&files), [""; 0]);
    }

    #[test]
    fn an_import_from_a_folder_is_one_from_its_mod_rs() {
        let files = [
            ("", "mod a; mod b;"),
            ("a", "mod one; pub use one::X; use crate::b::Y;"),
            ("a::one", ""),
            ("b", "use crate::a::X;"),
        ];
        assert_eq!(pairs(&files), ["a b"]);
    }

    #[test]
    fn a_name_that_a_folder_hands_on_is_imported_from_its_file_too() {
        let files = [
            ("", "mod a;"),
            (
                "a",
                "mod one; mod two; pub use one::{X, Z}; pub use two::Y;",
            ),
            ("a::one", "use super::Y;"),
            ("a::two", "use crate::a::X;"),
        ];
        assert_eq!(pairs(&files), ["a::one a::two"]);
    }

    #[test]
    fn a_longer_circle_is_found_once() {
        let files = [
            ("", ""),
            ("a", "use crate::b;"),
            ("b", "use crate::c;"),
            ("c", "use crate::a;"),
            ("d", "use crate::a;"),
        ];
        let graph = graph(&files);
        let circles = circles_of(&graph);
        assert_eq!(circles.len(), 1);
        assert_eq!(circles[0].len(), 3);
        assert!(pairs_of(&graph).is_empty());
    }
}
