//! What moves when the processor does not.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    ControllerState, Message, RequestOutcome, RequestRefusal, ResetReason, Setting,
};
use gonia_protocol::settings::{Axis, Key};

use super::motion::under_way;
use super::{Outcome, done, started};
use crate::bench::Command;
use crate::chips::lock;
use crate::rig::Rig;

/// Pulses end so long after the processor has stopped, ns: TIM8's 10 ms and a count of it.
const LAST_PULSE_NS: u64 = 10_200_000;
/// The chain is open so long after that: the relay's contact.
const CHAIN_OPEN_US: u64 = 20_000;
/// The watchdog's clock may be slow: 100 ms by 32 kHz are 188 ms by 17 kHz.
const RESET_NS: u64 = 190_000_000;
/// So long a stopped chip is watched after that.
const AFTERWARDS_US: u64 = 300_000;
/// A register that the step timers' interrupt reads: TIM5_SR.
const TIM5_SR: u64 = 0x4000_0C10;

/// Steps after a moment, and how long after it the last one came, ns.
fn steps_since(rig: &Rig, since_us: u64, before: [u64; 2]) -> (u64, u64) {
    let world = lock(&rig.world);
    let after = world.edges();
    let last_ns = world.axes.iter().map(|axis| axis.last_ns).max();
    let steps = (0..2).map(|i| after[i] - before[i]).sum();
    (steps, last_ns.unwrap_or(0).saturating_sub(since_us * 1000))
}

/// How long after a moment the brakes have engaged, while the drivers still had their current, ns.
fn engaged_after_ns(rig: &Rig, since_ns: u64) -> Result<u64> {
    let power = lock(&rig.world).power.clone();
    let engaged = power.iter().find(|&&(at, ..)| at >= since_ns);
    let &(at, enabled, released) = engaged.context("brakes and drivers stay as they are")?;
    ensure!(
        enabled && !released,
        "drivers on: {enabled}, brakes let go: {released}"
    );
    Ok(at - since_ns)
}

pub fn processor_stops(elf: &Path) -> Result<Outcome> {
    let (mut rig, _) = under_way(elf)?;
    let (at_us, before) = (rig.now_us(), lock(&rig.world).edges());
    rig.act(Command::HoldCore(true))?;
    rig.run_us(CHAIN_OPEN_US)?;
    ensure!(
        !lock(&rig.world).chain_is_closed(),
        "the chain is still closed {} ms later",
        CHAIN_OPEN_US / 1000
    );
    rig.run_us(AFTERWARDS_US)?;
    let (steps, last_ns) = steps_since(&rig, at_us, before);
    let reset = lock(&rig.world).resets.first().cloned();
    ensure!(
        last_ns <= LAST_PULSE_NS,
        "{steps} steps, the last {} ms later, and more to come; reset: {reset:?}",
        last_ns / 1_000_000
    );
    let (reset_ns, cause) = reset.context("the watchdog did not restart the chip")?;
    let engaged_ns = match rig.board.brakes {
        Some(_) => engaged_after_ns(&rig, at_us * 1000)?,
        None => 0,
    };
    ensure!(
        engaged_ns <= LAST_PULSE_NS,
        "the brakes have engaged {} ms later",
        engaged_ns / 1_000_000
    );
    let reset_ns = reset_ns - at_us * 1000;
    ensure!(
        reset_ns <= RESET_NS,
        "{cause} restarted the chip {} ms later",
        reset_ns / 1_000_000
    );
    rig.act(Command::HoldCore(false))?;
    let identity = rig.run_us(100_000).and_then(|()| rig.hello(8))?;
    ensure!(
        identity.reset == ResetReason::Watchdog,
        "it says {:?}",
        identity.reset
    );
    let figure = format!(
        "{steps} steps, the last {:.1} ms later; brakes after {:.1} ms, reset after {} ms",
        last_ns as f64 * 1e-6,
        engaged_ns as f64 * 1e-6,
        reset_ns / 1_000_000
    );
    done(rig, figure)
}

pub fn hard_fault(elf: &Path) -> Result<Outcome> {
    let (mut rig, _) = under_way(elf)?;
    let (at_us, before) = (rig.now_us(), lock(&rig.world).edges());
    rig.act(Command::Fail(TIM5_SR))?;
    // The handler waits for the brakes, twice.
    rig.run_us(1_000_000)?;
    let (steps, last_ns) = steps_since(&rig, at_us, before);
    ensure!(
        last_ns < 1_000_000,
        "{steps} steps, the last {} ms later",
        last_ns / 1_000_000
    );
    let resets = lock(&rig.world).resets.clone();
    ensure!(!resets.is_empty(), "the chip did not restart");
    let identity = rig.hello(8)?;
    ensure!(
        identity.reset == ResetReason::Software && identity.last_panic.contains("hard fault"),
        "it says {:?}, {:?}",
        identity.reset,
        identity.last_panic
    );
    let figure = format!("{steps} steps after it; reset, {:?}", identity.last_panic);
    done(rig, figure)
}

