//! The boards' firmware: a workspace and a target each.

use crate::size::{budget_of, size_of};
use crate::tools::{add_targets, cargo, root, run};
use anyhow::{Context, Result, bail};
use gonia_pins::Board;
use gonia_pins::boards::BOARDS;
use gonia_pins::check::check;
use std::path::{Path, PathBuf};

/// The board that runs in QEMU.
const QEMU_BOARD: &str = "qemu-mps2";

/// Builds the firmware of every board.
pub fn build() -> Result<()> {
    let root = root()?;
    add_boards_targets(&root)?;
    build_all(&root)
}

/// Prints what each board's program takes, and fails when one is over its budget.
pub fn size() -> Result<()> {
    let root = root()?;
    add_boards_targets(&root)?;
    for board in folders(&root)? {
        run(cargo(&board).args(["build", "--release"]))?;
    }
    check_sizes(&root)
}

/// Adds every board's target to the toolchain.
pub fn add_boards_targets(root: &Path) -> Result<()> {
    let boards = folders(root)?;
    let mut targets = boards
        .iter()
        .map(|board| target_of(board))
        .collect::<Result<Vec<_>>>()?;
    targets.sort();
    targets.dedup();
    add_targets(&targets)
}

/// Checks the pins of every board, then lints and builds it.
pub fn build_all(root: &Path) -> Result<()> {
    check_pins(BOARDS)?;
    for board in folders(root)? {
        println!("board {}", board.display());
        run(cargo(&board).args(["clippy", "--release", "--", "-D", "warnings"]))?;
        run(cargo(&board).args(["build", "--release"]))?;
    }
    Ok(())
}

/// What cannot be of a board: two uses of a pin, a pin that its timer does not reach, settings in the image.
fn check_pins(boards: &[&Board]) -> Result<()> {
    let mut faults = Vec::new();
    for board in boards {
        check(board, |fault| {
            faults.push(format!("{}: {fault}", board.name))
        });
    }
    if !faults.is_empty() {
        bail!("{}", faults.join("\n"));
    }
    Ok(())
}

/// Compares what has been built with the budgets.
pub fn check_sizes(root: &Path) -> Result<()> {
    println!("{:<16} {:>9} {:>9}   budget", "board", "flash", "RAM");
    let mut over = Vec::new();
    for Program { name, elf } in programs(root)? {
        let size = size_of(&elf)?;
        let verdict = match budget_of(&name) {
            None => "none: it carries the simulated machine and ships nowhere".to_owned(),
            Some(budget) => {
                let is_within = size.is_within(budget);
                if !is_within {
                    over.push(name.clone());
                }
                let word = if is_within { "within" } else { "OVER" };
                format!("{word} {} and {} bytes", budget.flash, budget.ram)
            }
        };
        println!("{name:<16} {:>9} {:>9}   {verdict}", size.flash, size.ram);
    }
    if !over.is_empty() {
        bail!(
            "over budget: {}; make the firmware smaller",
            over.join(", ")
        );
    }
    Ok(())
}

