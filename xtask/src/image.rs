//! The image that is flashed, run on an emulated chip (`firmware/emulator`).

use std::path::{Path, PathBuf};

use anyhow::Result;
use gonia_pins::boards::{BOARDS, named};

use crate::boards;
use crate::tools::{cargo, root, run};

/// The workspace that builds the images.
const FOLDER: &str = "firmware/boards/stm32f4";

/// Builds every board's image and the emulator, and runs the rows that a word names: none for the essential
/// ones, `--all` for every one, or a part of a row's name. A board's name before it is that board alone.
pub fn image(words: &[String]) -> Result<()> {
    let root = root()?;
    boards::add_boards_targets(&root)?;
    run(cargo(&root.join(FOLDER)).args(["build", "--release", "--locked"]))?;
    build(&root)?;
    run_rows(&root, words)
}

/// Builds the emulator. Its core asks for a newer compiler than the project's, and is built by this one.
pub fn build(root: &Path) -> Result<()> {
    run(cargo(&folder(root)).args(["build", "--locked", "--ignore-rust-version"]))
}

/// Runs rows on the images that have been built.
pub fn run_rows(root: &Path, words: &[String]) -> Result<()> {
    let program = folder(root).join("target/debug/gonia-image");
    let (board, words) = match words.split_first() {
        Some((first, rest)) if named(first).is_some() => (named(first), rest),
        _ => (None, words),
    };
    for board in BOARDS
        .iter()
        .filter(|one| board.is_none_or(|b| b.name == one.name))
    {
        println!("{}", board.title);
        let elf = boards::elf(root, board.name)?;
        run(std::process::Command::new(&program).arg(elf).args(words))?;
    }
    Ok(())
}

/// The emulator's workspace.
pub fn folder(root: &Path) -> PathBuf {
    root.join("firmware/emulator")
}
