//! What the chores do, step by step.

use crate::table::Table;
use crate::tools::{cargo, install, install_library, root, run};
use crate::{
    boards, book, doors, figures, fuzz, image, images, imports, length, links, python, readers,
    systems, wiring,
};
use anyhow::{Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the feature `genicam` is built with.
const ARAVIS: [&str; 3] = ["libaravis-dev", "libusb-1.0-0-dev", "pkg-config"];

/// All that a change must pass: what is quickest to fail comes first.
pub fn test() -> Result<()> {
    let mut table = Table::default();
    let outcome = all(&mut table, &root()?);
    // Where one failed, too: what came before it, and for how long.
    table.print();
    outcome
}

fn all(table: &mut Table, root: &Path) -> Result<()> {
    read_sources(table, root)?;
    let features = genicam(table);
    table.step("targets of the boards", || boards::add_boards_targets(root))?;
    // Boards and fuzzers have target folders of their own: neither waits for the workspace's.
    table.side_by_side(
        |table| compile(table, root, features),
        |table| compile_others(table, root),
    )?;
    // The second row waits more than it computes.
    table.side_by_side(
        |table| run_tests(table, root, features),
        |table| run_others(table, root, features),
    )
}

/// Which crate may use which, which file may import which, how long a function may be.
pub fn doors() -> Result<()> {
    let mut table = Table::default();
    check_doors(&mut table, &root()?)?;
    table.print();
    Ok(())
}

fn check_doors(table: &mut Table, root: &Path) -> Result<()> {
    let mut workspaces = vec![root.to_owned(), root.join("protocol/fuzz")];
    workspaces.extend(boards::folders(root)?);
    workspaces.push(image::folder(root));
    // All three, so that one run names all that is to be done.
    let outcomes = [
        table.step("doors between crates", || doors::check(&workspaces)),
        table.step("imports between files", || {
            imports::check(&doors::metadata(root)?, root)
        }),
        table.step("length of functions", || length::check(root)),
    ];
    let faults = outcomes.into_iter().filter_map(Result::err);
    let faults: Vec<String> = faults.map(|error| format!("{error:#}")).collect();
    if !faults.is_empty() {
        bail!("{}", faults.join("\n\n"));
    }
    Ok(())
}

/// What needs no compiler.
fn read_sources(table: &mut Table, root: &Path) -> Result<()> {
    check_doors(table, root)?;
    table.step("links", || links::check(root))?;
    table.step("wiring of the boards", || wiring::check(root))?;
    table.step("tables of the book", || {
        figures::figures(root, &["--check".to_owned()])
    })?;
    match book::installed(root) {
        Some(program) => table.step("book", || book::build(root, &program))?,
        None => table.not_run("book", "mdbook is missing: cargo xtask book installs it"),
    }
    table.step("format", || {
        run(cargo(root).args(["fmt", "--all", "--check"]))?;
        for board in boards::folders(root)? {
            run(cargo(&board).args(["fmt", "--check"]))?;
        }
        run(cargo(&image::folder(root)).args(["fmt", "--check"]))?;
        Ok(())
    })
}

/// The features that everything is built with: the cameras, if their library is there.
fn genicam(table: &mut Table) -> &'static [&'static str] {
    if install_library("aravis-0.8", &ARAVIS) {
        return &["--features", "gonia/genicam"];
    }
    let packages = ARAVIS.join(" ");
    let why = format!("the library aravis is missing: apt-get install {packages}");
    table.not_run("sessions through GigE Vision", &why);
    &[]
}

fn compile(table: &mut Table, root: &Path, features: &[&str]) -> Result<()> {
    table.step("clippy", || {
        run(cargo(root)
            .args(["clippy", "--workspace", "--all-targets"])
            .args(features)
            .args(["--", "-D", "warnings"]))
    })?;
    systems::check(table, root, &[systems::WINDOWS])?;
    table.step("build of the tests", || {
        run(tests(root, features).arg("--no-run"))
    })
}

fn compile_others(table: &mut Table, root: &Path) -> Result<()> {
    table.step("boards", || boards::build_all(root))?;
    table.step("size of the boards", || boards::check_sizes(root))?;
    table.step("files of the images", || {
        images::write_all(root, &root.join("target/images"))
    })?;
    table.step("build of the emulated chip", || image::build(root))?;
    match fuzz::missing() {
        None => table.step("build of the fuzzers", || fuzz::build(root)),
        Some(_) => Ok(()),
    }
}

