//! Homing, poses, and what goes wrong on the way.

use std::path::Path;

use anyhow::{Result, ensure};
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, Message, Move, RequestOutcome, Setting};
use gonia_protocol::settings::{Axis, Key};
use gonia_sim::plant::HomeCam;

use super::{Outcome, done, edges, started, trigger};
use crate::chips::lock;
use crate::reference::Reference;
use crate::rig::Rig;
use crate::world::RingKind;

/// The pointing limit, degrees.
pub const POINTING_DEG: f64 = 0.03;
/// A move takes less, µs.
pub const MOVE_US: u64 = 60_000_000;

pub fn a_pose(elf: &Path) -> Result<Outcome> {
    let (mut rig, poses) = poses(elf, 1)?;
    let edges = edges::on_time(&rig)?;
    let train = trigger::train(&mut rig)?;
    let followed = trigger::follows(&mut rig)?;
    done(rig, format!("{poses}; {edges}; {train}; {followed}"))
}

pub fn fifty_poses(elf: &Path) -> Result<Outcome> {
    let (rig, poses) = poses(elf, 50)?;
    done(rig, poses)
}

/// How far chip and simulator may be apart, steps: homing looks at its switch every 2 ms, in which the slow
/// approach makes 0.4 steps, and the two do not look at the same time.
const APART: i64 = 1;

/// Poses all over a part of the travel, the same on chip and simulator.
fn poses(elf: &Path, count: i32) -> Result<(Rig, String)> {
    let (mut rig, mut reference) = (started(elf)?, Reference::new());
    rig.complete(&Message::Home, MOVE_US)?;
    let (mut worst_deg, mut apart) = (0.0f64, 0);
    let mut compare = |rig: &Rig, steps: [i64; 2]| {
        let world = lock(&rig.world);
        for (axis, steps) in world.axes.iter().zip(steps) {
            apart = apart.max((axis.given - steps).abs());
        }
    };
    let steps = reference.complete(&Message::Home)?;
    compare(&rig, steps);
    for i in 0..count {
        let target = [
            (i * 7_300_000) % 20_000_000,
            -180_000_000 + (i * 11_100_000) % 30_000_000,
        ];
        let to = Message::Move(Move {
            target_udeg: target,
        });
        rig.complete(&to, MOVE_US)?;
        let steps = reference.complete(&to)?;
        compare(&rig, steps);
        let is = lock(&rig.world).true_deg();
        for axis in 0..2 {
            worst_deg = worst_deg.max((is[axis] - f64::from(target[axis]) * 1e-6).abs());
        }
    }
    ensure!(worst_deg < POINTING_DEG, "an axis is {worst_deg:.4}° off");
    ensure!(apart <= APART, "up to {apart} steps from the simulator's");
    let (setup_us, unheard) = {
        let world = lock(&rig.world);
        let setup = world.axes.iter().map(|axis| axis.setup_ns).min();
        let unheard: u64 = world.axes.iter().map(|axis| axis.unheard).sum();
        (setup.unwrap_or(0) / 1000, unheard)
    };
    ensure!(
        unheard == 0,
        "{unheard} steps came before the drivers had current"
    );
    ensure!(
        setup_us >= 5,
        "a step came {setup_us} µs after its direction"
    );
    let figure = format!(
        "{worst_deg:.4}° off at most, {apart} step from the simulator's, direction {setup_us} µs before a step"
    );
    Ok((rig, figure))
}

/// An arm on its way home, φ at full speed of the search (4,000 steps/s), and the request that sent it.
pub fn under_way(elf: &Path) -> Result<(Rig, u16)> {
    let mut rig = started(elf)?;
    let id = rig.begin(&Message::Home)?;
    rig.run_us(600_000)?;
    Ok((rig, id))
}

/// The fault that a request under way ends with, and that is latched then.
fn must_fail(mut rig: Rig, id: u16, expected: FaultCode) -> Result<Outcome> {
    let outcome = rig.outcome(id, 10_000_000)?;
    ensure!(
        outcome == RequestOutcome::Failed(expected) || outcome == RequestOutcome::Stopped,
        "it ended as {outcome:?}"
    );
    let state = rig.status()?.state;
    ensure!(
        state == ControllerState::Fault(expected),
        "it is in {state:?}"
    );
    let before = lock(&rig.world).edges();
    rig.run_us(500_000)?;
    ensure!(lock(&rig.world).edges() == before, "steps go on");
    done(rig, format!("{expected:?}, at rest"))
}

pub fn encoder_lost(elf: &Path) -> Result<Outcome> {
    let (rig, id) = under_way(elf)?;
    let until_us = rig.now_us() + 60_000_000;
    lock(&rig.world).axes[0].plant.lose_encoder_until(until_us);
    must_fail(rig, id, FaultCode::ENCODER_LOST)
}

pub fn stall(elf: &Path) -> Result<Outcome> {
    let (rig, id) = under_way(elf)?;
    let until_us = rig.now_us() + 60_000_000;
    lock(&rig.world).axes[1].plant.stall_until(until_us);
    must_fail(rig, id, FaultCode::FOLLOWING_ERROR)
}

/// The motor stalls while the arm slows down for a stop: the way that is left is longer than the limit.
pub fn stall_in_a_stop(elf: &Path) -> Result<Outcome> {
    let (mut rig, id) = under_way(elf)?;
    rig.begin(&Message::Stop)?;
    let until_us = rig.now_us() + 60_000_000;
    lock(&rig.world).axes[1].plant.stall_until(until_us);
    must_fail(rig, id, FaultCode::FOLLOWING_ERROR)
}

