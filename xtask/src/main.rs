//! The project's own chores. `cargo xtask test` does all that a change must pass.

mod figures;
mod fuzz;
mod size;
mod steps;
mod tools;

use std::process::ExitCode;

const USAGE: &str = "\
cargo xtask test    set up what the tests need, then fmt, clippy, boards, all tests, a short fuzz
cargo xtask boards  build the firmware of every board
cargo xtask size    flash and RAM of every board against its budget
cargo xtask fuzz    let the fuzzer loose on the protocol for a minute a target
cargo xtask figures [NAME]   measure a table of the book and write it; without NAME, list them";

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let command = arguments.next().unwrap_or_default();
    let rest: Vec<String> = arguments.collect();
    let outcome = match command.as_str() {
        "test" => steps::test(),
        "boards" => steps::boards(),
        "size" => steps::size(),
        "fuzz" => steps::fuzz(),
        "figures" => steps::root().and_then(|root| figures::figures(&root, &rest)),
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}
