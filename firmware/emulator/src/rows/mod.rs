//! What is tried, row by row. Each starts a chip of its own.

mod drivers;
mod edges;
mod motion;
mod quadrature;
mod registers;
mod safety;
mod settings;
mod trigger;

use std::path::Path;

use anyhow::{Result, bail, ensure};
use gonia_protocol::message::{ControllerState, ResetReason};

use crate::chips::lock;
use crate::rig::Rig;

/// A row: what it is called, what it does, whether it is among the essential ones.
pub struct Row {
    /// What it is called.
    pub name: &'static str,
    /// Runs it: a figure to print, or why it failed.
    pub run: fn(&Path) -> Result<Outcome>,
    /// When it is run without being asked for.
    pub when: When,
}

/// Which boards a row is run for without being asked for; `--all` runs every row for every board.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum When {
    /// Every one: it depends on pins, flash layout or what makes the steps.
    EveryBoard,
    /// The first: what it shows is the same on all.
    OneBoard,
    /// Every other one: the first shows something like it.
    OtherBoards,
    /// None.
    Asked,
}

/// What a row has measured.
pub struct Outcome {
    /// In words.
    pub figure: String,
    /// Virtual time that passed, µs.
    pub virtual_us: u64,
}

/// Every row.
pub const ROWS: &[Row] = {
    use When::{Asked, EveryBoard, OneBoard, OtherBoards};
    &[
        row("boot, registers by the manual", EveryBoard, boot),
        row("homing, a pose, trigger pulses", EveryBoard, motion::a_pose),
        row(
            "processor stopped in mid-move",
            EveryBoard,
            safety::processor_stops,
        ),
        row("drivers set by UART", OtherBoards, drivers::by_uart),
        row("drivers set by SPI", Asked, drivers::by_spi),
        row("hard fault in mid-move", OneBoard, safety::hard_fault),
        row("reset in mid-move", Asked, safety::reset_in_mid_move),
        row("emergency stop and clear", OneBoard, safety::emergency_stop),
        row(
            "settings saved, read after reset",
            OneBoard,
            settings::saved,
        ),
        row("settings that nothing can do", Asked, settings::refused),
        row(
            "power lost in an erase",
            Asked,
            settings::power_lost_in_an_erase,
        ),
        row("chain cut in mid-move", Asked, safety::chain_cut),
        row("encoder lost in mid-move", Asked, motion::encoder_lost),
        row("motor stalls in mid-move", Asked, motion::stall),
        row("motor stalls in a stop", Asked, motion::stall_in_a_stop),
        row("host gone in mid-move", Asked, motion::host_gone),
        row("cam of every turn on two turns", Asked, motion::turn_cam),
        row("home switch cut", Asked, motion::home_switch_cut),
        row("BiSS-C rings", Asked, motion::biss_rings),
        row(
            "BiSS-C bit flipped in mid-move",
            Asked,
            motion::biss_bit_flips,
        ),
        row("homing by BiSS-C", Asked, motion::homing_by_biss),
        row(
            "quadrature ring loses an edge",
            OneBoard,
            quadrature::lost_edge,
        ),
        row(
            "quadrature rings: homing, poses, faults",
            Asked,
            quadrature::homing_and_faults,
        ),
        row("quadrature rings: 50 poses", Asked, quadrature::fifty_poses),
        row("driver's alarm and brakes", Asked, safety::driver_alarm),
        row("reversed motor and encoder", Asked, motion::reversed),
        row("homing and 50 poses", Asked, motion::fifty_poses),
    ]
};

const fn row(name: &'static str, when: When, run: fn(&Path) -> Result<Outcome>) -> Row {
    Row { name, run, when }
}

/// A chip that has started.
fn started(elf: &Path) -> Result<Rig> {
    let mut rig = Rig::power_on(elf)?;
    rig.run_us(100_000)?;
    rig.hello(7)?;
    Ok(rig)
}

fn done(rig: Rig, figure: String) -> Result<Outcome> {
    let virtual_us = rig.now_us();
    let gaps = rig.end()?;
    // What the emulator could not stand in for, apart from the F446's own register of clocks.
    let strange: Vec<String> = gaps.into_iter().filter(|gap| !is_known(gap)).collect();
    if !strange.is_empty() {
        bail!("the emulator cannot stand in for: {}", strange.join("; "));
    }
    Ok(Outcome { figure, virtual_us })
}

/// Gaps that say nothing about this image: RCC_DCKCFGR2 is the F446's alone, and flash is programmed by
/// the bench.
fn is_known(gap: &str) -> bool {
    gap.contains("at=0x40023894") || gap.contains("at=0x080")
}

fn boot(elf: &Path) -> Result<Outcome> {
    let mut rig = Rig::power_on(elf)?;
    rig.run_us(100_000)?;
    let identity = rig.hello(7)?;
    ensure!(
        identity.reset == ResetReason::PowerOn,
        "it says {:?}",
        identity.reset
    );
    let state = rig.status()?.state;
    ensure!(
        state == ControllerState::Unhomed,
        "it is in {state:?} after the start"
    );
    ensure!(
        identity.board.as_str() == rig.board.name,
        "it says that it is a {}",
        identity.board
    );
    let byte_ns = lock(&rig.world).wire.byte_ns.unwrap_or(0);
    let baud = 1e10 / byte_ns.max(1) as f64;
    let registers = registers::as_the_manual_says(&mut rig)?;
    done(
        rig,
        format!("{}, {baud:.0} baud; {registers}", identity.board),
    )
}
