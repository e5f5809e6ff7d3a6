//! The doors between crates: which may use which, by the table in ARCHITECTURE.md.

use crate::tools::{cargo, root};
use anyhow::{Context, Result, bail};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// Between these two lines stands the table: crate, folder, what it may use, what lives there.
const MARKS: [&str; 2] = ["<!-- doors -->", "<!-- /doors -->"];

/// A row of the table. Lowest crates come first: a row names rows above it. A crate may use what its
/// row names, and what those may use.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Row {
    name: String,
    folder: String,
    /// What the crate may use.
    uses: Vec<String>,
    /// What only its tests, examples and benches may use: `name (tests)` in the table.
    tests_use: Vec<String>,
}

/// A crate as cargo knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Crate {
    name: String,
    /// Relative to the repository.
    folder: String,
    /// The project's crates that it depends on, and whether only as a dev-dependency.
    uses: Vec<(String, bool)>,
}

/// Fails when a crate depends on one that its row does not name, and when the table says more than
/// is so.
pub fn check(workspaces: &[std::path::PathBuf]) -> Result<()> {
    let root = root()?;
    let page = std::fs::read_to_string(root.join("ARCHITECTURE.md")).context("ARCHITECTURE.md")?;
    let mut crates = Vec::new();
    for folder in workspaces {
        crates.extend(crates_of(&metadata(folder)?, &root)?);
    }
    let rows = rows_of(&page)?;
    let faults = faults_of(&rows, &crates);
    let arrows: usize = crates.iter().map(|c| c.uses.len()).sum();
    println!("{} crates, {arrows} arrows between them", crates.len());
    if !faults.is_empty() {
        bail!("{}", faults.join("\n"));
    }
    Ok(())
}

/// What cargo says about the workspace in a folder.
pub fn metadata(folder: &Path) -> Result<Value> {
    let arguments = ["metadata", "--format-version", "1", "--no-deps"];
    let output = output_of(cargo(folder).args(arguments))?;
    serde_json::from_slice(&output).context("cargo metadata: not JSON")
}

fn output_of(command: &mut Command) -> Result<Vec<u8>> {
    let output = command.output().context("cannot start cargo metadata")?;
    if !output.status.success() {
        let why = String::from_utf8_lossy(&output.stderr);
        bail!("cargo metadata: {}", why.trim());
    }
    Ok(output.stdout)
}

fn crates_of(metadata: &Value, root: &Path) -> Result<Vec<Crate>> {
    let packages = metadata["packages"].as_array().context("no packages")?;
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let crates = packages.iter().map(|package| {
        let manifest = text(&package["manifest_path"]);
        let folder = Path::new(&manifest).parent().unwrap_or(root);
        let dependencies = package["dependencies"].as_array();
        // A crate of this project is depended on by its path; all others come from the registry.
        let ours = dependencies
            .into_iter()
            .flatten()
            .filter(|d| d["path"].is_string());
        Crate {
            name: text(&package["name"]),
            folder: folder
                .strip_prefix(root)
                .unwrap_or(folder)
                .display()
                .to_string(),
            uses: ours
                .map(|d| (text(&d["name"]), d["kind"].as_str() == Some("dev")))
                .collect(),
        }
    });
    Ok(crates.collect())
}

fn rows_of(page: &str) -> Result<Vec<Row>> {
    let table = page
        .split_once(MARKS[0])
        .and_then(|(_, rest)| rest.split_once(MARKS[1]))
        .with_context(|| {
            let [open, close] = MARKS;
            format!("ARCHITECTURE.md: no table of doors; put one between {open} and {close}")
        })?
        .0;
    let lines = table
        .lines()
        .map(str::trim)
        .filter(|line| line.starts_with('|'));
    lines.skip(2).map(row_of).collect()
}

