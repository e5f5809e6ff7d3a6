//! Settings: checked, saved, and what becomes of them when the power goes.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use gonia_firmware::store::RECORD_MAX;
use gonia_pins::check::sector_len;
use gonia_protocol::message::{ControllerState, Message, RequestRefusal, Setting, SettingName};
use gonia_protocol::settings::{Axis, Key};

use super::{Outcome, done, started};
use crate::bench::Command;
use crate::chips::lock;
use crate::rig::Rig;

/// Records that a sector of the board's settings holds.
fn slots(rig: &Rig) -> Result<i32> {
    let at = rig.board.layout.settings[0];
    let len = sector_len(at).context("the settings lie in no sector")?;
    Ok(len as i32 / RECORD_MAX as i32)
}

fn set(rig: &mut Rig, key: Key, value: i32) -> Result<Message> {
    let key = key.number();
    let axis = Axis::Theta;
    Ok(rig
        .ask(&Message::SetSetting(Setting { axis, key, value }))?
        .1)
}

fn get(rig: &mut Rig, key: Key) -> Result<i32> {
    let key = key.number();
    let axis = Axis::Theta;
    match rig.ask(&Message::GetSetting(SettingName { axis, key }))?.1 {
        Message::SettingIs(setting) => Ok(setting.value),
        other => bail!("a setting was answered by {other:?}"),
    }
}

fn restart(rig: &mut Rig, session: u32) -> Result<()> {
    rig.act(Command::Reset)?;
    rig.run_us(100_000)?;
    rig.hello(session)?;
    Ok(())
}

/// How far the chip's clock is behind the bench's, µs.
fn behind_us(rig: &mut Rig) -> Result<i64> {
    let chip_us = rig.status()?.time_us;
    Ok(rig.now_us() as i64 - chip_us as i64)
}

pub fn saved(elf: &Path) -> Result<Outcome> {
    let mut rig = started(elf)?;
    let before_us = behind_us(&mut rig)?;
    set(&mut rig, Key::Telemetry, 123_456)?;
    let asked_us = rig.now_us();
    rig.begin(&Message::SaveSettings)?;
    let first_us = rig.now_us() - asked_us;
    let lost_us = behind_us(&mut rig)? - before_us;
    ensure!(
        lost_us.abs() < 2_000,
        "the chip's clock has lost {lost_us} µs"
    );
    for i in 0..4 {
        set(&mut rig, Key::Telemetry, 200_000 + i)?;
        rig.begin(&Message::SaveSettings)?;
    }
    let erases = lock(&rig.world).erases;
    ensure!(erases <= 1, "{erases} erases for five saves");
    restart(&mut rig, 8)?;
    let telemetry = get(&mut rig, Key::Telemetry)?;
    ensure!(telemetry == 200_003, "{telemetry} came back");
    let resets = lock(&rig.world).resets.len();
    ensure!(resets == 1, "{resets} resets where one was asked for");
    let figure = format!(
        "the first in {} ms with its erase, five in {erases} erase; the clock keeps its time",
        first_us / 1000
    );
    done(rig, figure)
}

pub fn power_lost_in_an_erase(elf: &Path) -> Result<Outcome> {
    let mut rig = started(elf)?;
    let slots = slots(&rig)?;
    for i in 0..slots {
        set(&mut rig, Key::Telemetry, 300_000 + i)?;
        rig.begin(&Message::SaveSettings)?;
    }
    let erases = lock(&rig.world).erases;
    ensure!(erases == 1, "{erases} erases for {slots} saves");
    // The next one erases the other sector.
    set(&mut rig, Key::Telemetry, 999_999)?;
    rig.send(&Message::SaveSettings)?;
    rig.run_us(100_000)?;
    ensure!(lock(&rig.world).erases == 2, "no erase is under way");
    restart(&mut rig, 8)?;
    let telemetry = get(&mut rig, Key::Telemetry)?;
    ensure!(telemetry == 300_000 + slots - 1, "{telemetry} came back");
    let state = rig.status()?.state;
    ensure!(state == ControllerState::Unhomed, "it is in {state:?}");
    done(
        rig,
        format!("the old ones are there; {erases} erase for {slots} saves"),
    )
}

pub fn refused(elf: &Path) -> Result<Outcome> {
    let mut rig = started(elf)?;
    // 4.6 million steps a turn at 15°/s are 192,000 steps/s; no ring has a count more than a power of two.
    for (key, value) in [
        (Key::StepsPerTurn, 4_600_000),
        (Key::EncoderCountsPerTurn, (1 << 18) + 1),
    ] {
        match set(&mut rig, key, value)? {
            Message::Refused(RequestRefusal::Value) => {}
            other => bail!("{key:?} = {value} was answered by {other:?}"),
        }
    }
    done(rig, "refused".into())
}
