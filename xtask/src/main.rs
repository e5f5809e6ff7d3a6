//! The project's own chores. `cargo xtask test` does all that a change must pass.

mod boards;
mod book;
mod dfu;
mod doors;
mod figures;
mod fuzz;
mod hex;
mod image;
mod images;
mod imports;
mod length;
mod links;
mod load;
mod long;
mod modules;
mod python;
mod readers;
mod size;
mod steps;
mod systems;
mod table;
mod tools;
mod windows;
mod wiring;
mod wiring_figure;

use std::process::ExitCode;

const USAGE: &str = "\
cargo xtask test     set up what the tests need, then all that a change must pass
cargo xtask long     the tests that take minutes: with the above, what a release must pass
cargo xtask doors    which crate may use which, which file imports which, how long functions are
cargo xtask boards   build the firmware of every board
cargo xtask images   the boards' firmware as files to flash (ELF, HEX, DFU, plain bytes), in target/images
cargo xtask image [BOARD] [--all | NAME]  the images that are flashed, on an emulated chip with the arm on its pins
cargo xtask size     flash and RAM of every board against its budget
cargo xtask systems  lint everything for Windows and macOS (the tests do so for Windows)
cargo xtask fuzz     let the fuzzer loose on the protocol for a minute a target
cargo xtask windows  run the demo under Wine: the same bytes as on Linux
cargo xtask python   the Python package, built and tested (Python's own packages from PyPI)
cargo xtask readers  what gonia exports, read by other programs (from PyPI)
cargo xtask wiring   the tables and figures of the wiring pages, from the boards' pins
cargo xtask book     check the links of all pages and build the book in docs/book
cargo xtask figures [NAME]  measure a table of the book and write it; without NAME, list them";

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let command = arguments.next().unwrap_or_default();
    let rest: Vec<String> = arguments.collect();
    let outcome = match command.as_str() {
        "test" => steps::test(),
        "long" => long::long(),
        "doors" => steps::doors(),
        "boards" => boards::build(),
        "images" => images::images(),
        "image" => image::image(&rest),
        "size" => boards::size(),
        "systems" => steps::systems(),
        "fuzz" => steps::fuzz(),
        "windows" => windows::compare_with_linux(),
        "python" => python::check(),
        "readers" => readers::check(),
        "wiring" => tools::root().and_then(|root| wiring::write(&root)),
        "book" => book::book(),
        "figures" => tools::root().and_then(|root| figures::figures(&root, &rest)),
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
