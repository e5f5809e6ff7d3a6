//! Motors' drivers that are set by wire.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use gonia_firmware::driver::DriverBus;
use gonia_firmware::driver::registers::{CHOPCONF, GCONF, GLOBAL_SCALER, IHOLD_IRUN};
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, LogEntry, Message, Setting};
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::driver_chip::{DriverChip, DriverTrouble};

use super::{Outcome, done, started};
use crate::chips::lock;
use crate::one_wire::OneWire;
use crate::rig::Rig;

/// A setup of both drivers on the one wire takes less: 26 exchanges of 16 ms, each found at the next tick of 2.
const SETUP_US: u64 = 600_000;
/// Three exchanges after a second at rest, or as many tries of one.
const LOOK_US: u64 = 1_400_000;
/// From rest to full speed and a while at it, with looks every quarter of a second.
const TURNING_US: u64 = 1_000_000;

fn set(rig: &mut Rig, axis: Axis, key: Key, value: i32) -> Result<()> {
    let key = key.number();
    match rig
        .ask(&Message::SetSetting(Setting { axis, key, value }))?
        .1
    {
        Message::SettingIs(_) => Ok(()),
        other => bail!("a setting was answered by {other:?}"),
    }
}

/// An image with such drivers on its pins, and settings that say so: φ's with 1 A and 16 microsteps, but as many
/// steps a turn, so that nothing else changes.
fn with_drivers(elf: &Path, bus: DriverBus) -> Result<Rig> {
    let mut rig = started(elf)?;
    for axis in &mut lock(&rig.world).axes {
        axis.driver = Some(OneWire::new(DriverChip::new(bus, 0)));
    }
    let kind = match bus {
        DriverBus::OneWire => 1,
        DriverBus::Spi => 2,
    };
    set(&mut rig, Axis::Phi, Key::RunCurrent, 1_000)?;
    set(&mut rig, Axis::Phi, Key::Microsteps, 16)?;
    for axis in Axis::BOTH {
        set(&mut rig, axis, Key::DriverKind, kind)?;
    }
    Ok(rig)
}

/// Settings arrive in the chips, and are watched while both axes turn; then one thing after the other goes wrong with
/// φ's driver, and is mended.
fn set_and_watched(elf: &Path, bus: DriverBus, troubles: &[Trouble]) -> Result<Outcome> {
    let mut rig = with_drivers(elf, bus)?;
    run_until(&mut rig, SETUP_US, |rig| {
        Ok(check_registers(rig, bus).is_ok())
    })?;
    check_registers(&rig, bus)?;
    let requests = said(&rig)?;
    let before = lock(&rig.world).edges();
    let id = rig.begin(&Message::Home)?;
    let outcome = rig.outcome(id, TURNING_US);
    ensure!(outcome.is_err(), "homing ended as {outcome:?}");
    let now = lock(&rig.world).edges();
    ensure!(
        (0..2).all(|i| now[i] > before[i] + 500),
        "{before:?} steps, then {now:?}"
    );
    ensure!(
        said(&rig)? > requests,
        "nothing was said while the motors turned"
    );
    let (bad, worst, bit_ns) = on_the_wire(&rig)?;
    ensure!(
        bad == 0,
        "{bad} edges too far from their bits, or bytes without an end"
    );
    rig.begin(&Message::Stop)?;
    rig.outcome(id, 1_000_000)?;
    warm(&mut rig)?;
    for &trouble in troubles {
        strike(&mut rig, bus, trouble)?;
    }
    check_registers(&rig, bus)?;
    let said = said(&rig)?;
    let figure = match bus {
        DriverBus::OneWire => format!(
            "{said} requests at {:.0} baud, edges within {:.1} % of a bit",
            1e9 / bit_ns as f64,
            100.0 * worst
        ),
        DriverBus::Spi => format!("{said} datagrams"),
    };
    let troubles = troubles.len();
    done(
        rig,
        format!("{figure}, also while both axes turn; {troubles} faults found and got rid of"),
    )
}

/// Requests or datagrams that the chips have read.
fn said(rig: &Rig) -> Result<u32> {
    let world = lock(&rig.world);
    let said = world.axes.iter().map(|axis| {
        let wire = axis.driver.as_ref()?;
        Some(wire.requests + axis.datagrams)
    });
    said.sum::<Option<u32>>().context("no driver")
}

/// On the one wire: edges that are too far off, how far the furthest is, and what a bit lasts, ns.
fn on_the_wire(rig: &Rig) -> Result<(u32, f64, u64)> {
    let world = lock(&rig.world);
    let wires: Option<Vec<&OneWire>> = world.axes.iter().map(|axis| axis.driver.as_ref()).collect();
    let wires = wires.context("no driver")?;
    Ok((
        wires.iter().map(|wire| wire.bad_edges).sum(),
        wires.iter().map(|wire| wire.worst_edge).fold(0.0, f64::max),
        wires[0].bit_ns,
    ))
}

