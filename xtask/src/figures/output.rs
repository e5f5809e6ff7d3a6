//! What of a command's output becomes the figure.

use super::cost::Ran;
use anyhow::{Context, Result, bail};
use std::path::Path;

/// What of the output is taken.
pub enum Take {
    /// The markdown tables on standard output. Tables of the same columns become one.
    Tables,
    /// Standard output as it is, without what the test harness says.
    Text,
    /// A table of what each `gonia` command took: CPU and wall time, peak of memory.
    Costs,
    /// A CSV file in the folder of what is made.
    Csv(&'static str),
    /// Nothing: the command is a test that writes its page itself, and compares it in every run. Its
    /// table has neither marks nor a caption, as it holds at every commit.
    Written,
}

impl Take {
    /// The lines of the figure, without its caption.
    pub fn section(&self, ran: &[Ran], work: &Path) -> Result<String> {
        let all: String = ran.iter().map(|ran| ran.stdout.as_str()).collect();
        let section = match self {
            Self::Tables => tables(&all),
            Self::Text => text(&all),
            Self::Costs => costs(ran),
            Self::Csv(file) => {
                let path = work.join(file);
                let csv = std::fs::read_to_string(&path);
                table_of_csv(&csv.with_context(|| path.display().to_string())?)
            }
            Self::Written => bail!("the command writes its page itself"),
        };
        if section.is_empty() {
            bail!("the commands printed no table");
        }
        Ok(section)
    }
}

fn tables(stdout: &str) -> String {
    let mut lines: Vec<&str> = Vec::new();
    let mut heading = "";
    let mut was_table = false;
    let mut rows = stdout.lines().peekable();
    while let Some(line) = rows.next() {
        if !line.starts_with('|') {
            continue;
        }
        if rows.peek().is_some_and(|next| is_divider(next)) {
            if line == heading {
                rows.next();
                continue;
            }
            if was_table {
                lines.push("");
            }
            heading = line;
        }
        was_table = true;
        lines.push(line);
    }
    lines.join("\n")
}

fn is_divider(line: &str) -> bool {
    line.starts_with("|-") && line.bytes().all(|b| b"|-: ".contains(&b))
}

fn text(stdout: &str) -> String {
    let lines: Vec<&str> = stdout.lines().filter_map(said).collect();
    match lines.join("\n").trim_matches('\n') {
        "" => String::new(),
        text => format!("```text\n{text}\n```"),
    }
}

/// A line without what the test harness says: `test NAME ... ` stands before the first line of a test
/// that runs alone.
fn said(line: &str) -> Option<&str> {
    let is_harness = |line: &str| {
        line.starts_with("running ") && line.contains(" test") || line.starts_with("test result:")
    };
    let verdicts = ["ok", "FAILED"];
    let line = match line
        .strip_prefix("test ")
        .and_then(|l| l.split_once(" ... "))
    {
        Some((_, rest)) if rest.starts_with("ignored") => "ok",
        Some((_, rest)) => rest,
        None => line,
    };
    (!is_harness(line) && !verdicts.contains(&line)).then_some(line)
}

fn costs(ran: &[Ran]) -> String {
    let mut lines = vec![
        "| command | CPU-s | wall, s | peak of memory, MB |".to_owned(),
        "|---|---|---|---|".to_owned(),
    ];
    let optional = |value: Option<f64>, digits: usize| match value {
        Some(value) => format!("{value:.digits$}"),
        None => "–".into(),
    };
    for ran in ran.iter().filter(|ran| ran.command.starts_with("gonia ")) {
        lines.push(format!(
            "| `{}` | {} | {:.1} | {} |",
            ran.command.replace("{work}/", ""),
            optional(ran.cost.cpu_s, 1),
            ran.cost.wall_s,
            optional(ran.cost.peak_mb, 0)
        ));
    }
    if lines.len() == 2 {
        return String::new();
    }
    lines.join("\n")
}

/// Without quoted fields: none of the files has any.
fn table_of_csv(csv: &str) -> String {
    let row = |line: &str| format!("| {} |", line.replace(',', " | "));
    let mut lines = csv.lines();
    let Some(heading) = lines.next() else {
        return String::new();
    };
    let divider = format!("|{}", "---|".repeat(heading.split(',').count()));
    let mut table = vec![row(&heading.replace('_', " ")), divider];
    table.extend(lines.map(row));
    table.join("\n")
}

#[cfg(test)]
mod tests {
    use super::super::cost::Cost;
    use super::*;

    #[test]
    fn tables_of_the_same_columns_become_one_and_others_stand_apart() {
        let stdout = "\
heard first
| a | b |
|---|---|
| 1 | 2 |
a detail
| 3 | 4 |
| a | b |
|---|---|
| 5 | 6 |
| c |
|---|
| 7 |
";
        let expected =
            "| a | b |\n|---|---|\n| 1 | 2 |\n| 3 | 4 |\n| 5 | 6 |\n\n| c |\n|---|\n| 7 |";
        assert_eq!(tables(stdout), expected);
    }

    #[test]
    fn a_block_of_text_has_nothing_of_the_test_harness() {
        let stdout = "
running 2 tests
test one ... first line
second line
ok
test two ... ignored, takes minutes
test three ... ok

test result: ok. 2 passed
";
        assert_eq!(text(stdout), "```text\nfirst line\nsecond line\n```");
        assert_eq!(text("\nrunning 0 tests\n"), "");
    }

    fn ran(command: &'static str, cost: Cost) -> Ran {
        Ran {
            command,
            stdout: String::new(),
            cost,
        }
    }

    #[test]
    fn costs_are_those_of_gonia_commands_and_unknown_ones_are_dashes() {
        let cost = Cost {
            wall_s: 1.26,
            cpu_s: Some(2.0),
            peak_mb: None,
        };
        let rows = [ran("cargo build", cost), ran("gonia fill {work}/a", cost)];
        let table = costs(&rows);
        assert!(
            table.ends_with("|---|\n| `gonia fill a` | 2.0 | 1.3 | – |"),
            "{table}"
        );
        let take = Take::Costs;
        assert!(take.section(&rows[..1], Path::new(".")).is_err());
    }

    #[test]
    fn a_csv_file_becomes_a_table() {
        let expected = "| x s | y |\n|---|---|\n| 1 | 2 |\n| 3 |  |";
        assert_eq!(table_of_csv("x_s,y\n1,2\n3,\n"), expected);
    }

    #[test]
    fn output_without_a_table_is_an_error() {
        assert!(Take::Tables.section(&[], Path::new(".")).is_err());
        assert!(Take::Text.section(&[], Path::new(".")).is_err());
        assert!(
            Take::Csv("nowhere.csv")
                .section(&[], Path::new("."))
                .is_err()
        );
    }
}
