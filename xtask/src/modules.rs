//! A crate's files as a tree of modules, without what is only built for tests.

use anyhow::{Context, Result};
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::path::{Path, PathBuf};

/// A module that has a file of its own.
pub struct Module {
    /// Its name from the crate's root: `["evaluate", "chart"]`; empty for the root.
    pub name: Vec<String>,
    /// Its file.
    pub file: PathBuf,
    /// What stands in the file, tests left out.
    pub tokens: Vec<TokenTree>,
}

/// The tokens of a source.
pub fn tokens_of(text: &str) -> Result<TokenStream> {
    text.parse()
        .map_err(|error| anyhow::anyhow!("not Rust: {error}"))
}

/// The modules of a crate, from its root's file (`src/lib.rs`) down.
pub fn modules_of(root: &Path) -> Result<Vec<Module>> {
    let folder = root.parent().context("a source without a folder")?;
    let mut found = Vec::new();
    add(root, folder, Vec::new(), &mut found)?;
    Ok(found)
}

/// Adds a file and those of its children, which lie in `folder`.
fn add(file: &Path, folder: &Path, name: Vec<String>, found: &mut Vec<Module>) -> Result<()> {
    let text = std::fs::read_to_string(file).with_context(|| format!("{}", file.display()))?;
    let tokens = tokens_of(&text).with_context(|| format!("{}", file.display()))?;
    let tokens = without_tests(tokens);
    let children = children_of(&tokens);
    found.push(Module {
        name: name.clone(),
        file: file.to_owned(),
        tokens,
    });
    for child in children {
        let below = folder.join(&child);
        let beside = below.with_extension("rs");
        let file = if beside.is_file() {
            beside
        } else {
            below.join("mod.rs")
        };
        add(&file, &below, [name.clone(), vec![child]].concat(), found)?;
    }
    Ok(())
}

/// The modules that are declared with files of their own: `mod name;`.
fn children_of(tokens: &[TokenTree]) -> Vec<String> {
    let declared = tokens.windows(3).filter_map(|three| match three {
        [
            TokenTree::Ident(word),
            TokenTree::Ident(name),
            TokenTree::Punct(end),
        ] if word == "mod" && end.as_char() == ';' => Some(name.to_string()),
        _ => None,
    });
    declared.collect()
}

/// Tokens without the items under `#[cfg(test)]`, at any depth.
pub fn without_tests(tokens: TokenStream) -> Vec<TokenTree> {
    let mut rest = tokens.into_iter().peekable();
    let mut kept = Vec::new();
    while let Some(token) = rest.next() {
        if is(&token, '#') && rest.peek().is_some_and(is_for_tests) {
            skip_item(&mut rest);
        } else if let TokenTree::Group(group) = token {
            let inner = without_tests(group.stream()).into_iter().collect();
            let mut thin = proc_macro2::Group::new(group.delimiter(), inner);
            thin.set_span(group.span());
            kept.push(thin.into());
        } else {
            kept.push(token);
        }
    }
    kept
}

/// Whether it is the `[cfg(test)]` of an attribute, alone or among `all(…)`.
fn is_for_tests(token: &TokenTree) -> bool {
    let text: String = token.to_string().split_whitespace().collect();
    text == "[cfg(test)]" || text.starts_with("[cfg(all(test,")
}

/// Takes what an attribute stands before: to its semicolon, or to the end of its braces.
fn skip_item(rest: &mut impl Iterator<Item = TokenTree>) {
    let mut to_semicolon = false;
    for token in rest {
        match &token {
            TokenTree::Ident(word) => {
                to_semicolon |= ["use", "const", "static", "type", "let"]
                    .iter()
                    .any(|w| word == w);
            }
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace && !to_semicolon => {
                return;
            }
            _ if is(&token, ';') => return,
            _ => {}
        }
    }
}

/// Whether a token is this sign.
pub fn is(token: &TokenTree, sign: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(text: &str) -> String {
        let tokens: TokenStream = without_tests(tokens_of(text).unwrap())
            .into_iter()
            .collect();
        tokens.to_string()
    }

    #[test]
    fn what_is_only_for_tests_is_left_out() {
        let text = "
            fn a() {}
            #[cfg(test)] #[path = \"x.rs\"] mod b { fn c() {} }
            #[cfg(all(test, unix))] use d::{e, f};
            mod g { #[cfg(test)] const H: X = X { i: 1 }; fn j() {} }
            #[cfg(not(test))] fn k() {}";
        assert_eq!(
            kept(text),
            "fn a () { } mod g { fn j () { } } # [cfg (not (test))] fn k () { }"
        );
    }

    #[test]
    fn a_crate_is_read_from_its_root_down() {
        let folder = std::env::temp_dir().join(format!("gonia-modules-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("a")).unwrap();
        std::fs::create_dir_all(folder.join("b/c")).unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
        write("lib.rs", "mod a; pub mod b; #[cfg(test)] mod tests;");
        write("a.rs", "mod d;");
        write("a/d.rs", "");
        write("b/mod.rs", "mod c;");
        write("b/c/mod.rs", "");
        let modules = modules_of(&folder.join("lib.rs"));
        std::fs::remove_dir_all(&folder).unwrap();
        let names: Vec<String> = modules.unwrap().iter().map(|m| m.name.join("::")).collect();
        assert_eq!(names, ["", "a", "a::d", "b", "b::c"]);
    }
}
