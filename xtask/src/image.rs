//! The image that is flashed, run on an emulated chip (`firmware/emulator`).

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::boards;
use crate::tools::{cargo, root, run};

/// The board whose image is run.
const BOARD: &str = "stm32f4";

/// Builds the board's image and the emulator, and runs the rows that a word names: none for the essential
/// ones, `--all` for every one, or a part of a row's name.
pub fn image(words: &[String]) -> Result<()> {
    let root = root()?;
    boards::add_boards_targets(&root)?;
    let board = root.join("firmware/boards").join(BOARD);
    run(cargo(&board).args(["build", "--release", "--locked"]))?;
    build(&root)?;
    run_rows(&root, words)
}

/// Builds the emulator. Its core asks for a newer compiler than the project's, and is built by this one.
pub fn build(root: &Path) -> Result<()> {
    run(cargo(&folder(root)).args(["build", "--locked", "--ignore-rust-version"]))
}

/// Runs rows on the image that has been built.
pub fn run_rows(root: &Path, words: &[String]) -> Result<()> {
    let elf = boards::elf(root, BOARD)?;
    let program = folder(root).join("target/debug/gonia-image");
    run(std::process::Command::new(program).arg(elf).args(words))
}

/// The emulator's workspace.
pub fn folder(root: &Path) -> PathBuf {
    root.join("firmware/emulator")
}
