//! Runs the image that is flashed: on an emulated chip, with the simulated arm on its pins and the host's
//! link on its UART. `cargo xtask image` builds the image and calls this.

mod bench;
mod chips;
mod nvic;
mod one_wire;
mod part;
mod reference;
mod rig;
mod rows;
mod world;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use gonia_pins::boards::NUCLEO_F446RE;

use crate::rows::When;

const USAGE: &str = "gonia-image ELF [--all | NAME]";

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1);
    let Some(elf) = arguments.next().map(PathBuf::from) else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    // An image of no board fails in its first row, with a word about it.
    let is_first = rig::board_of(&elf).is_ok_and(|board| board.name == NUCLEO_F446RE.name);
    let wanted = arguments.next().and_then(|word| word.into_string().ok());
    let rows = rows::ROWS.iter().filter(|row| match wanted.as_deref() {
        None => match row.when {
            When::EveryBoard => true,
            When::OneBoard => is_first,
            When::OtherBoards => !is_first,
            When::Asked => false,
        },
        Some("--all") => true,
        Some(name) => row.name.contains(name),
    });
    let (mut failed, mut virtual_us, began) = (0, 0, Instant::now());
    for row in rows {
        let row_began = Instant::now();
        match (row.run)(&elf) {
            Ok(outcome) => {
                virtual_us += outcome.virtual_us;
                let (figure, s) = (outcome.figure, row_began.elapsed().as_secs_f64());
                println!("ok    {:<34} {figure} ({s:.1} s)", row.name);
            }
            Err(error) => {
                failed += 1;
                println!("FAIL  {:<34} {error:#}", row.name);
            }
        }
    }
    let rate = virtual_us as f64 * 1e-6 / began.elapsed().as_secs_f64();
    println!("{rate:.2} virtual seconds a second; {failed} failed");
    if failed == 0 {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
