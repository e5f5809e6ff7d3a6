//! `cargo xtask figures`: every table of the book is made by a program, and written between its marks
//! with the machine and the commit that it was measured on.

mod cost;
mod makers;
mod marks;
mod origin;
mod output;

use anyhow::{Context, Result, bail};
use makers::{FIGURES, Figure};
use marks::{is_caption, outside, rewritten, sections};
use origin::Origin;
use output::Take;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Where makers put what they make, below the folder of the project.
const WORK: &str = "target/figures";
/// The pages that hold nothing but what was measured: no table stands outside of marks there.
const PAGES: &str = "docs/src/figures";

/// Lists the figures, checks the book, or makes the figures that are named (`all`: all).
pub fn figures(root: &Path, arguments: &[String]) -> Result<()> {
    match arguments {
        [] => list(),
        [only] if only == "--check" => {
            let problems = problems(&pages(root)?);
            if !problems.is_empty() {
                bail!("{}", problems.join("\n"));
            }
            println!("{} figures, each with its maker", FIGURES.len());
        }
        [only] if only == "all" => return make_all(root, &FIGURES.iter().collect::<Vec<_>>()),
        names => return make_all(root, &named(names)?),
    }
    Ok(())
}

fn list() {
    println!("{:<16} {:>7}  made by", "name", "minutes");
    for figure in FIGURES {
        let last = figure.steps.last().map_or("", |step| step.command);
        println!(
            "{:<16} {:>7}  {}",
            figure.name,
            figure.minutes,
            last.replace("{work}", WORK)
        );
    }
    let minutes: f64 = FIGURES.iter().map(|figure| figure.minutes).sum();
    println!(
        "\ncargo xtask figures NAME... makes some, all makes all ({:.1} h on two idle cores), --check looks at the book",
        minutes / 60.0
    );
}

fn named(names: &[String]) -> Result<Vec<&'static Figure>> {
    names
        .iter()
        .map(|name| {
            FIGURES
                .iter()
                .find(|figure| figure.name == name)
                .with_context(|| format!("no figure {name}: cargo xtask figures lists them"))
        })
        .collect()
}

/// Makes figures one after the other. One that fails does not stop the others.
fn make_all(root: &Path, figures: &[&Figure]) -> Result<()> {
    let work = root.join(WORK);
    Origin::now(root)?.clear_others(&work)?;
    let mut failed = Vec::new();
    for figure in figures {
        println!("== {}", figure.name);
        if let Err(error) = make(root, &work, figure) {
            eprintln!("{}: {error:#}", figure.name);
            failed.push(figure.name);
        }
    }
    if !failed.is_empty() {
        bail!("not made: {}", failed.join(", "));
    }
    Ok(())
}

fn make(root: &Path, work: &Path, figure: &Figure) -> Result<()> {
    let origin = Origin::now(root)?;
    let start = Instant::now();
    let mut outputs = Vec::new();
    for step in figure.steps {
        outputs.extend(step.run(root, work)?);
    }
    if matches!(figure.take, Take::Written) {
        return Ok(());
    }
    let page = page_of(root, figure.name)?;
    let body = figure.take.section(&outputs, work)?;
    let commands: Vec<&str> = figure.steps.iter().map(|step| step.command).collect();
    let caption = origin.caption(start.elapsed().as_secs_f64(), &commands, WORK);
    let text = std::fs::read_to_string(&page)?;
    let new = rewritten(&text, figure.name, &format!("{body}\n\n{caption}"))?;
    std::fs::write(&page, new).with_context(|| page.display().to_string())?;
    for (from, name) in figure.pictures {
        let to = root.join(PAGES).join(name);
        std::fs::copy(work.join(from), &to).with_context(|| to.display().to_string())?;
    }
    println!("written: {}", page.display());
    Ok(())
}

/// The page that holds the figure's marks.
fn page_of(root: &Path, name: &str) -> Result<PathBuf> {
    let of_name = |text: &str| sections(text).is_ok_and(|all| all.iter().any(|s| s.name == name));
    pages(root)?
        .into_iter()
        .find(|(_, text)| of_name(text))
        .map(|(path, _)| path)
        .with_context(|| format!("no page of docs has the mark <!-- figures {name} -->"))
}