/// θ wired the other way round, motor and encoder, and the settings that say so. (Without them homing runs up
/// and fails.)
pub fn reversed(elf: &Path) -> Result<Outcome> {
    let mut rig = Rig::power_on(elf)?;
    lock(&rig.world).axes[0].is_reversed = true;
    rig.run_us(100_000)?;
    rig.hello(7)?;
    let mut set = |key: Key| {
        let (axis, key, value) = (Axis::Theta, key.number(), 1);
        rig.ask(&Message::SetSetting(Setting { axis, key, value }))
    };
    set(Key::MotorReversed)?;
    set(Key::EncoderReversed)?;
    rig.complete(&Message::Home, MOVE_US)?;
    let target_udeg = [12_000_000, -170_000_000];
    rig.complete(&Message::Move(Move { target_udeg }), MOVE_US)?;
    let is = lock(&rig.world).true_deg();
    ensure!((is[0] - 12.0).abs() < POINTING_DEG, "θ is at {:.3}°", is[0]);
    done(rig, format!("homes, and stands at {:.3}°", is[0]))
}

pub fn host_gone(elf: &Path) -> Result<Outcome> {
    let (mut rig, _) = under_way(elf)?;
    rig.run_us(3_000_000)?;
    let before = lock(&rig.world).edges();
    rig.run_us(500_000)?;
    ensure!(lock(&rig.world).edges() == before, "steps go on");
    let state = rig.status()?.state;
    let expected = ControllerState::Fault(FaultCode::HOST_WATCHDOG);
    ensure!(state == expected, "it is in {state:?}");
    done(rig, "decelerated, at rest".into())
}

/// φ, which travels two turns, has a cam that works its home switch once a turn.
pub fn turn_cam(elf: &Path) -> Result<Outcome> {
    let mut rig = Rig::power_on(elf)?;
    lock(&rig.world).axes[1].rebuild(|phi| phi.home_cam = HomeCam::EveryTurn { width_udeg: 2e6 });
    rig.run_us(100_000)?;
    rig.hello(7)?;
    let id = rig.begin(&Message::Home)?;
    must_fail(rig, id, FaultCode::HOME_AMBIGUOUS)
}

/// The cable of θ's home switch, which is normally closed.
pub fn home_switch_cut(elf: &Path) -> Result<Outcome> {
    let mut rig = started(elf)?;
    lock(&rig.world).axes[0].plant.cut_switch();
    let id = rig.begin(&Message::Home)?;
    must_fail(rig, id, FaultCode::HOME_SWITCH_STUCK)
}

/// A chip whose rings speak BiSS-C, the second one with a longer acknowledgement.
fn with_biss(elf: &Path) -> Result<Rig> {
    let mut rig = started(elf)?;
    for (i, axis) in Axis::BOTH.into_iter().enumerate() {
        lock(&rig.world).axes[i].ring = RingKind::BissC {
            acknowledgement: 1 + 6 * i,
            flips: None,
        };
        let (key, value) = (Key::EncoderKind.number(), 1);
        rig.ask(&Message::SetSetting(Setting { axis, key, value }))?;
    }
    Ok(rig)
}

/// Both rings are read at rest; then a bit of φ's words flips on the way.
pub fn biss_rings(elf: &Path) -> Result<Outcome> {
    let mut rig = with_biss(elf)?;
    rig.run_us(200_000)?;
    let status = rig.status()?;
    let is = lock(&rig.world).true_deg();
    let off_deg = [0, 1].map(|i| f64::from(status.axes[i].encoder_udeg) * 1e-6 - is[i]);
    ensure!(
        status.state == ControllerState::Unhomed && off_deg.iter().all(|off| off.abs() < 0.01),
        "{:?}, {off_deg:?}° off",
        status.state
    );
    flip_lowest_bit(&rig);
    rig.run_us(200_000)?;
    let state = rig.status()?.state;
    let expected = ControllerState::Fault(FaultCode::ENCODER_LOST);
    ensure!(state == expected, "with a flipped bit it is in {state:?}");
    let figure = format!(
        "read at {:.3}°, {:.3}°; a flipped bit is found",
        is[0], is[1]
    );
    done(rig, figure)
}

/// The lowest bit of φ's position is the wrong way round in every word from now on.
fn flip_lowest_bit(rig: &Rig) {
    // Rest, acknowledgement, start, control data, 17 bits before it.
    let lowest = 2 + 7 + 2 + 17;
    lock(&rig.world).axes[1].ring = RingKind::BissC {
        acknowledgement: 7,
        flips: Some(lowest),
    };
}

pub fn homing_by_biss(elf: &Path) -> Result<Outcome> {
    let mut rig = with_biss(elf)?;
    rig.complete(&Message::Home, MOVE_US)?;
    let target_udeg = [12_000_000, -170_000_000];
    rig.complete(&Message::Move(Move { target_udeg }), MOVE_US)?;
    let is = lock(&rig.world).true_deg();
    let off = [is[0] - 12.0, is[1] + 170.0];
    ensure!(
        off.iter().all(|off| off.abs() < POINTING_DEG),
        "{off:?}° off"
    );
    done(
        rig,
        format!("homes, and stands at {:.3}°, {:.3}°", is[0], is[1]),
    )
}

/// A flipped bit in mid-move.
pub fn biss_bit_flips(elf: &Path) -> Result<Outcome> {
    let mut rig = with_biss(elf)?;
    let id = rig.begin(&Message::Home)?;
    rig.run_us(600_000)?;
    flip_lowest_bit(&rig);
    must_fail(rig, id, FaultCode::ENCODER_LOST)
}