/// The folder of every board.
pub fn folders(root: &Path) -> Result<Vec<PathBuf>> {
    let folder = root.join("firmware/boards");
    let mut found = Vec::new();
    for entry in std::fs::read_dir(&folder).with_context(|| format!("{}", folder.display()))? {
        let path = entry?.path();
        if path.join("Cargo.toml").is_file() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// The program of the board that runs in QEMU.
pub fn qemu_elf(root: &Path) -> Result<PathBuf> {
    elf(root, QEMU_BOARD)
}

/// The program of a board, by its name.
pub fn elf(root: &Path, board: &str) -> Result<PathBuf> {
    let mut programs = programs(root)?.into_iter();
    let program = programs.find(|program| program.name == board);
    let program =
        program.with_context(|| format!("no folder of firmware/boards builds {board}"))?;
    Ok(program.elf)
}

/// What is built for a board.
struct Program {
    /// The board's name.
    name: String,
    /// Where the build leaves it.
    elf: PathBuf,
}

/// Every folder's programs: several boards may share a folder.
fn programs(root: &Path) -> Result<Vec<Program>> {
    let mut programs = Vec::new();
    for folder in folders(root)? {
        let file = folder.join("Cargo.toml");
        let text = std::fs::read_to_string(&file).with_context(|| format!("{}", file.display()))?;
        let built = folder.join("target").join(target_of(&folder)?);
        let names = programs_in(&text).with_context(|| format!("{}", file.display()))?;
        programs.extend(names.into_iter().map(|name| Program {
            elf: built.join("release").join(format!("gonia-{name}")),
            name,
        }));
    }
    Ok(programs)
}

/// The boards of a manifest: its programs without `gonia-`, or its package where it names none.
fn programs_in(manifest: &str) -> Result<Vec<String>> {
    let manifest: toml::Table = manifest.parse()?;
    let name_in = |value: &toml::Value| {
        let name = value.get("name")?.as_str()?;
        Some(name.strip_prefix("gonia-")?.to_owned())
    };
    let named = match manifest.get("bin").and_then(|bins| bins.as_array()) {
        Some(bins) => bins.iter().map(name_in).collect(),
        None => manifest
            .get("package")
            .map(|package| name_in(package).into_iter().collect()),
    };
    let named: Option<Vec<String>> = named;
    let named = named.filter(|names| !names.is_empty());
    named.context("a program is not called gonia-NAME; name it so in [[bin]] or [package]")
}

/// The target of a board, from its own settings of cargo.
fn target_of(board: &Path) -> Result<String> {
    let file = board.join(".cargo/config.toml");
    let text = std::fs::read_to_string(&file).with_context(|| format!("{}", file.display()))?;
    target_in(&text).with_context(|| {
        let file = file.display();
        format!("{file}: no target; write the chip's: [build] target = \"thumbv…\"")
    })
}

fn target_in(settings: &str) -> Result<String> {
    let settings: toml::Table = settings.parse()?;
    let target = settings.get("build").and_then(|build| build.get("target"));
    let target = target.and_then(|target| target.as_str());
    Ok(target.context("[build] names no target")?.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_is_what_the_boards_own_settings_say() {
        let settings = "[env]\ntarget = \"no\"\n[build]\ntarget = \"thumbv6m-none-eabi\"\n";
        assert_eq!(target_in(settings).unwrap(), "thumbv6m-none-eabi");
        assert!(target_in("[env]\ntarget = \"no\"\n").is_err());
        assert!(target_in("[build]\ntarget = [\"a\"]\n").is_err());
    }

    #[test]
    fn a_folder_builds_the_programs_that_its_manifest_names() {
        let package = "[package]\nname = \"gonia-one\"\n";
        assert_eq!(programs_in(package).unwrap(), ["one"]);
        let bins = "[[bin]]\nname = \"gonia-a\"\n[[bin]]\nname = \"gonia-b\"\n";
        let both = format!("{package}{bins}");
        assert_eq!(programs_in(&both).unwrap(), ["a", "b"]);
        assert!(programs_in("[package]\nname = \"other\"\n").is_err());
        assert!(programs_in(&both.replace("gonia-b", "b")).is_err());
    }

    #[test]
    fn every_board_of_the_pins_has_a_program() {
        let root = root().unwrap();
        for board in BOARDS {
            elf(&root, board.name).unwrap();
        }
    }

    #[test]
    fn a_board_with_two_uses_of_a_pin_is_not_built() {
        check_pins(BOARDS).unwrap();
        let mut wrong = gonia_pins::boards::BTT_OCTOPUS;
        wrong.camera_jumper.pin = wrong.interlock.pin;
        let error = check_pins(&[&wrong]).unwrap_err().to_string();
        assert_eq!(
            error,
            "btt-octopus: PG10 is both interlock chain and camera arm; choose another pin for one"
        );
    }

    #[test]
    fn every_board_names_its_target() {
        for board in folders(&root().unwrap()).unwrap() {
            target_of(&board).unwrap();
        }
    }
}