/// Every page of the documentation with its text.
fn pages(root: &Path) -> Result<Vec<(PathBuf, String)>> {
    let mut folders = vec![root.join("docs")];
    let mut pages = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                let text = std::fs::read_to_string(&path)?;
                pages.push((path, text));
            }
        }
    }
    pages.sort();
    Ok(pages)
}

/// What is wrong with the figures of some pages, a line each.
fn problems(pages: &[(PathBuf, String)]) -> Vec<String> {
    let mut problems = Vec::new();
    let mut found = Vec::new();
    for (path, text) in pages {
        let mut problem = |what: String| problems.push(format!("{}: {what}", path.display()));
        let all = match sections(text) {
            Ok(all) => all,
            Err(error) => {
                problem(error.to_string());
                continue;
            }
        };
        for section in &all {
            let name = section.name;
            if !FIGURES.iter().any(|figure| figure.name == name) {
                problem(format!("nothing makes the figure {name}"));
            }
            if !section.lines.iter().any(|line| is_table(line)) {
                problem(format!("the figure {name} has no table"));
            }
            let last = section.lines.iter().rfind(|line| !line.is_empty());
            if !last.is_some_and(|line| is_caption(line)) {
                problem(format!(
                    "the figure {name} does not end with its caption (machine; commit; date; command)"
                ));
            }
            found.push(name);
        }
        let folder = path.parent();
        if folder.is_some_and(|folder| folder.ends_with(PAGES)) {
            for line in outside(text).filter(|line| is_table(line)) {
                problem(format!("stands outside of a figure's marks: {line}"));
            }
        }
    }
    for figure in FIGURES.iter().filter(|f| !matches!(f.take, Take::Written)) {
        let times = found.iter().filter(|name| **name == figure.name).count();
        if times != 1 {
            problems.push(format!(
                "the figure {} stands in the book {times} times",
                figure.name
            ));
        }
    }
    problems
}

/// A line of a table, or the border of a block of text.
fn is_table(line: &str) -> bool {
    line.starts_with('|') || line.starts_with("```")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_of_the_book_has_a_maker_and_a_caption_and_every_maker_a_table() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let problems = problems(&pages(root).unwrap());
        assert!(problems.is_empty(), "{}", problems.join("\n"));
    }

    fn problems_of(text: &str) -> Vec<String> {
        let path = Path::new(PAGES).join("accuracy.md");
        let mut found = problems(&[(path, text.to_owned())]);
        // Of one page alone, nearly all figures are missing.
        found.retain(|problem| !problem.contains("in the book 0 times"));
        found
    }

    const CAPTION: &str = "*A machine, 2 cores; commit 0123abc; 2026-11-27. `cargo bench`*";

    #[test]
    fn a_table_without_marks_caption_or_maker_is_a_problem() {
        let good = format!(
            "# Page\n<!-- figures binning -->\n| a |\n|---|\n| 1 |\n\n{CAPTION}\n<!-- /figures binning -->\n"
        );
        assert_eq!(problems_of(&good), [""; 0]);
        let twice = format!("{good}{good}");
        assert!(problems_of(&twice)[0].contains("2 times"));
        let unknown = good.replace("binning", "nobody");
        assert!(problems_of(&unknown)[0].contains("nothing makes"));
        let bare = good.replace(CAPTION, "");
        assert!(problems_of(&bare)[0].contains("caption"));
        let empty = good.replace("| ", "").replace("|-", "");
        assert!(problems_of(&empty)[0].contains("no table"));
        let outside = format!("{good}| b |\n");
        assert!(problems_of(&outside)[0].contains("outside"));
        let open = good.replace("<!-- /figures binning -->", "");
        assert!(problems_of(&open)[0].contains("binning"));
    }

    #[test]
    fn a_name_that_nothing_makes_is_refused_before_anything_runs() {
        let error = named(&["binning".into(), "nobody".into()]).err().unwrap();
        assert!(error.to_string().contains("nobody"));
    }

    #[test]
    fn no_two_figures_have_one_name_and_each_has_a_command_that_lasts_some_time() {
        for (k, figure) in FIGURES.iter().enumerate() {
            let others = &FIGURES[k + 1..];
            assert!(others.iter().all(|other| other.name != figure.name));
            assert!(!figure.steps.is_empty() && figure.minutes > 0.0);
        }
    }
}
