//! The tests that take minutes: what a release must pass beside `cargo xtask test`.

use crate::table::Table;
use crate::tools::{cargo, root, run};
use anyhow::{Result, bail};

/// Each with what cargo's test takes before `--`.
const TESTS: [(&str, &str); 8] = [
    (
        "fifty rigs, unknown materials, failures of calibration",
        "-p gonia-pipeline --test calibration",
    ),
    (
        "each error of the budget alone",
        "-p gonia-pipeline --test each_error_alone",
    ),
    (
        "sessions that end a hundred thousand times",
        "-p gonia-acquire --lib a_hundred_thousand_endings",
    ),
    (
        "faults of controllers for days",
        "-p gonia-tests --test controllers_fault_plans",
    ),
    (
        "pointing of the arms",
        "-p gonia-tests --test controllers_session",
    ),
    (
        "shifts of the arms",
        "-p gonia-tests --test controllers_shifts",
    ),
    (
        "a million commands",
        "-p gonia-tests --test controllers_soak",
    ),
    ("fits of models", "-p gonia-brdf --test fit"),
];

/// All of them, one after another; the table says how long each took. One that fails does not keep the others from
/// running.
///
/// # Errors
/// Those that failed, by name.
pub fn long() -> Result<()> {
    let (root, mut table) = (root()?, Table::default());
    let mut failed = Vec::new();
    for (what, tests) in TESTS {
        let mut command = cargo(&root);
        command.arg("test").args(tests.split_whitespace());
        command.args(["--", "--ignored", "--nocapture"]);
        if table.step(what, || run(&mut command)).is_err() {
            failed.push(what);
        }
    }
    table.print();
    if failed.is_empty() {
        return Ok(());
    }
    bail!("failed: {}", failed.join("; "))
}
