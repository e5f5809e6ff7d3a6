//! The project's own chores. `cargo xtask test` does all that a change must pass.

mod boards;
mod book;
mod doors;
mod fuzz;
mod imports;
mod length;
mod links;
mod modules;
mod size;
mod steps;
mod systems;
mod table;
mod tools;
mod windows;

use anyhow::Result;
use std::process::ExitCode;

/// A chore: its word, what it does, and where.
type Chore = (&'static str, &'static str, fn() -> Result<()>);

const CHORES: &[Chore] = &[
    (
        "test",
        "set up what the tests need, then all that a change must pass",
        steps::test,
    ),
    (
        "doors",
        "which crate may use which, which file imports which, how long functions are",
        steps::doors,
    ),
    ("boards", "build the firmware of every board", boards::build),
    (
        "size",
        "flash and RAM of every board against its budget",
        boards::size,
    ),
    (
        "fuzz",
        "let the fuzzer loose on the protocol for a minute a target",
        steps::fuzz,
    ),
    (
        "windows",
        "run the demo under Wine: the same bytes as on Linux",
        windows::compare_with_linux,
    ),
    (
        "book",
        "check the links of all pages and build the book into docs/book",
        book::book,
    ),
];

fn main() -> ExitCode {
    let word = std::env::args().nth(1).unwrap_or_default();
    let Some((_, _, chore)) = CHORES.iter().find(|chore| chore.0 == word) else {
        for (word, what, _) in CHORES {
            eprintln!("cargo xtask {word:<8} {what}");
        }
        return ExitCode::from(2);
    };
    match chore() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}