fn row_of(line: &str) -> Result<Row> {
    let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
    let [name, folder, uses, ..] = cells[..] else {
        bail!("ARCHITECTURE.md: {line}: write `| crate | folder | may use | lives there |`");
    };
    let mut row = Row {
        name: name.trim_matches('`').to_owned(),
        folder: folder.trim_matches('`').trim_end_matches('/').to_owned(),
        uses: Vec::new(),
        tests_use: Vec::new(),
    };
    for item in uses.split(',').map(str::trim).filter(|item| *item != "–") {
        let Some((used, rest)) = item.strip_prefix('`').and_then(|s| s.split_once('`')) else {
            bail!(
                "ARCHITECTURE.md: {}: {item}: write a crate in backticks, or –",
                row.name
            );
        };
        match rest.trim() {
            "" => row.uses.push(used.to_owned()),
            "(tests)" => row.tests_use.push(used.to_owned()),
            _ => bail!(
                "ARCHITECTURE.md: {}: {item}: only (tests) may follow",
                row.name
            ),
        }
    }
    Ok(row)
}

/// One line a fault: what, where, what to do.
fn faults_of(rows: &[Row], crates: &[Crate]) -> Vec<String> {
    let mut faults = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        for used in row.uses.iter().chain(&row.tests_use) {
            if !rows[..i].iter().any(|r| r.name == *used) {
                faults.push(format!(
                    "ARCHITECTURE.md: {} may use {used}, which has no row above it; the lowest crate comes first",
                    row.name
                ));
            }
        }
        let Some(found) = crates.iter().find(|c| c.name == row.name) else {
            faults.push(format!(
                "ARCHITECTURE.md: there is no crate {}; remove its row",
                row.name
            ));
            continue;
        };
        if row.folder != found.folder {
            faults.push(format!(
                "ARCHITECTURE.md: {} lives in {}, not in {}; correct its row",
                row.name, found.folder, row.folder
            ));
        }
        faults.extend(unused(row, found));
    }
    for found in crates {
        match rows.iter().position(|row| row.name == found.name) {
            Some(i) => faults.extend(not_allowed(rows, i, found)),
            None => faults.push(format!(
                "{}: the crate {} has no row in ARCHITECTURE.md; add one",
                found.folder, found.name
            )),
        }
    }
    faults
}

/// What a row allows and nobody uses: a table that allows more than is so is not true.
fn unused(row: &Row, found: &Crate) -> Vec<String> {
    let has = |name: &str, dev: bool| found.uses.iter().any(|u| u.0 == name && u.1 == dev);
    let allowed = row.uses.iter().filter(|name| !has(name, false));
    let by_tests = row.tests_use.iter().filter(|name| !has(name, true));
    allowed
        .chain(by_tests)
        .map(|name| {
            format!(
                "ARCHITECTURE.md: {} may use {name}, and does not; remove it from the row",
                row.name
            )
        })
        .collect()
}

fn not_allowed(rows: &[Row], i: usize, found: &Crate) -> Vec<String> {
    let row = &rows[i];
    let allowed = reached(rows, &row.uses);
    let by_tests = reached(rows, &row.tests_use);
    let allows = |name: &str, dev| allowed.contains(name) || dev && by_tests.contains(name);
    let bad = found.uses.iter().filter(|(name, dev)| !allows(name, *dev));
    bad.map(|(name, dev)| {
        let mark = if *dev { " (tests)" } else { "" };
        format!(
            "{}/Cargo.toml: {} uses {name}, and ARCHITECTURE.md does not allow it; remove the dependency, or add `{name}`{mark} to the row",
            found.folder, found.name
        )
    })
    .collect()
}