/// The tests of the whole workspace, and of no less: another choice of crates has other features of their
/// dependencies, and builds them once more.
fn tests(root: &Path, features: &[&str]) -> Command {
    let mut command = cargo(root);
    command.args(["test", "--workspace", "--exclude", "xtask"]);
    command.args(features);
    command
}

fn run_tests(table: &mut Table, root: &Path, features: &[&str]) -> Result<()> {
    // The chores are there already, built in a profile of their own.
    table.step("tests of the chores", || {
        run(cargo(root).args(["test", "--profile", "xtask", "--package", "xtask"]))
    })?;
    table.step("tests", || run(&mut tests(root, features)))
}

fn run_others(table: &mut Table, root: &Path, features: &[&str]) -> Result<()> {
    let ignored = |names: &[&str], flags: &[&str]| {
        let mut command = tests(root, features);
        for name in names {
            command.args(["--test", name]);
        }
        command.args(["--", "--ignored"]).args(flags);
        command
    };
    table.step("the image that is flashed, on an emulated chip", || {
        image::run_rows(root, &[])
    })?;
    table.step("sessions that are killed", || {
        run(&mut ignored(
            &["capture"],
            &["--nocapture", "--test-threads", "1"],
        ))
    })?;
    if install("qemu-system-arm", "qemu-system-arm") {
        table.step("firmware in QEMU", || {
            let elf = boards::qemu_elf(root)?;
            run(ignored(&["controllers_qemu"], &["--nocapture"]).env("GONIA_QEMU_ELF", elf))
        })?;
    } else {
        let why = "qemu-system-arm is missing: apt-get install qemu-system-arm";
        table.not_run("firmware in QEMU", why);
    }
    if install("chromium", "chromium") {
        table.step("report and live page in a browser", || {
            run(ignored(&["browser", "browser_live"], &[]).env("GONIA_BROWSER", "chromium"))
        })?;
    } else {
        let why = "chromium is missing: apt-get install chromium";
        table.not_run("report and live page in a browser", why);
    }
    run_in_python(table, root)?;
    run_fuzzers(table, root, FUZZ_BRIEFLY_S)
}

/// The Python package, and other programs that read what gonia exports: where their packages can be had.
fn run_in_python(table: &mut Table, root: &Path) -> Result<()> {
    type Check = fn(&Path, &Path) -> Result<()>;
    let checks: [(&str, Result<PathBuf>, Check); 2] = [
        (
            "the Python package",
            python::python(root),
            python::check_with,
        ),
        (
            "exports, read by others",
            readers::python(root),
            readers::check_with,
        ),
    ];
    for (name, python, check) in checks {
        match python {
            Ok(python) => table.step(name, || check(root, &python))?,
            Err(error) => table.not_run(name, &format!("{error:#}")),
        }
    }
    Ok(())
}

/// Seconds that the fuzzer has for a target by itself, and among all tests.
const FUZZ_S: u32 = 60;
const FUZZ_BRIEFLY_S: u32 = 5;

/// Runs every fuzz target of the protocol for a while.
pub fn fuzz() -> Result<()> {
    let (mut table, root) = (Table::default(), root()?);
    if fuzz::missing().is_none() {
        table.step("build of the fuzzers", || fuzz::build(&root))?;
    }
    run_fuzzers(&mut table, &root, FUZZ_S)?;
    table.print();
    Ok(())
}

/// Says so where the fuzzer cannot run.
fn run_fuzzers(table: &mut Table, root: &Path, seconds: u32) -> Result<()> {
    if let Some(why) = fuzz::missing() {
        table.not_run("fuzzing", why);
        return Ok(());
    }
    for target in fuzz::TARGETS {
        table.step(&format!("fuzz {target}"), || {
            fuzz::run_target(root, target, seconds)
        })?;
    }
    Ok(())
}

/// Lints for both other systems.
pub fn systems() -> Result<()> {
    let mut table = Table::default();
    systems::check(&mut table, &root()?, &[systems::WINDOWS, systems::MACOS])?;
    table.print();
    Ok(())
}
