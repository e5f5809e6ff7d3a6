//! What the chores do, step by step.

use crate::fuzz;
use crate::size::{budget_of, size_of};
use crate::tools::{TARGET, add_target, install, install_library, run};
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// The board that runs in QEMU.
const QEMU_BOARD: &str = "qemu-mps2";

/// What the feature `genicam` is built with.
const ARAVIS: [&str; 3] = ["libaravis-dev", "libusb-1.0-0-dev", "pkg-config"];

/// All that a change must pass.
pub fn test() -> Result<()> {
    let root = root()?;
    let mut table = Table::default();
    table.step("target for the boards", add_target)?;
    let qemu = install("qemu-system-arm", "qemu-system-arm");
    let genicam = install_library("aravis-0.8", &ARAVIS);
    table.step("format", || {
        run(cargo(&root).args(["fmt", "--all", "--check"]))?;
        for board in board_folders(&root)? {
            run(cargo(&board).args(["fmt", "--check"]))?;
        }
        Ok(())
    })?;
    table.step("clippy", || {
        run(cargo(&root).args([
            "clippy",
            "--workspace",
            "--all-targets",
            "--",
            "-D",
            "warnings",
        ]))
    })?;
    // With the cameras, if their library is there; without, the step above has looked at it all.
    let features: &[&str] = if genicam {
        &["--features", "gonia/genicam"]
    } else {
        &[]
    };
    if genicam {
        table.step("clippy with GenICam", || {
            run(cargo(&root)
                .args(["clippy", "--workspace", "--all-targets"])
                .args(features)
                .args(["--", "-D", "warnings"]))
        })?;
    } else {
        table.not_run(
            "sessions through GigE Vision",
            &format!(
                "the library aravis is missing: apt-get install {}",
                ARAVIS.join(" ")
            ),
        );
    }
    table.step("boards", || build_boards(&root))?;
    table.step("size of the boards", || check_sizes(&root))?;
    table.step("tests", || {
        run(cargo(&root).args(["test", "--workspace"]).args(features))
    })?;
    // Here and below with the whole workspace's features, as all has been built for the tests above.
    table.step("sessions that are killed", || {
        run(cargo(&root)
            .args(["test", "--workspace", "--test", "capture"])
            .args(features)
            .args(["--", "--ignored", "--nocapture", "--test-threads", "1"]))
    })?;
    if qemu {
        table.step("firmware in QEMU", || {
            run(cargo(&root)
                .args(["test", "--workspace", "--test", "controllers_qemu"])
                .args(features)
                .args(["--", "--ignored", "--nocapture"])
                .env("GONIA_QEMU_ELF", qemu_elf(&root)))
        })?;
    } else {
        table.not_run(
            "firmware in QEMU",
            "qemu-system-arm is missing: apt-get install qemu-system-arm",
        );
    }
    if install("chromium", "chromium") {
        table.step("report and live page in a browser", || {
            run(cargo(&root)
                .args(["test", "--workspace", "--test", "browser"])
                .args(features)
                .args(["--test", "browser_live"])
                .args(["--", "--ignored"])
                .env("GONIA_BROWSER", "chromium"))
        })?;
    } else {
        table.not_run(
            "report and live page in a browser",
            "chromium is missing: apt-get install chromium",
        );
    }
    fuzz_all(&mut table, &root, FUZZ_BRIEFLY_S)?;
    table.print();
    Ok(())
}

/// Builds the firmware of every board.
pub fn boards() -> Result<()> {
    add_target()?;
    build_boards(&root()?)
}

/// Prints what each board's program takes, and fails when one is over its budget.
pub fn size() -> Result<()> {
    add_target()?;
    let root = root()?;
    for board in board_folders(&root)? {
        run(cargo(&board).args(["build", "--release"]))?;
    }
    check_sizes(&root)
}

fn check_sizes(root: &Path) -> Result<()> {
    println!("{:<12} {:>9} {:>9}   budget", "board", "flash", "RAM");
    let mut over = Vec::new();
    for folder in board_folders(root)? {
        let name = name_of(&folder);
        let size = size_of(&program_of(&folder))?;
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
        println!("{name:<12} {:>9} {:>9}   {verdict}", size.flash, size.ram);
    }
    if !over.is_empty() {
        bail!(
            "over budget: {}; make the firmware smaller",
            over.join(", ")
        );
    }
    Ok(())
}

/// Seconds that the fuzzer has for a target by itself, and among all tests.
const FUZZ_S: u32 = 60;
const FUZZ_BRIEFLY_S: u32 = 5;

/// Runs every fuzz target of the protocol for a while.
pub fn fuzz() -> Result<()> {
    let mut table = Table::default();
    fuzz_all(&mut table, &root()?, FUZZ_S)?;
    table.print();
    Ok(())
}

/// Says so where the fuzzer cannot run.
fn fuzz_all(table: &mut Table, root: &Path, seconds: u32) -> Result<()> {
    if let Some(why) = fuzz::missing() {
        table.not_run("fuzzing", why);
        return Ok(());
    }
    table.step("build the fuzzers", || fuzz::build(root))?;
    for target in fuzz::TARGETS {
        table.step(&format!("fuzz {target}"), || {
            fuzz::run_target(root, target, seconds)
        })?;
    }
    Ok(())
}

fn build_boards(root: &Path) -> Result<()> {
    for board in board_folders(root)? {
        println!("board {}", board.display());
        run(cargo(&board).args(["clippy", "--release", "--", "-D", "warnings"]))?;
        run(cargo(&board).args(["build", "--release"]))?;
    }
    Ok(())
}

fn board_folders(root: &Path) -> Result<Vec<PathBuf>> {
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

fn qemu_elf(root: &Path) -> PathBuf {
    program_of(&root.join("firmware/boards").join(QEMU_BOARD))
}

/// The program of a board: each is named after its folder.
fn program_of(board: &Path) -> PathBuf {
    let program = format!("gonia-{}", name_of(board));
    board
        .join("target")
        .join(TARGET)
        .join("release")
        .join(program)
}

fn name_of(board: &Path) -> String {
    let name = board.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Cargo in a folder, without what an outer cargo passed down: the boards choose their own target.
fn cargo(folder: &Path) -> Command {
    let mut command = Command::new("cargo");
    command.current_dir(folder);
    for name in ["CARGO_TARGET_DIR", "CARGO_BUILD_TARGET", "RUSTFLAGS"] {
        if folder.ends_with("boards") || folder.parent().is_some_and(|p| p.ends_with("boards")) {
            command.env_remove(name);
        }
    }
    command
}

pub fn root() -> Result<PathBuf> {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .map(Path::to_path_buf)
        .context("xtask has no parent folder")
}

/// What ran, and for how long.
#[derive(Default)]
struct Table(Vec<String>);

impl Table {
    fn step(&mut self, name: &str, work: impl FnOnce() -> Result<()>) -> Result<()> {
        println!("== {name}");
        let start = Instant::now();
        work().with_context(|| name.to_string())?;
        self.0.push(format!(
            "passed  {name} ({:.0} s)",
            start.elapsed().as_secs_f64()
        ));
        Ok(())
    }

    /// Red on a terminal that knows colours, and said twice: a test that did not run has not passed.
    fn not_run(&mut self, name: &str, why: &str) {
        let line = format!("\x1b[1;31mNOT RUN {name}: {why}\x1b[0m");
        eprintln!("{line}");
        self.0.push(line);
    }

    fn print(&self) {
        println!();
        for line in &self.0 {
            println!("{line}");
        }
    }
}
