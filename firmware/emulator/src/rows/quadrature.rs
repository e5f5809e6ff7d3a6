//! Quadrature rings at the highest count rate that the settings allow.

use std::path::Path;

use anyhow::{Result, bail, ensure};
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    ControllerState, Message, Move, RequestOutcome, RequestRefusal, Setting,
};
use gonia_protocol::settings::{Axis, Key};

use super::motion::{MOVE_US, POINTING_DEG};
use super::{Outcome, done, started};
use crate::chips::lock;
use crate::rig::Rig;
use crate::world::RingKind;

/// At 15°/s as many counts a second as are followed.
const TURN: u32 = 480_000;
/// Where the rings have their index, degrees: no further from home than homing should have to go.
const INDEX_DEG: [f64; 2] = [-1.0, -183.0];

/// The count of an angle.
fn counts(deg: f64) -> u32 {
    ((deg / 360.0 * f64::from(TURN)).round() as i64).rem_euclid(i64::from(TURN)) as u32
}

fn set(rig: &mut Rig, axis: Axis, key: Key, value: i32) -> Result<()> {
    let key = key.number();
    let setting = Message::SetSetting(Setting { axis, key, value });
    match rig.ask(&setting)?.1 {
        Message::SettingIs(_) => Ok(()),
        other => bail!("a setting was answered by {other:?}"),
    }
}

/// An arm with such rings.
fn with_rings(elf: &Path) -> Result<Rig> {
    let mut rig = started(elf)?;
    for (axis, index_deg) in lock(&rig.world).axes.iter_mut().zip(INDEX_DEG) {
        axis.rebuild(|config| {
            config.encoder_counts = TURN;
            config.encoder_index = counts(index_deg);
        });
        axis.ring = RingKind::Quadrature;
    }
    for axis in Axis::BOTH {
        set(&mut rig, axis, Key::EncoderKind, 2)?;
    }
    for (axis, index_deg) in Axis::BOTH.into_iter().zip(INDEX_DEG) {
        set(&mut rig, axis, Key::EncoderCountsPerTurn, TURN as i32)?;
        set(&mut rig, axis, Key::EncoderZero, counts(-index_deg) as i32)?;
    }
    let (axis, key) = (Axis::Phi, Key::MaxSpeed.number());
    let value = 15_000_001;
    let too_fast = Message::SetSetting(Setting { axis, key, value });
    let refusal = rig.refusal(&too_fast)?;
    ensure!(
        refusal == RequestRefusal::CountRate(20_001, 20_000),
        "{refusal:?}"
    );
    Ok(rig)
}

/// The same, once it has found its index.
fn homed(elf: &Path) -> Result<Rig> {
    let mut rig = with_rings(elf)?;
    rig.complete(&Message::Home, MOVE_US)?;
    Ok(rig)
}

/// On its way home both rings are followed; then φ's loses an edge.
pub fn lost_edge(elf: &Path) -> Result<Outcome> {
    let mut rig = with_rings(elf)?;
    let id = rig.begin(&Message::Home)?;
    rig.run_us(600_000)?;
    let status = rig.status()?;
    ensure!(
        status.state == ControllerState::Homing,
        "it is in {:?}",
        status.state
    );
    let way_deg = f64::from(status.axes[1].encoder_udeg - status.axes[1].commanded_udeg) * 1e-6;
    ensure!(
        way_deg.abs() < 0.1,
        "φ's ring is {way_deg:.3}° off its steps"
    );
    lock(&rig.world).axes[1].waves.skips_one = true;
    let outcome = rig.outcome(id, 1_000_000)?;
    let expected = RequestOutcome::Failed(FaultCode::EDGE_LOST);
    ensure!(outcome == expected, "it ended as {outcome:?}");
    done(
        rig,
        format!("{TURN} counts a turn are followed, and the lost edge is found"),
    )
}

/// Moves there; how far the worse axis is off, degrees.
fn pose(rig: &mut Rig, target_udeg: [i32; 2]) -> Result<f64> {
    rig.complete(&Message::Move(Move { target_udeg }), MOVE_US)?;
    let is = lock(&rig.world).true_deg();
    let off = [0, 1].map(|i| (is[i] - f64::from(target_udeg[i]) * 1e-6).abs());
    let worst = off[0].max(off[1]);
    ensure!(worst < POINTING_DEG, "an axis is {worst:.4}° off");
    Ok(worst)
}

/// A move on which something goes wrong.
fn must_fail(rig: &mut Rig, target_udeg: [i32; 2], expected: FaultCode) -> Result<()> {
    let id = rig.begin(&Message::Move(Move { target_udeg }))?;
    let outcome = rig.outcome(id, MOVE_US)?;
    ensure!(
        outcome == RequestOutcome::Failed(expected),
        "it ended as {outcome:?}"
    );
    let state = rig.status()?.state;
    ensure!(
        state == ControllerState::Fault(expected),
        "it is in {state:?}"
    );
    Ok(())
}

/// Homing with the index, three poses, a lost edge, homing again, and an index that does not come.
pub fn homing_and_faults(elf: &Path) -> Result<Outcome> {
    let mut rig = homed(elf)?;
    let mut worst = 0.0f64;
    for target in [[5, -175], [0, -184], [8, -180]] {
        worst = worst.max(pose(&mut rig, target.map(|deg| deg * 1_000_000))?);
    }
    lock(&rig.world).axes[0].waves.skips_one = true;
    must_fail(&mut rig, [3_000_000, -182_000_000], FaultCode::EDGE_LOST)?;
    rig.begin(&Message::ClearFault)?;
    rig.complete(&Message::Home, MOVE_US)?;
    pose(&mut rig, [1_000_000, -180_000_000])?;
    lock(&rig.world).axes[1].waves.index_is_cut = true;
    must_fail(&mut rig, [1_000_000, -184_000_000], FaultCode::INDEX_WRONG)?;
    let phi_deg = lock(&rig.world).true_deg()[1];
    ensure!(
        (INDEX_DEG[1] - phi_deg).abs() < 0.1,
        "the missing index was found at {phi_deg:.2}°"
    );
    done(
        rig,
        format!(
            "{TURN} counts a turn, {worst:.4}° off at most; a lost edge and a missing index are found"
        ),
    )
}

pub fn fifty_poses(elf: &Path) -> Result<Outcome> {
    let mut rig = homed(elf)?;
    let mut worst = 0.0f64;
    for i in 0..50 {
        let target = [
            (i * 7_300_000) % 20_000_000,
            -184_000_000 + (i * 11_100_000) % 30_000_000,
        ];
        worst = worst.max(pose(&mut rig, target)?);
    }
    done(
        rig,
        format!("{TURN} counts a turn, {worst:.4}° off at most"),
    )
}
