//! Inputs that are not as they should be, put before the program: each run is a row of a table in
//! docs/src/reference/odd-input.md. `GONIA_UPDATE_DOCS=1 cargo test -p gonia` writes the rows; without
//! it a test fails when the page says something else than the program.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Output;

/// What came in, and what `gonia` made of it.
pub struct Case {
    /// What came in, in a few words.
    came_in: String,
    /// The lines by which `gonia` says what it thinks of it.
    said: String,
    code: i32,
}

impl Case {
    /// Takes what was said of the input: the line of an error, the warnings, and the rows of the
    /// printed table that begin with one of `rows`. The folder's name is left out of all of them.
    pub fn new(came_in: &str, output: &Output, folder: &Path, rows: &[&str]) -> Self {
        let errors = String::from_utf8_lossy(&output.stderr);
        let printed = String::from_utf8_lossy(&output.stdout);
        assert!(!errors.contains("panicked"), "{came_in}: {errors}");
        let is_word = |line: &&str| line.starts_with("gonia: ") || line.starts_with("warning: ");
        let is_row = |line: &&str| rows.iter().any(|row| line.starts_with(row));
        let said: Vec<String> = errors
            .lines()
            .filter(is_word)
            .chain(printed.lines().filter(is_row))
            .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
            .collect();
        let folder = format!("{}/", folder.display());
        Self {
            came_in: came_in.to_owned(),
            said: said.join("<br>").replace(&folder, "").replace('|', "\\|"),
            code: output.status.code().unwrap_or(-1),
        }
    }

    /// What was said, for a test to look into.
    #[allow(dead_code)]
    pub fn said(&self) -> &str {
        &self.said
    }

    /// The exit code.
    #[allow(dead_code)]
    pub fn code(&self) -> i32 {
        self.code
    }
}

/// Holds the page's table of this name against the cases, or writes it.
pub fn document(name: &str, cases: &[Case]) {
    // The system's own messages stand in the tables: Linux's.
    if cfg!(not(target_os = "linux")) {
        return;
    }
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/reference/odd-input.md");
    let mut rows = String::from("| what came in | what gonia says | exit code |\n|---|---|---|\n");
    for case in cases {
        let said = if case.said.is_empty() {
            "nothing: it is read"
        } else {
            &case.said
        };
        let _ = writeln!(rows, "| {} | {said} | {} |", case.came_in, case.code);
    }
    let (open, close) = (format!("<!-- {name} -->\n"), format!("<!-- /{name} -->"));
    let written = std::fs::read_to_string(&page).unwrap();
    let (before, rest) = written.split_once(&open).unwrap();
    let (_, after) = rest.split_once(&close).unwrap();
    let new = format!("{before}{open}{rows}{close}{after}");
    if std::env::var_os("GONIA_UPDATE_DOCS").is_some() {
        std::fs::write(&page, new).unwrap();
        return;
    }
    assert!(
        written == new,
        "odd-input.md is out of date in its table of {name}: run this test with GONIA_UPDATE_DOCS=1\n{rows}"
    );
}