/// What the chips hold, by the data sheets' tables: currents at 110 mΩ, microsteps, SpreadCycle.
fn check_registers(rig: &Rig, bus: DriverBus) -> Result<()> {
    let world = lock(&rig.world);
    let expected: [&[(u8, u32, u32)]; 2] = match bus {
        DriverBus::OneWire => [
            &[
                (GCONF, !0, 0x1C4),
                (IHOLD_IRUN, 0x1F1F, 25 << 8 | 12),
                (CHOPCONF, !0, 0x1503_00C3),
            ],
            // 1 A at 130 mΩ is 184 mV: the coarser range, 18.1 parts of 32.
            &[
                (GCONF, !0, 0x1C4),
                (IHOLD_IRUN, 0x1F1F, 17 << 8 | 6),
                (CHOPCONF, !0, 0x1401_00C3),
            ],
        ],
        DriverBus::Spi => [
            &[
                (GCONF, !0, 8),
                (IHOLD_IRUN, 0x1F1F, 23 << 8 | 11),
                (CHOPCONF, !0, 0x1501_00C3),
                (GLOBAL_SCALER, !0, 128),
            ],
            &[
                (GCONF, !0, 8),
                (IHOLD_IRUN, 0x1F1F, 29 << 8 | 11),
                (CHOPCONF, !0, 0x1401_00C3),
                (GLOBAL_SCALER, !0, 128),
            ],
        ],
    };
    for (axis, expected) in world.axes.iter().zip(expected) {
        let chip = &axis.driver.as_ref().context("no driver")?.chip;
        for &(register, mask, value) in expected {
            let is = chip.written(register) & mask;
            ensure!(
                is == value,
                "register {register:#04x} holds {is:#x} where {value:#x} was to be"
            );
        }
    }
    Ok(())
}

/// What goes wrong, and the fault that it is.
type Trouble = (fn(&mut DriverChip), FaultCode);

const RESET: Trouble = (DriverChip::reset, FaultCode::DRIVER_RESET);
const SILENT: Trouble = (
    |chip| chip.trouble = DriverTrouble::Silent,
    FaultCode::DRIVER_SILENT,
);
const TOO_HOT: Trouble = (
    |chip| chip.condition.is_too_hot = true,
    FaultCode::DRIVER_TOO_HOT,
);
const SHORTED: Trouble = (
    |chip| chip.condition.is_shorted = true,
    FaultCode::DRIVER_SHORT,
);

pub fn by_uart(elf: &Path) -> Result<Outcome> {
    set_and_watched(elf, DriverBus::OneWire, &[RESET, SILENT, TOO_HOT])
}

pub fn by_spi(elf: &Path) -> Result<Outcome> {
    set_and_watched(elf, DriverBus::Spi, &[RESET, SILENT, TOO_HOT, SHORTED])
}

/// φ's driver is warm, which is logged, and no more.
fn warm(rig: &mut Rig) -> Result<()> {
    chip(rig, |chip| chip.condition.is_warm = true)?;
    rig.run_us(LOOK_US)?;
    let state = rig.status()?.state;
    ensure!(
        state == ControllerState::Unhomed,
        "warm, it is in {state:?}"
    );
    let Message::LogIs(LogEntry { fault, axis, .. }) = rig.ask(&Message::ReadLog(0))?.1 else {
        bail!("no log");
    };
    ensure!(
        (fault, axis) == (Some(FaultCode::DRIVER_WARM), Some(Axis::Phi)),
        "warm, the log says {fault:?}"
    );
    Ok(())
}

/// One trouble: its fault, no current; mended and cleared, the settings are written again.
fn strike(rig: &mut Rig, bus: DriverBus, (strike, code): Trouble) -> Result<()> {
    chip(rig, strike)?;
    let expected = ControllerState::Fault(code);
    run_until(rig, LOOK_US, |rig| Ok(rig.status()?.state == expected))
        .with_context(|| format!("{code}: not found"))?;
    ensure!(
        !lock(&rig.world).drivers_are_on(),
        "{code}: the drivers keep their current"
    );
    chip(rig, |chip| *chip = DriverChip::new(bus, 0))?;
    rig.begin(&Message::ClearFault)?;
    run_until(rig, SETUP_US, |rig| Ok(lock(&rig.world).drivers_are_on()))
        .with_context(|| format!("{code}: no current after it is cleared"))
}

fn run_until(rig: &mut Rig, limit_us: u64, is_so: impl Fn(&mut Rig) -> Result<bool>) -> Result<()> {
    let until_us = rig.now_us() + limit_us;
    while rig.now_us() < until_us {
        if is_so(rig)? {
            return Ok(());
        }
        rig.run_us(50_000)?;
    }
    bail!("not within {} ms", limit_us / 1000)
}

fn chip(rig: &Rig, change: impl FnOnce(&mut DriverChip)) -> Result<()> {
    let mut world = lock(&rig.world);
    let wire = world.axes[1].driver.as_mut().context("no driver")?;
    change(&mut wire.chip);
    Ok(())
}