/// The named crates, and what those may use.
fn reached<'a>(rows: &'a [Row], named: &'a [String]) -> BTreeSet<&'a str> {
    let mut reached: BTreeSet<&str> = named.iter().map(String::as_str).collect();
    // From the highest row down, as each names rows above it in the table only.
    for row in rows.iter().rev() {
        if reached.contains(row.name.as_str()) {
            reached.extend(row.uses.iter().map(String::as_str));
        }
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "\
# Map
<!-- doors -->
| crate | folder | may use | lives there |
|---|---|---|---|
| `low` | `low/` | – | numbers |
| `mid` | `host/mid` | `low` | files |
| `sim` | `sim` | – | motors |
| `top` | `top` | `mid`, `sim` (tests) | commands |
<!-- /doors -->
";

    fn krate(name: &str, folder: &str, uses: &[(&str, bool)]) -> Crate {
        let uses = uses.iter().map(|(n, dev)| ((*n).to_owned(), *dev));
        Crate {
            name: name.to_owned(),
            folder: folder.to_owned(),
            uses: uses.collect(),
        }
    }

    fn sound() -> [Crate; 4] {
        [
            krate("low", "low", &[]),
            krate("mid", "host/mid", &[("low", false)]),
            krate("sim", "sim", &[]),
            krate(
                "top",
                "top",
                &[("mid", false), ("low", false), ("sim", true)],
            ),
        ]
    }

    fn faults(page: &str, crates: &[Crate]) -> Vec<String> {
        faults_of(&rows_of(page).unwrap(), crates)
    }

    #[test]
    fn what_a_row_names_and_what_those_may_use_is_allowed() {
        assert_eq!(faults(PAGE, &sound()), [""; 0]);
    }

    #[test]
    fn an_arrow_that_the_table_does_not_have_is_a_fault() {
        let mut crates = sound();
        crates[2].uses.push(("low".to_owned(), false));
        assert_eq!(
            faults(PAGE, &crates),
            [
                "sim/Cargo.toml: sim uses low, and ARCHITECTURE.md does not allow it; remove the dependency, or add `low` to the row"
            ]
        );
    }

    #[test]
    fn what_tests_may_use_is_not_for_the_crate_itself() {
        let mut crates = sound();
        crates[3].uses.push(("sim".to_owned(), false));
        let found = faults(PAGE, &crates);
        assert_eq!(found.len(), 1);
        assert!(
            found[0].starts_with("top/Cargo.toml: top uses sim"),
            "{found:?}"
        );
    }

    #[test]
    fn a_table_that_says_more_than_is_so_is_a_fault() {
        let mut crates = sound().to_vec();
        crates[3].uses.pop();
        crates[0].folder = "deep/low".to_owned();
        crates.swap_remove(1);
        let found = faults(PAGE, &crates);
        assert_eq!(
            found,
            [
                "ARCHITECTURE.md: low lives in deep/low, not in low; correct its row",
                "ARCHITECTURE.md: there is no crate mid; remove its row",
                "ARCHITECTURE.md: top may use sim, and does not; remove it from the row",
            ]
        );
    }

    #[test]
    fn a_crate_without_a_row_and_a_row_below_what_it_uses_are_faults() {
        let page = "<!-- doors -->\n| c | f | u | l |\n|-|-|-|-|\n| `a` | `a` | `b` | |\n| `b` | `b` | – | |\n<!-- /doors -->";
        let crates = [
            krate("a", "a", &[("b", false)]),
            krate("b", "b", &[]),
            krate("c", "c", &[]),
        ];
        let found = faults(page, &crates);
        assert_eq!(
            found,
            [
                "ARCHITECTURE.md: a may use b, which has no row above it; the lowest crate comes first",
                "c: the crate c has no row in ARCHITECTURE.md; add one",
            ]
        );
    }

    #[test]
    fn a_page_without_the_table_or_with_a_row_that_cannot_be_read_is_refused() {
        assert!(rows_of("# Map\n").is_err());
        assert!(row_of("| `a` | `a` | b, `c` | |").is_err());
        assert!(row_of("| `a` | `a` | `c` (sometimes) | |").is_err());
        assert!(row_of("| `a` |").is_err());
    }

    #[test]
    fn dependencies_by_path_are_the_projects_own() {
        let metadata = serde_json::json!({"packages": [{
            "name": "mid", "manifest_path": "/r/host/mid/Cargo.toml",
            "dependencies": [
                {"name": "low", "kind": null, "path": "/r/low"},
                {"name": "sim", "kind": "dev", "path": "/r/sim"},
                {"name": "png", "kind": null},
            ],
        }]});
        let crates = crates_of(&metadata, Path::new("/r")).unwrap();
        let uses = [("low", false), ("sim", true)];
        assert_eq!(crates, [krate("mid", "host/mid", &uses)]);
    }
}