pub fn reset_in_mid_move(elf: &Path) -> Result<Outcome> {
    let (mut rig, _) = under_way(elf)?;
    let (at_us, before) = (rig.now_us(), lock(&rig.world).edges());
    // In reset, and before the program has done anything.
    rig.act(Command::HoldCore(true))?;
    rig.act(Command::Reset)?;
    rig.run_us(15_000)?;
    let (steps, _) = steps_since(&rig, at_us, before);
    {
        let world = lock(&rig.world);
        ensure!(steps == 0, "{steps} steps in reset");
        ensure!(!world.drivers_are_on(), "the drivers have current in reset");
        ensure!(!world.chain_is_closed(), "the chain is closed in reset");
    }
    rig.act(Command::HoldCore(false))?;
    rig.run_us(100_000)?;
    let identity = rig.hello(8)?;
    ensure!(
        identity.reset == ResetReason::Pin,
        "it says {:?}",
        identity.reset
    );
    let status = rig.status()?;
    ensure!(!status.homed, "it takes itself for homed");
    done(
        rig,
        "no step, no current, chain open; unhomed after it".into(),
    )
}

pub fn emergency_stop(elf: &Path) -> Result<Outcome> {
    let (mut rig, _) = under_way(elf)?;
    rig.begin(&Message::EStop)?;
    let before = lock(&rig.world).edges();
    rig.run_us(15_000)?;
    ensure!(lock(&rig.world).edges() == before, "steps go on");
    ensure!(!lock(&rig.world).chain_is_closed(), "the chain is closed");
    rig.run_us(100_000)?;
    let asked_us = rig.now_us();
    rig.begin(&Message::ClearFault)?;
    let took_us = rig.now_us() - asked_us;
    ensure!(lock(&rig.world).chain_is_closed(), "the chain is open");
    let state = rig.status()?.state;
    ensure!(state == ControllerState::Unhomed, "it is in {state:?}");
    done(rig, format!("chain open; cleared in {} ms", took_us / 1000))
}

pub fn chain_cut(elf: &Path) -> Result<Outcome> {
    let (mut rig, _) = under_way(elf)?;
    lock(&rig.world).chain_is_cut = true;
    let at_us = rig.now_us();
    let before = lock(&rig.world).edges();
    rig.run_us(200_000)?;
    let (steps, last_ns) = steps_since(&rig, at_us, before);
    ensure!(last_ns < 4_000_000, "steps for {} ms", last_ns / 1_000_000);
    let refusal = rig.refusal(&Message::ClearFault)?;
    ensure!(
        matches!(refusal, RequestRefusal::CauseRemains(_)),
        "{refusal:?}"
    );
    lock(&rig.world).chain_is_cut = false;
    rig.run_us(50_000)?;
    rig.begin(&Message::ClearFault)?;
    rig.complete(&Message::Home, 60_000_000)?;
    let figure = format!(
        "{steps} steps within {:.1} ms; homed again",
        last_ns as f64 * 1e-6
    );
    done(rig, figure)
}

/// θ's driver reports an alarm in mid-move, on an arm with brakes.
pub fn driver_alarm(elf: &Path) -> Result<Outcome> {
    const BRAKE_US: u64 = 50_000;
    let mut rig = started(elf)?;
    if rig.board.alarms.is_none() || rig.board.brakes.is_none() {
        return done(rig, "the board has none".into());
    }
    let mut set = |axis, key: Key, value| {
        let key = key.number();
        rig.ask(&Message::SetSetting(Setting { axis, key, value }))
    };
    set(Axis::Theta, Key::DriverAlarm, 1)?;
    set(Axis::Theta, Key::BrakeTime, BRAKE_US as i32)?;
    let id = rig.begin(&Message::Home)?;
    rig.run_us(600_000)?;
    let at_us = rig.now_us();
    lock(&rig.world).axes[0].alarm_closed = false;
    let outcome = rig.outcome(id, 1_000_000)?;
    let expected = RequestOutcome::Failed(FaultCode::DRIVER_ALARM);
    ensure!(outcome == expected, "it ended as {outcome:?}");
    rig.run_us(200_000)?;
    let engaged_ns = engaged_after_ns(&rig, at_us * 1000)?;
    let last = lock(&rig.world).power.last().copied();
    let (off_ns, enabled, _) = last.context("brakes and drivers stay as they are")?;
    let off_ns = off_ns - at_us * 1000;
    ensure!(!enabled, "the drivers keep their current");
    ensure!(
        off_ns >= engaged_ns + BRAKE_US * 1000,
        "drivers off {} ms after the brakes",
        (off_ns - engaged_ns) / 1_000_000
    );
    let refusal = rig.refusal(&Message::ClearFault)?;
    let expected = RequestRefusal::CauseRemains(FaultCode::DRIVER_ALARM);
    ensure!(refusal == expected, "{refusal:?}");
    lock(&rig.world).axes[0].alarm_closed = true;
    rig.run_us(50_000)?;
    rig.begin(&Message::ClearFault)?;
    // The way home begins while the brakes still hold.
    rig.begin(&Message::Home)?;
    let before = lock(&rig.world).edges();
    rig.run_us(300_000)?;
    let steps: u64 = lock(&rig.world).edges().iter().sum();
    let unheard: u64 = lock(&rig.world).axes.iter().map(|axis| axis.unheard).sum();
    ensure!(
        steps > before.iter().sum() && unheard == 0,
        "{unheard} of {steps} steps against the brakes"
    );
    let figure = format!(
        "brakes after {:.1} ms, drivers off after {:.1} ms; no step before they are back",
        engaged_ns as f64 * 1e-6,
        off_ns as f64 * 1e-6
    );
    done(rig, figure)
}
